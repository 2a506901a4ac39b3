"""Stable-Baselines3: PPO over the batched worlds, no Monitor and no DummyVecEnv needed."""

from stable_baselines3 import PPO

from tagtrack.train.vec_env import TagTrackVecEnv

env = TagTrackVecEnv("TagTrack/LeopardShark-v0", num_envs=16)
PPO("MlpPolicy", env, n_steps=64, batch_size=256, n_epochs=2, device="cpu").learn(4096)
