"""SuperSuit: the vehicles of a fleet as rows of a vector environment, and Stable-Baselines3 on top."""

import supersuit
from stable_baselines3 import PPO

from tagtrack.envs.parallel import parallel_env

rows = supersuit.pettingzoo_env_to_vec_env_v1(parallel_env("LeopardShark-v0", vehicles=3, tags=2))
env = supersuit.concat_vec_envs_v1(rows, 2, num_cpus=0, base_class="stable_baselines3")
PPO("MlpPolicy", env, n_steps=32, batch_size=96, n_epochs=1, device="cpu").learn(384)
