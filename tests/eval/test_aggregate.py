"""One figure over tasks: the geometric mean of what benchmarks found, and what cannot be taken together."""

import json

import pytest


@pytest.fixture
def benchmark(tmp_path):
    def write(name, value, env=None, **changes):
        folder = tmp_path / name
        folder.mkdir()
        ratio = {"value": value, "low": value / 1.1, "high": value * 1.1, "freedom": None} | changes
        policies = {"circle": {}, "learned": {}}
        document = {"env": env or f"TagTrack/{name}-v0", "policies": policies, "ratios": {"circle/learned": ratio}}
        (folder / "benchmark.json").write_text(json.dumps(document))
        return folder

    return write


def test_the_geometric_mean_over_tasks_is_printed_with_its_interval(evaluate, benchmark):
    status, out, _ = evaluate("aggregate", benchmark("A", 1.0), benchmark("B", 1.21))
    assert status == 0
    assert "1.10" in out and "[1.03," in out and "1.18]" in out  # 1.1 * exp(-+ln(1.1) / sqrt(2))


@pytest.mark.parametrize(
    ("second", "policy", "complaint"),
    [
        ({"env": "TagTrack/A-v0"}, "learned", "TagTrack/A-v0 is the task of two folders"),
        ({"low": None, "high": None}, "learned", "has no interval: too few episodes"),
        ({}, "other", "no policy 'other' beside circle in"),
    ],
)
def test_what_cannot_be_taken_together_is_named(evaluate, benchmark, second, policy, complaint):
    folders = benchmark("A", 1.0), benchmark("B", 1.2, **second)
    status, _, error = evaluate("aggregate", *folders, "--policy", policy)
    assert status == 2 and complaint in error and error.count("\n") == 1


def test_a_folder_without_a_benchmark_is_named(evaluate, tmp_path):
    assert "no benchmark in" in evaluate("aggregate", tmp_path)[2]
    (tmp_path / "benchmark.json").write_text("{}")
    assert "is not what `eval benchmark` writes" in evaluate("aggregate", tmp_path)[2]


def edited(folder, changes):
    path = folder / "benchmark.json"
    document = json.loads(path.read_text())
    document["ratios"]["circle/learned"] |= changes
    path.write_text(json.dumps(document))
    return folder


@pytest.mark.parametrize(
    "changes", [{"value": "a"}, {"low": 0}, {"value": 10**401}, {"freedom": []}, {"low": None}, {"low": 2.0}, {"high": True}]
)
def test_a_ratio_that_was_edited_is_named(evaluate, benchmark, changes):
    status, _, error = evaluate("aggregate", edited(benchmark("A", 1.0), changes))
    assert status == 2 and "the ratio circle/learned is {" in error and error.count("\n") == 1


@pytest.mark.parametrize("field", ["env", "policies", "ratios"])
@pytest.mark.parametrize("value", [True, None, [], 5, ""])
def test_a_benchmark_that_was_edited_is_named(evaluate, benchmark, field, value):
    path = benchmark("A", 1.0) / "benchmark.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: value}))
    status, _, error = evaluate("aggregate", path.parent)
    assert status == 2 and f"({field} is " in error and error.count("\n") == 1
