"""compare: paired by construction, deterministic, and checked before the first step."""

import numpy as np
import pytest

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.task import build_task
from tagtrack.eval import compare
from tagtrack.eval.comparison import typical_episodes
from tagtrack.eval.contestants import find_makers, name_contestants, name_groups
from tagtrack.eval.metrics import paired_ratio
from tagtrack.eval.report import caption
from tagtrack.eval.rollout import SeedBlock


def test_a_policy_against_itself_is_exactly_even(task):
    comparison = compare(task, {"one": "circle:30", "other": "circle:30"}, episodes=6)
    ratio = comparison.ratios["one/other"]
    assert (ratio.value, ratio.low, ratio.high) == (1.0, 1.0, 1.0)
    np.testing.assert_array_equal(comparison.records["one"].error, comparison.records["other"].error)


def test_arrays_and_figures_belong_together(task):
    comparison = compare(task, ["stationary", "pursuit"], episodes=4, seed=9)
    assert list(comparison.records) == list(comparison.summaries) == ["stationary", "pursuit"]
    assert comparison.records["pursuit"].error.shape == (4, task.scenario.episode_steps)
    assert comparison.summaries["pursuit"]["mean_error_m"].value == pytest.approx(
        comparison.records["pursuit"].error.mean()
    )
    assert comparison.ratios["stationary/pursuit"] == paired_ratio(*comparison.records.values())
    document = comparison.document({"tagtrack": "0"})
    assert (document["env"], document["episodes"], document["seed"], document["particles"]) == ("custom", 4, 9, 60)


def test_steps_before_the_first_that_counts_are_in_no_figure(task):
    whole = compare(task, ["stationary", "pursuit"], episodes=4)
    late = compare(task, ["stationary", "pursuit"], episodes=4, from_step=30)
    for name, record in late.records.items():
        np.testing.assert_array_equal(record.error, whole.records[name].error[:, 30:])
        np.testing.assert_array_equal(record.range, whole.records[name].range[:, 30:])
        assert late.summaries[name]["mean_error_m"].value == pytest.approx(record.error.mean())
    assert late.document({})["from_step"] == 30 and "from step 30 on" in caption(late.document({}))
    assert "from step" not in caption(whole.document({}))


def test_runs_of_a_training_are_one_row_in_which_each_weighs_the_same(task):
    seeds = {"seed0": "circle:20", "seed1": "circle:60"}
    comparison = compare(task, {"pursuit": "pursuit", **seeds, "learned": seeds}, episodes=5)
    each, both = comparison.mean_errors(), comparison.mean_errors()["learned"]
    np.testing.assert_allclose(both, (each["seed0"] + each["seed1"]) / 2)
    assert comparison.ratios["pursuit/learned"].value == pytest.approx(each["pursuit"].mean() / both.mean())
    ranges = [comparison.summaries[name]["mean_range_m"].value for name in (*seeds, "learned")]
    assert ranges[2] == pytest.approx((ranges[0] + ranges[1]) / 2)
    document = comparison.document({})
    assert document["groups"]["learned"]["seed1"]["mean_error_m"] == pytest.approx(each["seed1"].mean())
    assert "learned is 2 training runs, ratios " in caption(document)
    alone = compare(task, {"pursuit": "pursuit", "learned": {"seed0": "circle:20"}}, episodes=5).document({})
    assert "learned is one training run: its intervals say nothing of other runs" in caption(alone)


def test_groups_are_named_on_command_lines():
    assert name_groups(["circle:radius=40", "mine=runs/a,runs/b", "uncertain:spacing=0.3"]) == {
        "circle:radius=40": "circle:radius=40", "mine": {"a": "runs/a", "b": "runs/b"},
        "uncertain:spacing=0.3": "uncertain:spacing=0.3",
    }  # fmt: skip


@pytest.mark.parametrize(("specs", "complaint"), [(["mine="], "the group 'mine=' has no run"), (["a=x", "a=y"], "name 'a'")])
def test_a_group_needs_runs_and_a_name_of_its_own(specs, complaint):
    with pytest.raises(ValueError, match=complaint):
        name_groups(specs)


def test_a_mapping_without_runs_is_refused(task):
    with pytest.raises(ValueError, match="the group 'learned' has no run"):
        compare(task, {"pursuit": "pursuit", "learned": {}}, episodes=1)


