"""sb3-contrib: a recurrent policy, by ``make_vec_env`` as its users write it."""

from sb3_contrib import RecurrentPPO
from stable_baselines3.common.env_util import make_vec_env

from tagtrack.train.vec_env import TagTrackVecEnv

env = make_vec_env("tagtrack:TagTrack/LeopardShark-v0", n_envs=8, seed=0, vec_env_cls=TagTrackVecEnv)
RecurrentPPO("MlpLstmPolicy", env, n_steps=64, batch_size=128, n_epochs=1, device="cpu").learn(1024)
