"""TorchRL: worlds batched by its own SerialEnv, with all that the infos tell, collected under a policy."""

import torch
from tensordict.nn import TensorDictModule
from torchrl.envs import GymEnv, SerialEnv


def make() -> GymEnv:
    return GymEnv("tagtrack:TagTrack/LeopardShark-v0").auto_register_info_dict()


env = SerialEnv(4, make)
network = torch.nn.Sequential(torch.nn.LazyLinear(64), torch.nn.Tanh(), torch.nn.LazyLinear(2), torch.nn.Tanh())
policy = TensorDictModule(network, in_keys=["observation"], out_keys=["action"])
rollout = env.rollout(320, policy, break_when_any_done=False)
error = rollout["next", "localization_error"]
assert error.shape == (4, 320) and bool(error.isfinite().all())