def test_a_metric_is_tried_before_the_first_step(task):
    steps = []
    with pytest.raises(ValueError, match="the metric 'odd' must give one number for each episode"):
        odd = {"odd": lambda record: record.error.mean()}
        compare(task, ["pursuit"], episodes=2, metrics=odd, on_step=lambda name, done: steps.append(done))
    assert not steps


def test_recorded_tracks_tell_how_many_episodes_share_nothing(tmp_path):
    time = np.arange(0.0, 4000.0, 10.0)
    rows = [f"{t},{0.1 * t},{30 * np.sin(t / 300)}" for t in time]
    (tmp_path / "track.csv").write_text("\n".join(["t_unix_s,x,y", *rows]))
    tracked = build_task("LeopardShark-v0", tracks=tmp_path / "track.csv", particles=20, overrides={"episode_steps": 100})
    comparison = compare(tracked, ["pursuit", "circle"], episodes=40)
    assert comparison.clusters.windows == pytest.approx(3990 / 200, abs=0.02)
    assert np.isfinite(comparison.ratios["pursuit/circle"].low)
    assert "20 episodes that share nothing" in caption(comparison.document({}))
    short = build_task("LeopardShark-v0", tracks=tmp_path / "track.csv", particles=20, overrides={"episode_steps": 500})
    few = compare(short, ["pursuit"], episodes=12)
    assert np.isnan(few.summaries["pursuit"]["mean_error_m"].low)
    assert "fewer than 10, so that there are no intervals" in caption(few.document({}))


def test_an_id_a_policy_and_a_maker_will_do_too(task, save_run, tmp_path):
    given = {
        "spec": "pursuit",
        "maker": lambda simulation: make_baseline("pursuit", simulation),
        "policy": AlwaysAhead(),
        "folder": save_run(tmp_path / "run"),
    }
    comparison = compare(task, given, episodes=2)
    np.testing.assert_array_equal(comparison.records["maker"].error, comparison.records["spec"].error)
    np.testing.assert_allclose(comparison.records["policy"].error, comparison.records["spec"].error, atol=1e-2)
    assert comparison.records["folder"].error.shape == comparison.records["spec"].error.shape


class AlwaysAhead:
    """Pursuit by hand."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return np.tile(np.float32([1, 0]), (len(observation), 1)), None


def test_particles_change_the_task_of_an_id():
    comparison = compare("LeopardShark-v0", ["pursuit"], episodes=1, particles=20)
    assert comparison.env == "TagTrack/LeopardShark-v0"
    assert comparison.task.scenario.belief.particles == 20


def test_tuning_and_benchmark_meet_other_fish(task):
    tuned = compare(task, ["circle"], episodes=2, block=SeedBlock.TUNING)
    benchmarked = compare(task, ["circle"], episodes=2)
    assert not np.any(tuned.records["circle"].range == benchmarked.records["circle"].range)


def test_all_policies_are_checked_before_the_first_step(task):
    steps = []
    with pytest.raises(ValueError, match="radius must be positive"):
        compare(task, ["pursuit", "circle:-1"], episodes=1, on_step=lambda name, done: steps.append(done))
    assert not steps


@pytest.mark.parametrize("spec", [3, None, [1.0]])
def test_what_is_no_policy_is_refused(task, spec):
    with pytest.raises(ValueError, match="a policy is a baseline, a folder"):
        find_makers({"x": spec}, task, "")


def test_a_run_goes_by_its_folders_name(tmp_path):
    assert name_contestants(["circle:40", f"{tmp_path}/runs/first/"]) == {
        "circle:40": "circle:40",
        "first": f"{tmp_path}/runs/first/",
    }


def test_typical_episodes_are_the_middle_one_and_a_hard_one(task):
    comparison = compare(task, ["pursuit"], episodes=20)
    errors = comparison.mean_errors()["pursuit"]
    chosen = typical_episodes(comparison)
    assert (errors < errors[chosen["median"]]).sum() == 9  # (20 - 1) // 2 are better
    assert (errors < errors[chosen["hard"]]).sum() == 18  # 95 % of 19


def test_importing_the_package_loads_neither_torch_nor_matplotlib(run_python):
    code = "import sys, tagtrack.eval as e; e.compare; print([m for m in ('torch', 'matplotlib') if m in sys.modules])"
    assert run_python(code).strip() == "[]"
    bare = "import sys, tagtrack.eval; print([m for m in ('numba', 'tyro') if m in sys.modules])"
    assert run_python(bare).strip() == "[]"
