"""Tianshou: PPO by its high-level interface."""

import tempfile

from tianshou.highlevel.config import OnPolicyTrainingConfig
from tianshou.highlevel.env import EnvFactoryRegistered, VectorEnvType
from tianshou.highlevel.experiment import ExperimentConfig, PPOExperimentBuilder

factory = EnvFactoryRegistered(task="tagtrack:TagTrack/LeopardShark-v0", venv_type=VectorEnvType.DUMMY)
training = OnPolicyTrainingConfig(
    max_epochs=1, epoch_num_steps=640, batch_size=64, collection_step_num_env_steps=320, num_training_envs=4, num_test_envs=1,
    test_step_num_episodes=1,
)  # fmt: skip
experiment = ExperimentConfig(persistence_base_dir=tempfile.mkdtemp(), watch=False)
PPOExperimentBuilder(factory, experiment, training).build().run()
