"""RLlib: PPO on its new API stack; ``tagtrack:`` lets workers in other processes find the id."""

import ray
from ray.rllib.algorithms.ppo import PPOConfig

ray.init("local", include_dashboard=False, num_cpus=1, log_to_driver=False)
config = PPOConfig().environment("tagtrack:TagTrack/LeopardShark-v0")
config = config.env_runners(num_env_runners=0, num_envs_per_env_runner=4, rollout_fragment_length=64)
config = config.training(train_batch_size_per_learner=256, minibatch_size=64, num_epochs=1).learners(num_learners=0)
algorithm = config.build_algo()
for _ in range(2):
    algorithm.train()
algorithm.stop()
ray.shutdown()
