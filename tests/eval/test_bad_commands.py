"""Bad input: one line that names the value and the way out, exit status 2, and nothing written."""

import errno
import resource
from pathlib import Path

import pytest

from tagtrack.eval import benchmark_run as benchmark
from tagtrack.eval import rollout
from tests.eval.conftest import SHORT

BASELINES = "three_step, pursuit, circle, assignment, uncertain, information, stationary, random, oracle_circle, rollout"


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))  # no parts that another test left


@pytest.fixture
def refused(evaluate, tmp_path, monkeypatch):
    """Assert that a command line is refused, before any step, with one line; returns the line."""

    def refuse(*arguments):
        before = sorted(tmp_path.rglob("*"))
        monkeypatch.setattr(rollout, "roll_out", lambda *_, **__: pytest.fail("it ran"))
        status, out, err = evaluate(*arguments)
        assert (status, out) == (2, "")
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert sorted(tmp_path.rglob("*")) == before
        return err

    return refuse


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--env", "Pond-v0"), "unknown environment 'Pond-v0'; known: TagTrack/LeopardShark-v0,"),
        (("--env", "RangeOnly"), "did you mean TagTrack/RangeOnly-v0 or TagTrack/RangeOnlyGlider-v0? known: TagTrack/Leopard"),
        (("--policies",), "--policies names nothing; give it a value or leave it out"),
        (("--metrics", "--episodes", "4"), "--metrics names nothing"),
        (("--policies", "zigzag"), f"unknown policy 'zigzag': there is no such folder, and the baselines are {BASELINES}"),
        (("--policies", "circle", "circle"), "two policies go by the name 'circle'"),
        (("--policies", "pursuit", "circle:far"), "radius must be a number, got 'far'"),
        (("--policies", "circle:nan"), "radius must be finite, got nan"),
        (("--policies", "circle:size=3"), "circle has no parameter 'size'; it has radius"),
        (("--particles", "0"), "particles must be a whole number of at least 1, got 0"),
        (("--episodes", "0"), "--episodes must be at least 1, got 0"),
        (("--from-step", "40"), "from_step must be from 0 to 39, got 40"),
        (("--policies", "mine="), "the group 'mine=' has no run; name its folders: mine=runs/seed0,runs/seed1"),
        (("--metrics", "math:nothing"), "'math:nothing': math has no 'nothing'"),
        (("--threads", "0"), "--threads must be at least 1, got 0"),
        (("--seed", "-1"), "--seed must be from 0 to 2147483647, got -1"),
        (("--set", "tag.period=-2"), "period must be positive, got -2.0"),
        (("--set", "tag.period=nan"), "tag.period must be a number, got 'nan'"),
        (("--set", "water.mud=1"), "unknown parameter 'water.mud'; did you mean water.reach? known: water.reach, water.edge"),
        (("--set", "wter.reach=1"), "unknown parameter 'wter.reach'; did you mean water.reach? known: water.reach,"),
        (("--set", "mud=1"), "unknown parameter 'mud'; known: time_step,"),
        (("--set", "water"), "NAME=VALUE"),
        (("--set", "tag.period=2", "--set", "tag.period=4"), "tag.period is set twice, to 2 and to 4; drop one"),
        (("--set", "belief.particles=5"), "--particles"),
        (("--vehicles", "0"), "vehicles must be a whole number from 1 to 20, got 0"),
        (("--tags", "21"), "tags must be a whole number from 1 to 20, got 21"),
        (("--modem", "radio"), "modem must be one of perfect, none, instant, tdma, or MODULE:CLASS of your own, got 'radio'"),
        (("--vehicles", "2", "--policies", "static_array"), "static_array stands for one vehicle and one tag, got vehicles=2"),
        (("--tags", "2", "--policies", "uncertain:per_metre=-1"), "Uncertain.per_metre must be at least 0, got -1.0"),
        (("--tracks", "none.csv"), "no track file none.csv"),
        (("--time-scale", "0.5"), "add tracks=FILE"),
        (("--motion", "swift"), "boat, acceleration, legs, or MODULE:CLASS of your own, got 'swift'"),
        (("--motion", "levy", "--set", "fish=boat"), "the motion of the fish is set twice, to levy and to boat; drop one"),
        (("--motion", "levy", "--tracks", "a.csv"), "either the tracks of a.csv or by a motion (fish=levy); drop one"),
        (("--policies", "static_array:far"), "baseline must be a number of metres, got 'far'"),
    ],
)
def test_benchmark_names_the_value_and_the_way_out(refused, arguments, complaint):
    assert complaint in refused("benchmark", *SHORT, *arguments)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("tune", *SHORT, "--policy", "zigzag"), f"unknown baseline 'zigzag'; known: {BASELINES}"),
        (("tune", *SHORT, "--policy", "stationary"), "stationary has no number to tune"),
        (("tune", *SHORT, "--policy", "random"), "no usual range for seed of random; give --values"),
        (("tune", *SHORT, "--values", "10", "-10"), "radius must be positive, got -10"),
        (("tune", *SHORT, "--out", "missing/tune.json"), "make the folder"),
        (("tune", *SHORT, "--values"), "--values names nothing"),
        (("tradeoff", *SHORT, "--env", "LeopardShark-v0"), "has no perimeter to keep"),
        (("tradeoff", *SHORT, "--heuristics", "random"), "random has neither a perimeter nor a radius"),
        (("tradeoff", *SHORT, "--heuristics"), "name at least one policy"),
        (("tradeoff", *SHORT, "--runs", "missing"), "unknown policy 'missing'"),
        (("tradeoff", *SHORT, "--runs", "static_array"), "static_array has no vehicle that could keep away"),
        (("consistency", *SHORT, "--policy", "zigzag"), "unknown policy 'zigzag'"),
        (("consistency", *SHORT, "--policy", "static_array"), "static_array steers no vehicle"),
        (("speed", "--num-worlds", "0"), "--num-worlds must be whole numbers of at least 1"),
        (("speed", "--threads", "-1"), "--threads must be whole numbers of at least 1"),
        (("speed", "--rounds", "0"), "--rounds must be at least 1"),
        (("speed", "--json", "missing/speed.json"), "make the folder"),
    ],
)
def test_other_commands_do_so_too(refused, arguments, complaint):
    assert complaint in refused(*arguments)


