"""Rows of the leaderboard by other people's algorithms as they come: PPO of Stable-Baselines3 and RecurrentPPO of sb3-contrib.

    python examples/leaderboard_sb3.py ppo RangeOnly-v0 runs/SB3/RangeOnly-v0.zip
    tagtrack eval suite --policies "SB3=runs/SB3/{task}.zip" --trust

PPO has the library's own hyper-parameters; those of RecurrentPPO (34 steps/s) are made for few worlds, so it gets more worlds and
larger batches. Nothing is chosen, and the last policy counts.
"""

import sys
from pathlib import Path

import torch

from tagtrack.train.vec_env import TagTrackVecEnv

STEPS = 200_000


def main(algorithm: str, env_id: str, out: str) -> None:
    torch.set_num_threads(1)  # more cost more than they give on networks this small
    if algorithm == "recurrent":
        from sb3_contrib import RecurrentPPO  # pip install sb3-contrib

        env = TagTrackVecEnv(env_id, 64)
        network = {"lstm_hidden_size": 64, "net_arch": [64]}
        model = RecurrentPPO(
            "MlpLstmPolicy", env, n_steps=64, batch_size=2048, n_epochs=4, seed=0, device="cpu", policy_kwargs=network
        )
    else:
        from stable_baselines3 import PPO

        env = TagTrackVecEnv(env_id, 8)
        model = PPO("MlpPolicy", env, seed=0, device="cpu")
    model.learn(STEPS, progress_bar=sys.stderr.isatty())
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    model.save(out)


if __name__ == "__main__":
    main(*sys.argv[1:])
