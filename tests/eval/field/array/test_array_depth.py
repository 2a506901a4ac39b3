"""Tags at depth: `array locate` and `array tracks` with a depth that is given, read by a sensor, or estimated."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagtrack.eval.cli import main
from tagtrack.eval.field import Detections, Locating, locate_tags
from tagtrack.eval.field.array.depth import TagHeight
from tagtrack.eval.field.static_array.registry import METHODS

PLACES = {"A": (0, 0, -5), "B": (200, 0, -30), "C": (200, 200, -8), "D": (0, 200, -35), "E": (100, 90, -20), "F": (30, 120, -2)}
COUNT = 120
Run = Callable[..., str]


def hear(sigma: float = 2e-4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (K,), places (K, 3) and arrivals (K, 6) of a fish that dives between 7 and 23 m."""
    time = 1.6e9 + 60.0 * np.arange(COUNT)
    fish = np.stack([100 + 60 * np.cos(time / 3000), 100 + 60 * np.sin(time / 3000), -15 - 8 * np.sin(time / 1000)], axis=1)
    distance = np.linalg.norm(fish[:, None] - np.array(list(PLACES.values()), float), axis=2)
    return time, fish, time[:, None] + distance / 1500.0 + sigma * np.random.default_rng(0).normal(size=distance.shape)


@pytest.fixture
def array(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command on the dive in the folder; gives what it printed."""
    time, fish, arrival = hear()
    rows = "".join(f"{arrival[k, r]:.6f},{name},fish\n" for k in range(COUNT) for r, name in enumerate(PLACES))
    (tmp_path / "detections.csv").write_text("t_unix_s,receiver,tag\n" + rows)
    places = "".join(f"{name},{x},{y},{-z}\n" for name, (x, y, z) in PLACES.items())
    (tmp_path / "receivers.csv").write_text("receiver,x,y,Depth (m)\n" + places)
    (tmp_path / "flat.csv").write_text("receiver,x,y,z\n" + "".join(f"{n},{x},{y},-12\n" for n, (x, y, _) in PLACES.items()))
    depths = "".join(f"fish,{time[k]:.1f},{-fish[k, 2]:.2f}\n" for k in range(0, 100, 2))
    (tmp_path / "depths.csv").write_text("tag,t_unix_s,depth\n" + depths)

    def run(command: str, *more: str, receivers: str = "receivers.csv") -> str:
        given = ["--detections", str(tmp_path / "detections.csv"), "--receivers", str(tmp_path / receivers)]
        main(["array", command, *given, "--out", str(tmp_path / "out"), *more])
        return "".join(capsys.readouterr())

    return run


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """x, y, z (K, 3) less those of the fish, and their covariance (K, 3, 3)."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    value = {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name not in ("tag", "misfit")
             and all(row[name] for row in rows)}  # fmt: skip
    time, fish, _ = hear()
    truth = np.stack([np.interp(value["t_unix_s"], time, axis) for axis in fish.T], axis=1)
    covariance = np.empty((len(rows), 3, 3))
    for a, first in enumerate("xyz"):
        covariance[:, a, a] = value[f"sd_{first}"] ** 2
        for b, second in enumerate("xyz"[:a]):
            covariance[:, a, b] = covariance[:, b, a] = value[f"cov_{second}{first}"]
    return np.stack([value[name] for name in "xyz"], axis=1) - truth, covariance


@pytest.mark.parametrize("method", ["wls_ml", "map", "yaps"])
def test_a_free_depth_is_found_and_its_covariance_holds(array: Run, tmp_path: Path, method: str) -> None:
    printed = array("locate", "--depth", "free", "--method", method, "--acceleration", "0.01")
    miss, covariance = read(tmp_path / "out" / "positions.csv")
    assert len(miss) == COUNT, printed
    assert np.median(np.abs(miss[:, 2])) < 1.0 and np.median(np.hypot(*miss[:, :2].T)) < 0.6
    squared = np.einsum("ki,kij,kj->k", miss, np.linalg.inv(covariance), miss)
    assert 0.5 < squared.mean() / 3 < 1.6


def test_positions_at_the_depth_that_a_sensor_read_are_nearer_than_in_the_plane(array: Run, tmp_path: Path) -> None:
    printed = array("locate", "--depth", str(tmp_path / "depths.csv"))
    miss, covariance = read(tmp_path / "out" / "positions.csv")
    assert "12 pings of fish are left out: no depth was read within ten minutes" in printed  # the last 21 have no reading
    assert len(miss) == COUNT - 12
    squared = np.einsum("ki,kij,kj->k", miss[:, :2], np.linalg.inv(covariance[:, :2, :2]), miss[:, :2])
    assert 0.5 < squared[:100].mean() / 2 < 1.5 and not covariance[:, 2].any()
    assert np.abs(miss[:98, 2]).max() < 0.1