def test_run_folder_without_policy(refused, tmp_path):
    (tmp_path / "run").mkdir()
    assert "run holds no policy (policy.json is missing)" in refused("benchmark", *SHORT, "--policies", "run")


def test_policy_for_another_observation_layout(refused, tmp_path, save_run):
    save_run(tmp_path / "run", features=("distance", "depth"))
    assert "'depth'" in refused("benchmark", *SHORT, "--policies", "pursuit", "run")


def test_policy_for_other_actions(refused, tmp_path, save_run):
    save_run(tmp_path / "run", speed_control=True)
    assert "action 2 is 'speed'" in refused("benchmark", *SHORT, "--policies", "run")


def test_truncated_and_tampered_policy_files(refused, tmp_path, save_run):
    weights = save_run(tmp_path / "run") / "policy.safetensors"
    whole = weights.read_bytes()
    weights.write_bytes(whole[:-10])
    assert "policy.safetensors" in refused("benchmark", *SHORT, "--policies", "run")
    weights.write_bytes(whole[:-4] + bytes(4))
    assert "policy.safetensors" in refused("benchmark", *SHORT, "--policies", "run")


@pytest.mark.parametrize("rows", ["0,0,0\n1000,1,1\n", "0,0,0\n1,nan,1\n2,3,4\n", "0,0,0\n2,1,1\n1,2,2\n", ""])
def test_track_file_with_gaps_nan_or_unsorted_times(refused, tmp_path, rows):
    (tmp_path / "track.csv").write_text("t_unix_s,x,y\n" + rows)
    assert "track.csv" in refused("benchmark", *SHORT, "--tracks", "track.csv")


def test_output_folder_that_is_no_benchmark(refused, tmp_path):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis/chapter.tex").write_text("all of it")
    assert "--out thesis holds chapter.tex" in refused("benchmark", *SHORT, "--out", "thesis")
    assert "--out thesis/chapter.tex is a file" in refused("benchmark", *SHORT, "--out", "thesis/chapter.tex")
    assert "cannot be written" in refused("benchmark", *SHORT, "--out", "thesis/chapter.tex/more")


@pytest.mark.parametrize("existing", [False, True])
def test_full_disk_leaves_no_file_and_no_folder(evaluate, tmp_path, monkeypatch, existing):
    out = tmp_path / "out"
    if existing:
        assert evaluate("benchmark", *SHORT, "--policies", "pursuit", "--out", out)[0] == 0
    before = {path: path.read_bytes() for path in out.glob("*")}

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(benchmark, "draw_tracks", full)
    status, _, err = evaluate("benchmark", *SHORT, "--policies", "circle", "--out", out)
    assert status == 2
    assert err == "error: [Errno 28] No space left on device\n"
    assert {path: path.read_bytes() for path in out.glob("*")} == before
    assert out.exists() == existing


def test_a_disk_that_fills_up_in_the_middle_of_a_file(evaluate, tmp_path, monkeypatch):
    """A limit on file sizes stands for the full disk: the JSON fits in, the first picture does not."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill_up():  # called between the roll-outs, which may write their compiled code, and the first file
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
        return {}

    monkeypatch.setattr(benchmark, "collect_versions", fill_up)
    try:
        status, out, err = evaluate("benchmark", *SHORT, "--policies", "pursuit", "--out", "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (status, err) == (2, "error: [Errno 27] File too large\n")
    assert "pursuit" in out  # the table is not lost
    assert not list(tmp_path.iterdir())


def test_interrupt_ends_with_a_line_and_nothing_written(evaluate, tmp_path, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(rollout, "roll_out", interrupt)
    status, out, err = evaluate("benchmark", *SHORT, "--out", "out")
    assert (status, out) == (130, "")
    assert err == "\nstopped; nothing was written\n"
    assert not list(tmp_path.iterdir())


def test_a_mistake_in_the_grammar_shows_no_traceback(evaluate):
    for arguments in (("zigzag",), ("benchmark", "--episodes", "many"), ("benchmark", "--speed", "3")):
        status, _, err = evaluate(*arguments)
        assert status == 2
        assert "Traceback" not in err


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no folder here that refuses root as well")
@pytest.mark.parametrize("command", [("benchmark", *SHORT), ("suite", "--quick"), ("tune", *SHORT), ("headroom", *SHORT)])
def test_a_place_that_cannot_be_written_is_found_out_first(refused, command):
    assert "cannot be written (/proc: " in refused(*command, "--out", "/proc/mine")
