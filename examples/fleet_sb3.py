"""One policy for all vehicles of a fleet, learned by PPO of Stable-Baselines3: each row of the environment is a vehicle.

    python fleet_sb3.py [DECISIONS]

A few ten thousand decisions show that it runs; `tagtrack train --vehicles 3 --tags 2` does the same with validation,
checkpoints and a policy file that needs no torch.
"""

import sys

import numpy as np
from stable_baselines3 import PPO

from tagtrack.envs.layout import feature_names
from tagtrack.train.entity_network import EntityActorCritic
from tagtrack.train.vec_env import TagTrackVecEnv

decisions = int(float(sys.argv[1])) if len(sys.argv) > 1 else 50_000
env = TagTrackVecEnv("LeopardShark-v0", num_envs=3 * 32, vehicles=3, tags=2, hold=6, stagger=True)  # decides every 12 s
network = {"names": feature_names(env.simulation.scenario), "width": 64, "ahead": 0.5}  # untrained, it sails for the tags
model = PPO(EntityActorCritic, env, n_steps=32, batch_size=1024, n_epochs=4, gamma=0.98, policy_kwargs=network, seed=0)
model.learn(decisions)

env.stagger = False
observation, errors = env.reset(), []
for _ in range(50):
    action, _ = model.predict(observation, deterministic=True)
    observation, _, done, infos = env.step(action)
    errors += [info["episode"]["localization_error"] for info in infos if "episode" in info]
print(f"mean localization error over {len(errors)} vehicles' episodes: {np.mean(errors):.1f} m")
env.close()
