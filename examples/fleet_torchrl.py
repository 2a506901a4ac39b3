"""The same fleet in TorchRL: a random roll-out whose tensors have an axis of vehicles, with a mask for those that have left.

    pip install torchrl && python fleet_torchrl.py
"""

try:
    from torchrl.envs.libs.pettingzoo import PettingZooWrapper
except ImportError as error:
    raise SystemExit(f"this example needs TorchRL ({error}): pip install torchrl") from None

from tagtrack.envs.parallel import parallel_env

fleet = parallel_env(
    "LeopardShark-v0",
    vehicles=3,
    tags=2,
    particles=200,
    max_cycles=60,
    overrides={"vehicle.battery": 1.5, "vehicle.battery_spread": 0.5},  # some are empty after a minute
)
env = PettingZooWrapper(fleet, use_mask=True, return_state=True)
env.set_seed(0)
rollout = env.rollout(60, break_when_any_done=False)
group = next(iter(env.group_map))
print("observation", tuple(rollout[group, "observation"].shape), "(steps, vehicles, features)")
print("steps in which each vehicle took part", rollout[group, "mask"].sum(dim=0).tolist())
print(f"mean reward {rollout['next', group, 'reward'].mean().item():.3f}")
env.close()
