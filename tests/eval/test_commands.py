"""`tagtrack eval` as a user types it: files written, their layout, and what the commands promise of each other."""

import json
import subprocess
import sys

import pytest

from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.eval.options import ManyParticles, TaskOptions
from tagtrack.eval.rollout import SeedBlock, block_seed
from tagtrack.eval.tune import finer, longer, usual_grid
from tests.eval.conftest import PARTICLES, SHORT

FIGURES = {
    "mean_error_m", "median_error_m", "rmse_m", "p95_error_m", "trimmed_mean_error_m", "error_if_not_lost_m", "lost_fraction",
    "mean_range_m", "inside_perimeter",
}  # fmt: skip

AREA = SCENARIOS["TagTrack/AreaOnly-v0"]


def run_eval(*arguments, cwd):
    command = [sys.executable, "-m", "tagtrack.eval", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)


def read_json(path):
    return json.loads(path.read_text(encoding="utf-8"))


def test_benchmark_writes_table_json_and_pictures(tmp_path, save_run):
    save_run(tmp_path / "my_run")
    save_run(tmp_path / "my_other_run")
    arguments = ("--policies", "three_step", "circle:40", "both=my_run,my_other_run", "--out", "out", "--seed", "5")
    done = run_eval("benchmark", "--env", "LeopardShark-v0", *SHORT, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "three_step" in done.stdout
    assert "written: out" in done.stdout
    assert "steps/s" not in done.stderr  # no progress bar where there is no terminal
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == [
        "benchmark.json", "config.json", "errors.png", "report.html", "table.md", "track_median.png",
    ]  # fmt: skip
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in out.glob("*.png"))
    result = read_json(out / "benchmark.json")
    assert list(result) == [
        "env", "episodes", "seed", "from_step", "groups", "particles", "tracks", "notes", "versions", "policies", "ratios",
    ]  # fmt: skip
    assert result["env"] == "TagTrack/LeopardShark-v0"
    assert (result["episodes"], result["seed"], result["particles"]) == (6, 5, PARTICLES)
    assert {"tagtrack", "commit", "python", "numpy", "numba"} <= set(result["versions"])
    assert list(result["policies"]) == ["three_step", "circle:40", "both"]
    for figures in result["policies"].values():
        assert set(figures) == FIGURES
        assert all(list(figure) == ["value", "low", "high"] for figure in figures.values())
        assert figures["inside_perimeter"]["value"] is None  # LeopardShark has no perimeter
    assert list(result["ratios"]) == [f"three_step/{name}" for name in ("circle:40", "both")]
    asked = read_json(out / "config.json")
    assert asked["policies"]["both"] == {"my_run": "my_run", "my_other_run": "my_other_run"}
    assert asked["overrides"] == {"episode_steps": "40"}


