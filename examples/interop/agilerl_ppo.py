"""AgileRL: one on-policy agent, trained by its own loop over the vector environment."""

import gymnasium as gym
from agilerl.algorithms.ppo import PPO
from agilerl.training.train_on_policy import train_on_policy

env = gym.make_vec("tagtrack:TagTrack/LeopardShark-v0", num_envs=8)
agent = PPO(env.single_observation_space, env.single_action_space, num_envs=8, learn_step=64, batch_size=128, update_epochs=1)
train_on_policy(env, "LeopardShark", "PPO", [agent], max_steps=1024, evo_steps=1024, eval_steps=8, verbose=False)
