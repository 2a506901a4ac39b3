"""skrl: PPO with models of its own kind over the vector environment."""

import gymnasium as gym
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer

env = wrap_env(gym.make_vec("tagtrack:TagTrack/LeopardShark-v0", num_envs=8))


class Policy(GaussianMixin, Model):
    def __init__(self) -> None:
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device="cpu")
        GaussianMixin.__init__(self)
        self.net = torch.nn.Sequential(torch.nn.Linear(self.num_observations, 64), torch.nn.Tanh(), torch.nn.Linear(64, 2))
        self.log_sigma = torch.nn.Parameter(torch.zeros(2))

    def compute(self, inputs, role):
        return self.net(inputs["observations"]), {"log_std": self.log_sigma}


class Value(DeterministicMixin, Model):
    def __init__(self) -> None:
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device="cpu")
        DeterministicMixin.__init__(self)
        self.net = torch.nn.Sequential(torch.nn.Linear(self.num_observations, 64), torch.nn.Tanh(), torch.nn.Linear(64, 1))

    def compute(self, inputs, role):
        return self.net(inputs["observations"]), {}


agent = PPO(
    models={"policy": Policy(), "value": Value()},
    memory=RandomMemory(memory_size=32, num_envs=env.num_envs, device="cpu"),
    cfg=PPO_CFG(rollouts=32, learning_epochs=1, mini_batches=2),
    observation_space=env.observation_space,
    action_space=env.action_space,
    device="cpu",
)
SequentialTrainer(env=env, agents=agent, cfg={"timesteps": 128, "headless": True, "disable_progressbar": True}).train()
