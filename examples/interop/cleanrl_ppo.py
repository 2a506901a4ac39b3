"""A script in CleanRL's manner (ppo_continuous_action.py): one file, Gymnasium's vector API, nothing else."""

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

envs = gym.make_vec("tagtrack:TagTrack/LeopardShark-v0", num_envs=16)
envs = gym.wrappers.vector.RecordEpisodeStatistics(envs)
size, actions = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
STEPS, GAMMA, LAMBDA, CLIP = 64, 0.99, 0.95, 0.2


class Agent(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.critic = nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 1))
        self.actor = nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, actions))
        self.log_sigma = nn.Parameter(torch.zeros(actions))

    def act(self, x: torch.Tensor) -> Normal:
        return Normal(self.actor(x), self.log_sigma.exp())


agent = Agent()
optimizer = torch.optim.Adam(agent.parameters(), lr=3e-4, eps=1e-5)
observation, done = torch.as_tensor(envs.reset(seed=1)[0]), torch.zeros(envs.num_envs)
for _update in range(4):
    kept = []
    for _step in range(STEPS):
        with torch.no_grad():
            action = agent.act(observation).sample()
            log_probability, value = agent.act(observation).log_prob(action).sum(1), agent.critic(observation).flatten()
        following, reward, terminated, truncated, _ = envs.step(action.numpy())
        kept.append((observation, action, log_probability, value, torch.as_tensor(reward, dtype=torch.float32), done))
        observation, done = torch.as_tensor(following), torch.as_tensor(np.float32(terminated | truncated))
    seen, taken, logs, values, rewards, dones = (torch.stack(each) for each in zip(*kept, strict=True))
    advantages, last = torch.zeros_like(rewards), torch.zeros(envs.num_envs)
    with torch.no_grad():
        next_value = agent.critic(observation).flatten()
    for t in reversed(range(STEPS)):
        going = 1.0 - (dones[t + 1] if t + 1 < STEPS else done)
        delta = rewards[t] + GAMMA * going * (values[t + 1] if t + 1 < STEPS else next_value) - values[t]
        advantages[t] = last = delta + GAMMA * LAMBDA * going * last
    returns = advantages + values
    for rows in torch.randperm(STEPS * envs.num_envs).split(256):
        x, a = seen.flatten(0, 1)[rows], taken.flatten(0, 1)[rows]
        gain, ratio = advantages.flatten()[rows], (agent.act(x).log_prob(a).sum(1) - logs.flatten()[rows]).exp()
        policy_loss = -torch.min(gain * ratio, gain * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
        loss = policy_loss + 0.5 * (agent.critic(x).flatten() - returns.flatten()[rows]).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
envs.close()