def test_fleets_have_columns_of_their_own(tmp_path):
    arguments = ("--vehicles", "2", "--tags", "3", "--modem", "tdma", "--policies", "circle", "uncertain", "--out", "out")
    done = run_eval("benchmark", "--env", "LeopardShark-v0", *SHORT, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = read_json(tmp_path / "out/benchmark.json")
    assert result["fleet"] == {"vehicles": 2, "tags": 3, "modem": "tdma"}
    for figures in result["policies"].values():
        assert set(figures) > FIGURES
        tags = [figures[f"tag_{tag}_error_m"]["value"] for tag in range(3)]
        assert figures["mean_error_m"]["value"] == pytest.approx(sum(tags) / 3)
        assert figures["worst_tag_error_m"]["value"] >= max(tags)
        assert figures["messages_per_hour"]["value"] == 360  # every slot of 10 s from 0 s on
    table = (tmp_path / "out/table.md").read_text()
    assert "| lost [%] | worst tag [m] | too near [1/h] | messages [1/h] |" in table
    assert "2 vehicles, 3 tags, modem tdma" in table
    assert read_json(tmp_path / "out/config.json")["vehicles"] == 2
    assert (tmp_path / "out/track_median.png").exists()


def test_fleets_are_tuned_and_timed(evaluate, tmp_path):
    fleet = ("--vehicles", "2", "--tags", "2", "--modem", "none")
    command = ("tune", *SHORT, *fleet, "--policy", "uncertain", "--parameter", "hold", "--values", "6", "20")
    status, out, _ = evaluate(*command, "--out", tmp_path / "tune.json")
    assert status == 0 and "worst" in out
    assert [row["policy"] for row in read_json(tmp_path / "tune.json")["values"]] == ["uncertain:hold=6", "uncertain:hold=20"]
    command = ("speed", *fleet, "--num-worlds", "2", "--threads", "1", "--particles", "100", "--rounds", "1", "--seconds", "0.02")
    status, out, _ = evaluate(*command, "--json", tmp_path / "speed.json")
    assert status == 0 and "joint" in out
    rows = read_json(tmp_path / "speed.json")["rows"]
    assert [(row["kind"], row["beliefs"]) for row in rows] == [("filter", 1), ("env", 4)]
    assert rows[1]["particle_updates_per_s"] == pytest.approx(4 * 100 * rows[1]["env_steps_per_s"])


def test_policy_that_is_not_for_fleets_says_so(tmp_path):
    own = "from tagtrack.baselines.heuristic import InformedHeuristic as Base\nclass Knower(Base):\n    choose = print\n"
    (tmp_path / "own_knower.py").write_text(own)
    done = run_eval("benchmark", *SHORT, "--vehicles", "2", "--policies", "own_knower:Knower", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    line = "error: Knower is for one vehicle and one tag (unless its class says fleets = True), got vehicles=2, tags=1\n"
    assert done.stderr.endswith(line)


def test_table_and_json_name_the_preset(evaluate, tmp_path):
    command = ("benchmark", "--env", "RangeOnly-v0", "--preset", "masmitja2023", *SHORT, "--policies", "pursuit")
    status, out, _ = evaluate(*command, "--out", tmp_path / "out")
    assert status == 0 and "RangeOnly-v0 (masmitja2023)" in " ".join(out.split())
    assert read_json(tmp_path / "out/benchmark.json")["env"] == "TagTrack/RangeOnly-v0 (masmitja2023)"


def test_benchmark_again_replaces_the_earlier_one_and_gives_the_same(evaluate, tmp_path):
    command = ("benchmark", *SHORT, "--out", tmp_path / "out", "--policies", "pursuit", "stationary")
    assert evaluate(*command, "--episodes", "8")[0] == 0
    first = (tmp_path / "out/benchmark.json").read_bytes()
    assert (tmp_path / "out/track_hard.png").exists()
    assert evaluate(*command, "--episodes", "8", "--threads", "2")[0] == 0
    assert (tmp_path / "out/benchmark.json").read_bytes() == first
    assert evaluate(*command, "--episodes", "4")[0] == 0
    assert not (tmp_path / "out/track_hard.png").exists()  # of the earlier one; four episodes have none


def test_standoff_tells_the_time_inside_the_perimeter(evaluate, tmp_path):
    command = ("benchmark", "--env", "LeopardSharkStandoff-v0", *SHORT, "--policies", "pursuit", "--out", tmp_path / "out")
    for perimeter, inside in ((1000, 1.0), (0.001, 0.0)):
        assert evaluate(*command, "--set", f"reward.perimeter={perimeter}")[0] == 0
        figures = read_json(tmp_path / "out/benchmark.json")["policies"]["pursuit"]
        assert figures["inside_perimeter"]["value"] == inside


def test_benchmark_runs_on_a_recorded_track(evaluate, tmp_path):
    rows = "".join(f"{second},{0.4 * second},0\n" for second in range(400))
    (tmp_path / "track.csv").write_text("t_unix_s,x,y\n" + rows)
    command = ("benchmark", *SHORT, "--tracks", tmp_path / "track.csv", "--time-scale", "0.5", "--policies", "circle")
    assert evaluate(*command, "--out", tmp_path / "out")[0] == 0
    assert read_json(tmp_path / "out/config.json")["time_scale"] == 0.5


def test_results_say_which_animals_were_replayed(tmp_path):
    """A herd of two lobsters that crawl 1 cm/s, a row every five minutes; one of them is lost for three hours."""
    spans = (("65001", 0, 14_400), ("65002", 0, 7_200), ("65002", 18_000, 25_200))
    rows = [(tag, t) for tag, first, last in spans for t in range(first, last + 1, 300)]
    (tmp_path / "herd.csv").write_text("tag,t_unix_s,x,y\n" + "".join(f"{tag},{t},{0.01 * t},0\n" for tag, t in rows))
    arguments = ("--tracks", "herd.csv", "--time-scale", "20", "--policies", "pursuit", "static_array", "--out", "out")
    done = run_eval("benchmark", *SHORT, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = {"file": "herd.csv", "animals": 2, "stretches": 3, "hours": 8.0, "time_scale": 20.0, "longest_gap": 900.0}
    assert read_json(tmp_path / "out/benchmark.json")["tracks"] == told | {"windows": pytest.approx(18.1), "sufficient": False}
    assert read_json(tmp_path / "out/config.json")["replayed"] == told
    line = "recorded tracks of herd.csv at 20 times their speed: animals 2, unbroken stretches 3, 8 h in all, "
    assert line in (tmp_path / "out/table.md").read_text()
    assert line in " ".join(done.stdout.split())


def test_motion_is_the_short_form_of_setting_the_fish(evaluate, tmp_path):
    for name, arguments in (("short", ("--motion", "levy")), ("long", ("--set", "fish=levy")), ("own", ())):
        assert evaluate("benchmark", *SHORT, *arguments, "--policies", "pursuit", "--out", tmp_path / name)[0] == 0
    short, long, own = (read_json(tmp_path / name / "benchmark.json")["policies"] for name in ("short", "long", "own"))
    assert short == long != own
    assert read_json(tmp_path / "short/config.json")["overrides"]["fish"] == "levy"


def test_default_folder_is_under_runs(evaluate, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert evaluate("benchmark", *SHORT, "--policies", "pursuit")[0] == 0
    (made,) = (tmp_path / "runs").iterdir()
    assert made.name.startswith("benchmark-LeopardShark-v0-")
    assert (made / "benchmark.json").is_file()


def test_tune_finds_the_radius_on_seeds_that_no_benchmark_uses(evaluate, tmp_path, monkeypatch):
    seeds = []
    from tagtrack.eval import rollout

    def spy(task, maker, *, seed, episodes, **rest):
        seeds.append((seed, seed + episodes))
        return roll_out(task, maker, seed=seed, episodes=episodes, **rest)

    roll_out = rollout.roll_out
    monkeypatch.setattr(rollout, "roll_out", spy)
    command = ("tune", *SHORT, "--policy", "circle", "--values", "10", "90", "--seed", "3")
    status, out, _ = evaluate(*command, "--out", tmp_path / "tune.json")
    assert status == 0
    largest_benchmark_seed = block_seed(SeedBlock.BENCHMARK, 2**31 - 1) + 10**6
    assert seeds == [(block_seed(SeedBlock.TUNING, 3), block_seed(SeedBlock.TUNING, 3) + 6)] * 2
    assert all(first > largest_benchmark_seed for first, _ in seeds)
    result = read_json(tmp_path / "tune.json")
    assert [row["policy"] for row in result["values"]] == ["circle:10", "circle:90"]
    best = min(result["values"], key=lambda row: row["mean_error_m"]["value"])
    assert result["best"] == best["policy"]
    assert best["best_over_this"]["value"] == 1
    assert f"best: {best['policy']}, mean error" in out


@pytest.mark.parametrize(
    ("asked", "specs"),
    [
        (("--policy", "three_step", "--values", "5"), ["three_step:5"]),
        (("--policy", "information:hold=8", "--values", "2"), ["information:hold=8,horizon=2"]),
        (("--policy", "information", "--parameter", "hold", "--values", "2"), ["information:hold=2"]),
    ],
)
def test_tune_takes_any_number_of_any_baseline(evaluate, tmp_path, asked, specs):
    assert evaluate("tune", *SHORT, "--episodes", "2", *asked, "--out", tmp_path / "tune.json")[0] == 0
    assert [row["policy"] for row in read_json(tmp_path / "tune.json")["values"]] == specs


@pytest.mark.parametrize(
    ("parameter", "values", "best", "beyond"),
    [
        ("radius", (10, 14, 20), 20, [28.6, 40.8]),
        ("radius", (10, 14, 20), 10, [7.14, 5.1]),
        ("radius", (10, 14, 20), 14, []),
        ("horizon", (1, 2, 3, 5), 5, [8, 14]),
        ("horizon", (1, 2, 3, 5), 1, []),
        ("tau", (5, 10), 10, []),
    ],
)
def test_a_grid_goes_on_where_the_best_lies_at_its_end(parameter, values, best, beyond):
    grid = usual_grid(parameter, Scenario())
    assert longer(grid, values, best) == beyond


def test_a_grid_gets_finer_about_the_best():
    assert finer(usual_grid("radius", Scenario()), [5.0, 10.0, 20.0], 10.0) == [7.07, 14.1]
    assert finer(usual_grid("horizon", Scenario()), [1, 5, 13], 5) == [2, 3, 4, 6, 7, 8]
    assert finer(usual_grid("tau", Scenario()), [5, 10], 10) == [7.5]


def test_usual_grids_are_of_the_tasks_own_size():
    assert max(usual_grid("radius", Scenario()).values) < 50
    assert 340 in range(int(min(usual_grid("radius", AREA).values)), int(max(usual_grid("radius", AREA).values)))


def test_tune_without_values_refines_and_with_values_warns_of_the_edge(evaluate, tmp_path):
    status, out, _ = evaluate("tune", *SHORT, "--episodes", "2", "--out", tmp_path / "tune.json")
    assert status == 0
    assert len(read_json(tmp_path / "tune.json")["values"]) > len(usual_grid("radius", Scenario()).values)
    status, out, _ = evaluate("tune", *SHORT, "--episodes", "2", "--values", "5", "90")
    assert status == 0 and "warning: the best is the" in out and "try --values beyond it" in out


def test_tradeoff_draws_heuristics_and_runs(evaluate, tmp_path, save_run):
    runs = [save_run(tmp_path / name, speed_control=True) for name in ("weight_1", "weight_3")]
    command = ("tradeoff", *SHORT, "--episodes", "3", "--perimeters", "10", "30", "--radii", "25", "--runs", *runs)
    status, out, _ = evaluate(*command, "--out", tmp_path / "out")
    assert status == 0
    assert "three_step:perimeter=10" in out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["tradeoff.json", "tradeoff.md", "tradeoff.png"]
    result = read_json(tmp_path / "out/tradeoff.json")
    assert result["env"] == "TagTrack/LeopardSharkStandoff-v0"
    assert result["perimeter"] == 20
    labels = {title: [point["label"] for point in points] for title, points in result["curves"].items()}
    assert labels == {
        "three_step, perimeters": ["10 m", "30 m"],
        "circle, radii": ["25 m"],
        "learned": ["weight_1", "weight_3"],
    }
    for points in result["curves"].values():
        assert all(point["inside_perimeter"]["value"] is not None for point in points)


def test_consistency_stands_beside_table_ii(evaluate, tmp_path):
    status, out, _ = evaluate("consistency", *SHORT, "--policy", "circle:20", "--out", tmp_path / "out")
    assert status == 0
    assert "e < sigma [%]" in out
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["calibration.png", "consistency.json"]
    result = read_json(tmp_path / "out/consistency.json")
    assert result["table_ii"]["e_below_sigma"] == 0.42
    assert set(result["table_ii"]) < set(result["figures"])
    inside = [result["figures"][f"inside_{percent}"]["value"] for percent in (50, 90, 99)]
    assert 0 <= inside[0] <= inside[1] <= inside[2] <= 1


def test_speed_gives_every_row_beside_the_reference(evaluate, tmp_path):
    command = ("speed", "--num-worlds", "1", "4", "--threads", "1", "2", "--particles", "100", "--rounds", "1")
    status, out, _ = evaluate(*command, "--seconds", "0.02", "--json", tmp_path / "speed.json")
    assert status == 0
    assert "Reference:" in out
    result = read_json(tmp_path / "speed.json")
    assert result["reference_particle_updates_per_s"] > 0
    rows = [(row["kind"], row["num_worlds"], row["threads"]) for row in result["rows"]]
    combinations = [(1, 1), (4, 1), (4, 2)]  # two threads for one world are left out
    assert rows == [
        *(("filter", *each) for each in combinations),
        *(("env", *each) for each in combinations),
        ("vector", 4, 1),
        ("gym", 1, 1),
    ]
    for row in result["rows"]:
        assert {"env", "num_worlds", "particles", "threads", "env_steps_per_s", "ratio_to_reference"} <= set(row)
        assert row["particle_updates_per_s"] == pytest.approx(100 * row["env_steps_per_s"])


def test_help_names_every_command_and_nothing_else_happens(tmp_path):
    done = run_eval(cwd=tmp_path)
    assert done.returncode == 2
    for command in ("benchmark", "tune", "tradeoff", "consistency", "speed"):
        assert command in done.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["benchmark", "tune", "tradeoff", "consistency", "speed"])
def test_help_of_a_command_ends_well(evaluate, command):
    status, out, _ = evaluate(command, "--help")
    assert status == 0
    assert "--env" in out
    assert "--set" in out


@pytest.mark.parametrize(
    ("options", "arguments", "particles"),
    [
        (TaskOptions, {}, 1000),
        (TaskOptions, {"preset": "utracking_hard"}, 5000),
        (TaskOptions, {"preset": "utracking_hard", "particles": 70}, 70),
        (ManyParticles, {}, 4000),
        (ManyParticles, {"preset": "masmitja2023"}, 4000),  # its 1000 are our default
        (ManyParticles, {"preset": "utracking_hard"}, 5000),
        (ManyParticles, {"preset": "utracking_hard", "particles": 70}, 70),
        (ManyParticles, {"particles": 1}, 1),
    ],
)
def test_particles_are_the_presets_own_unless_asked_for(options, arguments, particles):
    """Benchmarks and trade-offs take 4000 at least."""
    asked = options(env="RangeOnly-v0", **arguments)
    task = asked.build()
    assert task.scenario.belief.particles == particles
    assert asked.describe(task)["particles"] == particles


def test_messages_draws_error_against_loss_slots_and_number_of_messages(tmp_path):
    few = ("--losses", "0", "0.9", "--slots", "5", "60", "--episodes", "4", "--particles", "50", "--set", "episode_steps=30")
    done = run_eval("messages", "--vehicles", "2", *few, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["messages.json", "messages.md", "messages.png"]
    fleets = read_json(tmp_path / "out" / "messages.json")["fleets"]
    assert list(fleets) == ["none", "perfect", "loss 0", "loss 0.9", "slot 5 s", "slot 60 s"]
    sent = {name: figures["messages_per_hour"]["value"] for name, figures in fleets.items()}
    assert sent == {"none": 0, "perfect": 0, "loss 0": 360, "loss 0.9": 360, "slot 5 s": 720, "slot 60 s": 60}
    alone = run_eval("messages", "--vehicles", "1", *few, cwd=tmp_path)
    assert alone.returncode == 2 and "a vehicle alone has nobody to talk to, got --vehicles 1" in alone.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--record", "7"), "--record must be from 0 to the 6 episodes, got 7"),
        (("--record", "1", "--policies", "static_array"), "none of --policies steers one"),
        (("--record", "1", "--vehicles", "2"), "--record writes missions of one vehicle, got vehicles=2"),
    ],
)
def test_logs_that_cannot_be_written_are_refused_before_anything_runs(tmp_path, options, message):
    done = run_eval("benchmark", *SHORT, *options, "--out", "out", cwd=tmp_path)
    assert done.returncode == 2 and message in done.stderr


def test_recorded_episodes_are_logs_and_replaced_with_the_benchmark(tmp_path):
    for policies, folders in ((("circle:7", "pursuit"), {"circle-7-0", "pursuit-0"}), (("circle",), {"circle-0"})):
        done = run_eval("benchmark", *SHORT, "--policies", *policies, "--record", "1", "--out", "out", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert {path.name for path in (tmp_path / "out-logs").iterdir()} == folders
    (tmp_path / "out-logs" / "mine.txt").touch()
    done = run_eval("benchmark", *SHORT, "--policies", "circle", "--record", "1", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2 and "holds something else than logs" in done.stderr
