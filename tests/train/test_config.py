"""config.json: what is written comes back, the command line goes before it, and what is wrong in it is named."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from tagtrack.train.cli import parse
from tagtrack.train.config import TrainConfig, from_json, to_json

CONFIG = TrainConfig(
    steps=1000,
    preset="masmitja2023",
    tracks=Path("a.csv"),
    time_scale=0.5,
    set=(("a=1", "b=2"), ("c=3",)),
    hyper=(("gamma=0.9",),),
)


def write(path: Path, content: object) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_what_was_written_comes_back(tmp_path):
    assert from_json(write(tmp_path / "config.json", to_json(CONFIG))) == replace(CONFIG, set=(("a=1", "b=2", "c=3"),))


def test_the_command_line_goes_before_the_file_name_by_name(tmp_path):
    file = str(write(tmp_path / "config.json", to_json(CONFIG)))
    config = parse(["--config", file, "--steps", "2e3", "--set", "b=5", "--set", "d=4"])
    assert (config.steps, config.time_scale) == (2000, 0.5)
    assert config.set == (("a=1", "c=3"), ("b=5",), ("d=4",)) and config.hyper == (("gamma=0.9",),)


def test_whole_numbers_may_have_an_exponent(tmp_path):
    assert from_json(write(tmp_path / "config.json", '{"steps": 1e6, "seed": 3.0}')) == TrainConfig(steps=1_000_000, seed=3)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"seed": "x"}, 'seed must be a whole number, got "x"'),
        ({"seed": None}, "seed must be a whole number, got null"),
        ({"seed": True}, "seed must be a whole number, got true"),
        ({"steps": 1.5}, "steps must be a whole number or null, got 1.5"),
        ('{"time_scale": NaN}', "time_scale must be a number or null, got NaN"),
        ({"set": 3}, "set must be a list of texts NAME=VALUE, got 3"),
        ({"hyper": ["gamma=1", 5]}, "hyper must be a list of texts NAME=VALUE, got"),
        ({"env": 5}, "env must be a text, got 5"),
        ({"out": 5}, "out must be a text or null, got 5"),
        ({"algo": "dqn"}, 'algo must be one of ppo, sac, got "dqn"'),
        ({"algo": []}, "algo must be one of ppo, sac, got []"),
        ({"speed": 5}, "unknown setting 'speed'; did you mean seed? known: env, algo, steps"),
        ({"trust": True}, "unknown setting 'trust'"),
        ([], "must hold an object of settings, got list"),
        ("{", "not a JSON file"),
        ("[" * 100_000, "not a JSON file"),
    ],
)
def test_what_is_wrong_is_named_with_file_key_and_value(tmp_path, train, content, words):
    write(tmp_path / "other.json", content)
    status, _, error = train("--config", "other.json")
    assert status == 2 and error.startswith("error: other.json: ") and words in error and error.count("\n") == 1


@pytest.mark.parametrize("path", ["pipe", "/dev/zero", "."])
def test_what_is_no_ordinary_file_is_not_read(tmp_path, train, path):
    os.mkfifo(tmp_path / "pipe")
    status, _, error = train("--config", path)
    assert (status, error) == (2, f"error: {path} is no ordinary file; give the config.json of a run\n")
