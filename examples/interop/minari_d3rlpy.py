"""Minari and d3rlpy: record episodes with all that the infos tell, and learn from them offline."""

import os
import tempfile

import gymnasium as gym

os.environ["MINARI_DATASETS_PATH"] = tempfile.mkdtemp()
import d3rlpy  # noqa: E402
import minari  # noqa: E402
import numpy as np  # noqa: E402

env = minari.DataCollector(gym.make("tagtrack:TagTrack/LeopardShark-v0"), record_infos=True)
for seed in range(3):
    env.reset(seed=seed)
    ended = False
    while not ended:
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        ended = terminated or truncated
data = env.create_dataset("tagtrack/leopardshark/random-v0", algorithm_name="random", description="an example")
episodes = [data[k] for k in range(3)]
assert all(episode.infos["localization_error"].shape == (301,) for episode in episodes)
offline = d3rlpy.dataset.MDPDataset(
    observations=np.concatenate([episode.observations[:-1] for episode in episodes]),
    actions=np.concatenate([episode.actions for episode in episodes]),
    rewards=np.concatenate([episode.rewards for episode in episodes]),
    terminals=np.concatenate([episode.terminations for episode in episodes]),
    timeouts=np.concatenate([episode.truncations for episode in episodes]),
)
d3rlpy.algos.BCConfig().create(device="cpu").fit(offline, n_steps=50, n_steps_per_epoch=50, show_progress=False,
                                                 logger_adapter=d3rlpy.logging.NoopAdapterFactory())  # fmt: skip
