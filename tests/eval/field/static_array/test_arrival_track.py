"""YAPS: its density against dense linear algebra and closed forms, its scales and tracks on simulated and on real pings."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import numpy as np
import pytest

from tagtrack.eval.field.static_array.arrival_model import ArrivalModel, Scales, invert_blocks, lay_out
from tagtrack.eval.field.static_array.arrival_track import regular_interval, track_arrivals, yaps
from tagtrack.eval.field.static_array.model import ArraySetting, Floats, Pings
from tagtrack.eval.field.static_array.registry import locate

SQUARE = np.array([[0.0, 0.0], [200.0, 0.0], [200.0, 200.0], [0.0, 200.0]])
SOUND = 1500.0


def hear(position: Floats, sent: Floats, sigma: float, seed: int = 0, start: float = 1.56e9) -> Pings:
    flight = np.linalg.norm(position[:, None] - SQUARE, axis=-1) / SOUND
    arrival = start + sent[:, None] + flight + sigma * np.random.default_rng(seed).standard_normal(flight.shape)
    return Pings(time=arrival.min(axis=1), arrival=arrival)


def walk(count: int, interval: float, diffusivity: float, seed: int) -> Floats:
    steps = np.sqrt(2 * diffusivity * interval) * np.random.default_rng(seed).standard_normal((count, 2))
    return np.array([100.0, 100.0]) + np.cumsum(steps, axis=0)


def dense(band: Floats) -> Floats:
    lower = sum(np.diag(row[: band.shape[1] - below], -below) for below, row in enumerate(band))
    return np.asarray(lower + np.tril(lower, -1).T)


def model_of(interval: float | None, *, robust: bool) -> tuple[ArrivalModel, Floats]:
    sent = 60.0 * np.array([0, 1, 2, 4, 5, 6])  # the fourth is missed
    pings = hear(walk(6, 60, 0.01, seed=1), sent, 1e-3)
    pings.arrival[1, :3] = np.nan
    model = ArrivalModel(lay_out(pings, interval), SQUARE, SOUND, robust=robust)
    return model, model.start(100 + 5 * np.random.default_rng(2).standard_normal((len(model.rows.time), 2)))


@pytest.mark.parametrize("interval", [60.0, None])
@pytest.mark.parametrize("robust", [True, False])
def test_gradient_is_the_slope_of_the_cost(interval: float | None, robust: bool) -> None:
    model, state = model_of(interval, robust=robust)
    scales = Scales(diffusivity=0.02, sigma=2e-3, interval_sigma=1e-3)
    gradient, _ = model.curvature(state, scales)
    for index in range(state.size):
        step = np.zeros(state.size)
        step[index] = 1e-4
        step = step.reshape(state.shape)
        slope = (model.cost(state + step, scales) - model.cost(state - step, scales)) / 2e-4
        np.testing.assert_allclose(gradient[index], slope, rtol=1e-4, atol=1e-4)


def test_curvature_is_that_of_the_cost_where_errors_are_normal_and_residuals_none() -> None:
    # There Gauss and Newton leave nothing out: second differences of the cost are an independent answer.
    pings = hear(walk(5, 60, 0.01, seed=1), 60.0 * np.arange(5), 0.0, start=0.0)
    model = ArrivalModel(lay_out(pings, 60.0), SQUARE, SOUND, robust=False)
    state = model.start(walk(5, 60, 0.01, seed=1))
    scales = Scales(diffusivity=0.02, sigma=2e-3, interval_sigma=1e-3)
    _, band = model.curvature(state, scales)
    size, step = state.size, 1e-2
    unit = step * np.eye(size).reshape(size, *state.shape)
    gradients = np.array([model.curvature(state + u, scales)[0] - model.curvature(state - u, scales)[0] for u in unit])
    np.testing.assert_allclose(dense(band), gradients / (2 * step), rtol=1e-4, atol=2e-4 * band.max())


def test_cost_is_the_log_density_written_out() -> None:
    model, state = model_of(60.0, robust=False)
    scales = Scales(diffusivity=0.02, sigma=2e-3, interval_sigma=1e-3)
    position, sent = state[:, :2], model.rows.time + state[:, 2] / SOUND

    def normal(value: Floats, sigma: float | Floats) -> float:
        return float(np.sum(-0.5 * (value / sigma) ** 2 - np.log(np.sqrt(2 * np.pi) * sigma)))

    residual = model.rows.arrival - sent[:, None] - np.linalg.norm(position[:, None] - SQUARE, axis=-1) / SOUND
    log_density = normal(residual[np.isfinite(residual)], scales.sigma)
    log_density += normal(np.diff(position, axis=0), np.sqrt(2 * scales.diffusivity * np.diff(model.rows.time))[:, None])
    log_density += normal(np.diff(sent, 2), scales.interval_sigma)
    np.testing.assert_allclose(model.cost(state, scales), -log_density, rtol=1e-6)  # but for the diffuse prior


def test_blocks_of_the_inverse_agree_with_the_dense_inverse() -> None:
    model, state = model_of(60.0, robust=True)
    scales = Scales(diffusivity=0.02, sigma=2e-3, interval_sigma=1e-3)
    _, _, factor = model.minimize(state, scales)
    lower = np.tril(dense(factor))
    inverse = np.linalg.inv(lower @ lower.T)
    blocks = [inverse[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] for row in range(len(state))]
    np.testing.assert_allclose(invert_blocks(factor, 3), blocks, rtol=1e-6, atol=1e-9)


def test_missed_pings_of_a_regular_tag_get_rows_and_random_ones_none() -> None:
    time = 60.0 * np.array([0, 1, 5, 6, 1000, 1001])
    pings = Pings(time=time, arrival=np.repeat(time[:, None], 4, axis=1))
    rows = lay_out(pings, 60.2)
    np.testing.assert_array_equal(rows.heard_row, [0, 1, 5, 6, 7, 8])  # a gap past 200 intervals is not counted out
    np.testing.assert_array_equal(np.flatnonzero(rows.chained), [2, 3, 4, 5, 6])  # 7 and 8: no two alike intervals before
    assert len(lay_out(pings, None).time) == 6


def test_interval_of_a_regular_tag_is_found_through_missed_pings_and_none_for_a_random_tag() -> None:
    rng = np.random.default_rng(0)
    heard = np.flatnonzero(rng.random(200) < 0.6)
    assert regular_interval(1.5e9 + 42.5 * heard + 0.05 * rng.standard_normal(heard.size)) == pytest.approx(42.5, abs=0.02)
    assert regular_interval(np.cumsum(rng.uniform(60, 90, 200))) is None
    assert regular_interval(np.arange(4.0)) is None  # too few to tell


def test_scales_are_recovered_from_simulated_pings() -> None:
    truth = Scales(diffusivity=0.05, sigma=1e-3, interval_sigma=2e-3)
    rng = np.random.default_rng(5)
    sent = np.cumsum(60 + np.cumsum(truth.interval_sigma * rng.standard_normal(300)))
    pings = hear(walk(300, 60, truth.diffusivity, seed=6), sent, truth.sigma)
    found = track_arrivals(pings, SQUARE, ArraySetting(sigma=5e-3), interval=60.0, robust=False).scales
    # Of 300 intervals, 600 steps and some 300 left-over arrivals: relative deviations of 6, 6 and 4 %; three of each.
    assert found.interval_sigma == pytest.approx(truth.interval_sigma, rel=0.2)
    assert found.diffusivity == pytest.approx(truth.diffusivity, rel=0.2)
    assert found.sigma == pytest.approx(truth.sigma, rel=0.12)


@pytest.mark.parametrize("interval", [60.0, None])
def test_errors_are_as_large_as_the_covariance_says(interval: float | None) -> None:
    track = walk(200, 60, 0.05, seed=7)
    gaps = np.full(200, 60.0) if interval else np.random.default_rng(8).uniform(60, 90, 200)
    sent = np.cumsum(gaps)
    pings = hear(track, sent, 1e-3, seed=9)
    found = track_arrivals(pings, SQUARE, ArraySetting(), interval=interval)
    offset = found.positions.position - track
    distance = np.einsum("ka,kab,kb->k", offset, np.linalg.inv(found.positions.covariance), offset)
    assert distance.mean() == pytest.approx(2.0, abs=0.5)  # chi square of 2, 200 times, neighbours a little dependent: 0.14-0.2
    late = found.transmission - 1.56e9 - sent
    assert np.abs(late / found.transmission_sigma).max() < 4.0


def test_a_regular_tag_is_located_far_better_outside_the_array() -> None:
    # With the transmission times known from its neighbours a ping measures ranges and no longer differences of them.
    track = np.array([220.0, 0.0]) + walk(40, 60, 0.5, seed=3)
    regular, random = 60.0 * np.arange(40), np.cumsum(np.random.default_rng(4).uniform(60, 90, 40))
    error = [
        np.sqrt(np.mean((yaps(hear(track, sent, 1e-3), SQUARE, ArraySetting()).position - track) ** 2))
        for sent in (regular, random)
    ]
    assert error[0] < 0.6 * error[1]


def test_outliers_leave_a_robust_track_alone() -> None:
    track = walk(80, 60, 0.05, seed=1)
    pings = hear(track, np.cumsum(np.random.default_rng(2).uniform(60, 90, 80)), 1e-3)
    clean = yaps(pings, SQUARE, ArraySetting()).position
    outlier = np.random.default_rng(3).random(pings.arrival.shape) < 0.05
    arrival = pings.arrival + np.where(outlier, 0.2, 0.0)
    spoilt = Pings(time=arrival.min(axis=1), arrival=arrival)
    robust = track_arrivals(spoilt, SQUARE, ArraySetting(), interval=None).positions.position
    normal = track_arrivals(spoilt, SQUARE, ArraySetting(), interval=None, robust=False).positions.position
    error = [float(np.sqrt(np.mean((position - track) ** 2))) for position in (clean, robust, normal)]
    assert error[1] < 1.5 * error[0] < 5 * error[0] < error[2]  # a fifth of the pings lost one arrival of four


def test_missed_pings_and_single_receivers_keep_the_track() -> None:
    track = walk(120, 60, 0.02, seed=11)
    pings = hear(track, 60.0 * np.arange(120), 1e-3)
    rng = np.random.default_rng(12)
    arrival = np.where(rng.random(pings.arrival.shape) < 0.5, pings.arrival, np.nan)
    heard = np.isfinite(arrival).any(axis=1)
    some = Pings(time=np.nanmin(arrival[heard], axis=1), arrival=arrival[heard])
    found = track_arrivals(some, SQUARE, ArraySetting(), interval=regular_interval(some.time))
    assert found.missed == np.ptp(np.flatnonzero(heard)) + 1 - heard.sum() > 0
    offset = found.positions.position - track[heard]
    assert np.isfinite(offset).all()
    assert np.sqrt(np.mean(np.sum(offset**2, axis=1))) < 2.0  # steps of 1.5 m an axis, every second arrival of 1.5 m


def test_nothing_located_gives_no_track() -> None:
    arrival = np.full((4, 4), np.nan)
    arrival[:, 0] = [0.0, 60, 120, 180]
    found = yaps(Pings(time=arrival[:, 0], arrival=arrival), SQUARE, ArraySetting())
    assert found.position.shape == (4, 2) and np.isnan(found.position).all() and np.isnan(found.covariance).all()


def test_bad_input_is_refused() -> None:
    pings = hear(np.array([[50.0, 50.0]]), np.zeros(1), 1e-3)
    with pytest.raises(ValueError, match="interval must be positive, got -3.0 s"):
        track_arrivals(pings, SQUARE, ArraySetting(), interval=-3.0)
    with pytest.raises(ValueError, match="one column for each receiver"):
        yaps(pings, SQUARE[:3], ArraySetting())
    with pytest.raises(ValueError, match="yaps takes arrival times"):
        yaps(pings, SQUARE, ArraySetting(), information=np.eye(4)[None])


def test_canister_of_the_lobsters_is_found_where_it_lies(tagtrack_data: Path) -> None:
    """RESNEP, Table 1: clocks corrected by the authors, times rounded to 10 ms, intervals random; one day of tag C."""
    places, pings = read_canister(tagtrack_data / "resnep", day=1560124800.0)  # 2019-06-10
    assert regular_interval(pings.time) is None
    found = track_arrivals(pings, places, ArraySetting(sigma=3e-3), interval=None)
    error = np.linalg.norm(found.positions.position - np.array([544092.14, 4651434.09]), axis=1)
    assert np.isfinite(error).all() and np.median(error) < 2.2  # one ping of three or four such arrivals: 7 m, and 45 % have two
    assert 1.5e-3 < found.scales.sigma < 5e-3  # rounding alone gives 2.9 ms
    assert np.sqrt(2 * found.scales.diffusivity * 90) < 1.5  # [m], a step of what lies still while its clocks wander by 2 ms


def read_canister(folder: Path, day: float) -> tuple[Floats, Pings]:
    """Receivers at the places of Table 1, and the pings of one day that two or more of them heard."""
    with open(folder / "stations.csv", newline="", encoding="utf-8") as file:
        stations = [row for row in csv.DictReader(file) if row["receiver"]]
    with gzip.open(folder / "sync_detections.csv.gz", "rt", encoding="utf-8") as file:
        heard = [(float(row["t_unix_s"]), row["receiver"]) for row in csv.DictReader(file) if row["tag"] == "A69-1602-65266"]
    time = np.array([when for when, _ in heard])
    chosen = (time > day) & (time < day + 86400)
    names = [row["receiver"] for row in stations]
    receiver = np.array([names.index(name) for _, name in heard])
    time, receiver = time[chosen], receiver[chosen]
    order = np.argsort(time)
    time, receiver = time[order], receiver[order]
    ping = np.cumsum(np.diff(time, prepend=time[0]) > 1.0)
    arrival = np.full((ping[-1] + 1, len(names)), np.nan)
    arrival[ping, receiver] = time
    arrival = arrival[np.isfinite(arrival).sum(axis=1) >= 2]
    places = np.array([[float(row["table1_position1_x"]), float(row["table1_position1_y"])] for row in stations])
    return places, Pings(time=np.nanmin(arrival, axis=1), arrival=arrival)


def test_few_pings_are_no_worse_than_each_by_itself():
    """Five pings of which some reach three receivers: a start in the wrong place once dragged the whole track along."""
    receivers = np.array([[0.0, 0.0], [400.0, 0.0], [400.0, 400.0], [0.0, 400.0], [200.0, 200.0]])
    setting = ArraySetting(sound_speed=SOUND, sigma=3e-4)
    errors: dict[str, list[float]] = {"yaps": [], "wls_ml": []}
    for seed in range(30):
        rng = np.random.default_rng(seed)
        track = rng.uniform(50, 350, 2) + np.cumsum(rng.normal(0, 8, (5, 2)), axis=0)
        sent = 1.6e9 + np.cumsum(rng.uniform(20, 40, 5))
        arrival = sent[:, None] + np.linalg.norm(track[:, None] - receivers, axis=2) / SOUND + rng.normal(0, 3e-4, (5, 5))
        arrival[rng.random(arrival.shape) < 0.3] = np.nan
        heard = np.isfinite(arrival).sum(axis=1) >= 3
        pings = Pings(time=np.nanmin(arrival[heard], axis=1), arrival=arrival[heard])
        for method, errors_of in errors.items():
            found = locate(method, pings, receivers, setting).position
            errors_of += np.linalg.norm(found - track[heard], axis=1).tolist()
    assert np.nanmax(errors["yaps"]) < 20.0 < np.nanmax(errors["wls_ml"])  # the mirror images are some 100 m away
    assert np.nanmedian(errors["yaps"]) < 1.0
