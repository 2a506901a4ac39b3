"""Data sets in Minari's format: what is recorded is what the environment did, and Minari reads it back."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import tagtrack  # noqa: F401  registers the ids
from tagtrack.eval.cli import main
from tagtrack.eval.minari_sets import find_policy
from tagtrack.eval.rollout import SeedBlock, block_seed


def test_recorded_episodes_are_those_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replayed action by action from the recorded seed, a single environment gives the recorded numbers."""
    minari = pytest.importorskip("minari")
    pytest.importorskip("h5py")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    arguments = ["minari", "--envs", "LeopardShark-v0", "--policies", "heuristic", "random", "--episodes", "2"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    for name in ("heuristic", "random"):
        data = minari.load_dataset(f"tagtrack/leopardshark/{name}-v0")
        assert data.total_episodes == 2 and data.total_steps == 600
        env = data.recover_environment()
        episode = data[1]
        observation, info = env.reset(seed=block_seed(SeedBlock.TRAINING, 1))
        for step in range(50):
            np.testing.assert_array_equal(episode.observations[step], observation)
            np.testing.assert_array_equal(episode.infos["localization_error"][step], info["localization_error"])
            observation, reward, *_, info = env.step(episode.actions[step])
            assert episode.rewards[step] == reward
        assert episode.truncations.tolist() == [False] * 299 + [True] and not episode.terminations.any()
    assert main([*arguments, "--out", str(tmp_path)]) == 2  # nothing is written over


def test_missing_minari_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "minari", None)
    assert main(["minari", "--out", str(tmp_path)]) == 2
    assert 'pip install "tagtrack[minari]"' in capsys.readouterr().err


def test_receivers_on_moorings_have_no_actions_to_record() -> None:
    with pytest.raises(ValueError, match="static_array:200 steers no vehicle"):
        find_policy("static_array:200", "TagTrack/LeopardShark-v0")
    assert gym.spec("TagTrack/LeopardShark-v0") and find_policy("heuristic", "TagTrack/RangeOnly-v0")[0] == "circle:40"
