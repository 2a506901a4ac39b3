"""`tagtrack eval suite`: every environment by one protocol, and a score on which the paper's controller is 0 and learned 1."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import tagtrack
from tagtrack.eval import suite_run
from tagtrack.eval.episode_record import EpisodeRecord
from tagtrack.eval.statistics.estimate import Estimate
from tagtrack.eval.suite_run import TASKS, cost_of, name_policies, overall, players, score, suite_document
from tagtrack.policies.box import BOX


def ratio(value: float, error: float = 0.1) -> Estimate:
    return Estimate(value=value, below=error, above=error, relative=True)


def test_suite_holds_every_id_and_fleets():
    assert {f"TagTrack/{task.env}" for task in TASKS} == set(tagtrack._TASKS)
    assert sum(bool(task.vehicles) for task in TASKS) == 2


def test_score_is_0_for_the_papers_controller_1_for_the_best_known_and_linear_in_the_logarithm():
    unit = math.log(overall([ratio(1.2), ratio(1.8)]).value)
    assert score(overall([ratio(1.0), ratio(1.0)]), unit).value == 0
    assert score(overall([ratio(1.2), ratio(1.8)]), unit).value == pytest.approx(1)
    squared = score(overall([ratio(1.2**2), ratio(1.8**2)]), unit)
    assert squared.value == pytest.approx(2) and squared.low < 2 < squared.high
    # a half in one of two tasks alone: log(1.8) / 2 over (log(1.2) + log(1.8)) / 2
    assert score(overall([None, ratio(1.8)]), unit).value == pytest.approx(math.log(1.8) / math.log(1.2 * 1.8))


def test_cost_is_minus_the_reward():
    record = EpisodeRecord(error=np.ones((1, 2)), reward=np.array([[-0.25, -0.5]]))
    assert cost_of(record).error.tolist() == [[0.25, 0.5]]


def test_a_policy_of_another_layout_sits_out_and_counts_like_the_papers_controller(save_run, tmp_path):
    run = save_run(tmp_path / "mine")
    shark, standoff = TASKS[:2]
    names = name_policies((f"mine={run}",))
    assert list(players(shark, shark.build(), names, trust=False)) == ["paper", "mine", "learned"]
    assert list(players(standoff, standoff.build(), names, trust=False)) == ["paper", "learned"]
    built = {task: task.build() for task in (shark, standoff)}
    both = {"LeopardShark-v0": ratio(1.2), "LeopardSharkStandoff-v0": ratio(3.0)}
    found = {"mine": {"LeopardShark-v0": ratio(1.2)}, "learned": both}
    document = suite_document([shark, standoff], built, found, episodes=1, command="")
    assert document["policies"]["mine"]["score"]["value"] == pytest.approx(math.log(1.2) / math.log(3.6))
    assert list(document["policies"]["mine"]["tasks"]) == ["LeopardShark-v0"]


def test_file_holds_what_the_leaderboard_is_made_from(evaluate, tmp_path, monkeypatch):
    monkeypatch.setattr(suite_run, "QUICK", 3)
    path = tmp_path / "suite.json"
    words = ("--quick", "--tasks", "LeopardShark-v0", "--policies", "heuristic", "pursuit")
    status, out, _ = evaluate("suite", *words, "--out", path)
    assert status == 0 and "learned" in out
    document = json.loads(path.read_text())
    assert list(document["policies"]) == ["paper", "heuristic", "pursuit", "learned"]
    assert document["policies"]["learned"]["score"]["value"] == pytest.approx(1)
    assert document["command"].startswith("tagtrack eval suite --policies heuristic pursuit --tasks LeopardShark-v0 --quick")
    assert document["tasks"] == [{"name": "LeopardShark-v0", "paper": "three_step"}]


def test_tasks_that_a_policy_does_not_play_are_told_with_the_reason(evaluate, tmp_path, monkeypatch):
    monkeypatch.setattr(suite_run, "QUICK", 2)
    words = ("--quick", "--tasks", "LeopardShark-v0", "LeopardShark-2x4", "--policies", "circle", f"one={BOX / 'LeopardShark'}")
    status, out, _ = evaluate("suite", *words, "--out", tmp_path / "suite.json")
    assert status == 0 and "note: one does not play LeopardShark-2x4: " in out and out.count("does not play") == 1


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--tasks", "Pond-v0"), "unknown task 'Pond-v0' of the suite; known: LeopardShark-v0"),
        (("--tasks", "LeopardShark-v0", "--policies", "zigzag"), "zigzag plays none of the tasks: unknown policy 'zigzag'"),
        (("--policies", "a=pursuit", "a=circle"), "two policies go by the name 'a'"),
    ],
)
def test_suite_names_what_cannot_be(evaluate, words, complaint):
    status, _, errors = evaluate("suite", *words)
    assert status == 2 and complaint in errors