def test_one_depth_given_for_all_tags_is_that_of_the_positions(array: Run, tmp_path: Path) -> None:
    array("locate", "--depth", "15")
    with (tmp_path / "out" / "positions.csv").open() as file:
        assert {row["z"] for row in csv.DictReader(file)} == {"-15.000"}


def test_tracks_follow_a_dive(array: Run, tmp_path: Path) -> None:
    array("tracks", "--depth", "free", "--interval", "120")
    miss, covariance = read(tmp_path / "out" / "tracks.csv")
    assert len(miss) > 50 and np.abs(miss[:, 2]).mean() < 0.8 and np.hypot(*miss[:, :2].T).mean() < 0.4
    assert (covariance[:, 2, 2] > 0).all()


def test_tracks_at_a_given_depth_tell_it(array: Run, tmp_path: Path) -> None:
    array("tracks", "--depth", str(tmp_path / "depths.csv"), "--interval", "120")
    miss, _ = read(tmp_path / "out" / "tracks.csv")
    assert len(miss) > 45 and np.abs(miss[:45, 2]).max() < 0.2


@pytest.mark.parametrize(
    ("receivers", "depth", "said"),
    [
        ("flat.csv", "free", "all 6 receivers stand at one depth (12 m)"),
        ("receivers.csv", "deep", "deep"),
        ("none.csv", "free", "take receivers with a column z or depth"),
        ("gap.csv", "10", "add that of A"),
        ("receivers.csv", "other.csv", "no depth of tag 'fish'; there are shark"),
    ],
)
def test_what_does_not_tell_a_depth_is_an_error_of_one_line(
    array: Run, tmp_path: Path, receivers: str, depth: str, said: str
) -> None:
    (tmp_path / "none.csv").write_text("receiver,x,y\n" + "".join(f"{n},{x},{y}\n" for n, (x, y, _) in PLACES.items()))
    (tmp_path / "gap.csv").write_text((tmp_path / "receivers.csv").read_text().replace("A,0,0,5", "A,0,0,NA"))
    (tmp_path / "other.csv").write_text("tag,depth\nshark,4\n")
    given = str(tmp_path / depth) if depth.endswith(".csv") else depth
    printed = array("locate", "--depth", given, receivers=receivers)
    assert said in printed and printed.count("\n") == 1


def test_a_column_of_depths_changes_nothing_where_depth_is_not_asked_for(array: Run, tmp_path: Path) -> None:
    array("locate")
    with_depths = (tmp_path / "out" / "positions.csv").read_text()
    array("locate", receivers="flat.csv")
    assert (tmp_path / "out" / "positions.csv").read_text() == with_depths and ",z," not in with_depths


def detections(arrival: np.ndarray) -> Detections:
    """Every receiver heard every ping; the pings are farther apart than the array is wide."""
    order = np.argsort(arrival, axis=1)
    return Detections(
        time=np.take_along_axis(arrival, order, axis=1).ravel(),
        receiver=order.astype(np.int32).ravel(),
        tag=np.zeros(arrival.size, np.int32),
        receivers=tuple(PLACES),
        tags=("fish",),
    )


@pytest.mark.parametrize("method", METHODS)
def test_every_estimator_takes_slant_ranges_at_a_height_that_is_known(method: str) -> None:
    """A fish at 23 m right below a receiver at 2 m: in the plane its ranges would be metres off."""
    time, _, _ = hear()
    fish = np.column_stack([np.linspace(20, 60, COUNT), np.full(COUNT, 120.0), np.full(COUNT, -23.0)])
    distance = np.linalg.norm(fish[:, None] - np.array(list(PLACES.values()), float), axis=2)
    noise = 2e-4 * np.random.default_rng(0).normal(size=distance.shape)
    heard = detections(time[:, None] + distance / 1500.0 + noise)
    height = TagHeight(of={"fish": (time, fish[:, 2])})
    [found] = locate_tags(heard, PLACES, Locating(method=method, height=height, acceleration=3e-3))
    miss = found.positions.position - fish[:, :2]
    squared = np.einsum("ki,kij,kj->k", miss, np.linalg.inv(found.positions.covariance), miss)
    assert np.median(np.hypot(*miss.T)) < 0.5 and 0.4 < squared.mean() / 2 < 1.6


def test_the_function_takes_places_in_space_and_a_height() -> None:
    _, fish, arrival = hear(sigma=1e-6)
    heard = detections(arrival[:5])
    [free] = locate_tags(heard, PLACES)
    assert np.abs(free.positions.position - fish[:5]).max() < 0.05
    [known] = locate_tags(heard, PLACES, Locating(height=float(fish[0, 2])))
    assert np.abs(known.positions.position[0] - fish[0, :2]).max() < 0.01 and known.height is not None
    assert known.height[0] == fish[0, 2]
