"""Clocks of simulated arrays whose drift is known come out within the noise, whatever way the offsets are told."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from tagtrack.eval.field.static_array.clock_coarse import coarse_clocks
from tagtrack.eval.field.static_array.clock_model import ClockModel, correct
from tagtrack.eval.field.static_array.clocks import Synchronization, SyncSetting, SyncTag, synchronize
from tagtrack.eval.field.static_array.detections import Detections
from tagtrack.eval.field.static_array.model import Floats

DAY = 86400.0
START = 1.56e9
PLACES = np.array([[0.0, 0.0], [240.0, 0.0], [0.0, 210.0], [260.0, 230.0]])
NAMES = tuple(f"R{index}" for index in range(len(PLACES)))
SITES = dict(zip(NAMES, PLACES, strict=True))
OFFSET = np.array([0.0, -103.0, 25.0, 61.0])  # [s], those of the 19 receivers of a real study lie as far apart
DRIFT = np.array([0.0, 15e-6, -11e-6, 4e-6])
BEND = np.array([0.0, 4e-12, -6e-12, 2e-12])  # [1/s]
OWN_TAGS = [SyncTag(tag=f"T{index}", receiver=f"R{index}", position=None) for index in range(3)]
SIGMA = 0.5e-3


def ahead(receiver: int, time: Floats) -> Floats:
    """How far each simulated clock is ahead at true times [s]."""
    since = time - START
    return OFFSET[receiver] + DRIFT[receiver] * since + BEND[receiver] * since**2


@dataclass(frozen=True)
class Record:
    """A simulated record and the true time of each of its detections."""

    detections: Detections
    true: Floats


def deploy(
    *,
    days: float = 1.0,
    tags: tuple[int, ...] = (0, 1, 2),
    heard: float = 0.7,
    sigma: float = SIGMA,
    ahead: Callable[[int, Floats], Floats] = ahead,
    late: float = 0.0,
    deaf: int | None = None,
    interval: tuple[float, float] = (400.0, 640.0),
    seed: int = 1,
) -> Record:
    """Tags beside receivers that ping at random intervals; ``late``: share of arrivals by a path up to 60 ms longer."""
    rng = np.random.default_rng(seed)
    columns = []
    for number, tag in enumerate(tags):
        ping = START + 70.0 * tag + np.cumsum(rng.uniform(*interval, int(days * DAY / interval[0])))
        ping = ping[ping < START + days * DAY]
        for receiver in range(len(PLACES)):
            if deaf == receiver:
                continue
            arrives = ping[rng.random(ping.size) < (1.0 if receiver == tag else heard)]
            arrives = arrives + np.hypot(*(PLACES[tag] - PLACES[receiver])) / 1500 + sigma * rng.standard_normal(arrives.size)
            arrives += np.where(rng.random(arrives.size) < late, rng.uniform(0.02, 0.06, arrives.size), 0.0)
            columns.append((arrives, np.full(arrives.size, receiver), np.full(arrives.size, number)))
    if deaf is not None:
        lonely = START + np.arange(0.0, DAY, 500.0)
        columns.append((lonely, np.full(lonely.size, deaf), np.zeros(lonely.size)))
    true, receiver, tag = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    own = true + np.concatenate([ahead(int(part[1][0]), part[0]) for part in columns])
    order = np.argsort(own)
    record = Detections(
        time=own[order],
        receiver=receiver[order].astype(np.int32),
        tag=tag[order].astype(np.int32),
        receivers=NAMES,
        tags=tuple(f"T{index}" for index in tags),
    )
    return Record(record, true[order])


def clock_errors(found: Synchronization, ahead: Callable[[int, Floats], Floats], days: float = 1.0) -> Floats:
    """(R, T) corrected less true time at moments of the record, for a reference whose clock is true [s]."""
    moments = np.linspace(START + 0.02 * days * DAY, START + 0.98 * days * DAY, 50)
    return np.array([found.models[name].correct(moments + ahead(i, moments)) - moments for i, name in enumerate(NAMES)])


def test_clocks_minutes_apart_come_out_within_the_noise():
    found = synchronize(deploy().detections, OWN_TAGS, SITES, reference="R0")
    # A cubic through n = 250 receptions and as many of others per clock: sigma sqrt(4 / 250) = 0.06 ms in the middle, some 4
    # times that at the ends; 0.4 ms is beyond six of the former.
    assert np.abs(clock_errors(found, ahead)).max() < 0.4e-3
    assert found.sigma == pytest.approx(SIGMA, rel=0.1)  # 500 degrees of freedom and more: 3 % sd
    assert not found.excluded and found.echoes == 0


def test_without_noise_the_clocks_are_exact():
    found = synchronize(deploy(sigma=0.0).detections, OWN_TAGS, SITES, reference="R0")
    assert np.abs(clock_errors(found, ahead)).max() < 2e-6  # times near 1.6e9 s are stored to 0.24 us
    assert found.rms < 1e-6


def test_two_way_times_tell_the_offsets_without_places():
    # Step iv: d_ij = d_ji. Receivers 0, 1 and 2 carry tags; 3 does not, and its clock hangs by its two travel times alone.
    tags = [*OWN_TAGS, SyncTag(tag="T3", receiver="R3", position=None)]
    found = synchronize(deploy(tags=(0, 1, 2, 3)).detections, tags, reference="R0")
    assert np.abs(clock_errors(found, ahead)).max() < 0.4e-3


def test_an_offset_that_nothing_tells_is_refused():
    with pytest.raises(ValueError, match="offsets of R3 cannot be told from travel times; give places"):
        synchronize(deploy().detections, OWN_TAGS, reference="R0")  # R3 carries no tag and no place is known
    alone = [SyncTag(tag=f"T{index}", receiver=None, position=None) for index in range(3)]
    with pytest.raises(ValueError, match="offsets of R1, R2, R3 cannot be told"):
        synchronize(deploy().detections, alone, SITES, reference="R0")


def test_a_tag_at_a_known_place_serves_like_one_beside_a_receiver():
    placed = [SyncTag(tag=f"T{index}", receiver=None, position=PLACES[index]) for index in range(3)]
    beside = synchronize(deploy().detections, OWN_TAGS, SITES, reference="R0")
    found = synchronize(deploy().detections, placed, SITES, reference="R0")
    np.testing.assert_allclose(found.residual, beside.residual, atol=1e-9)


def test_a_tag_in_an_unknown_place_tells_of_drift_where_the_others_are_silent():
    # Tags 0 to 2 fall silent after 40 % of the day; a cubic carried on from there is milliseconds off at its end.
    record = deploy(tags=(0, 1, 2, 3))
    kept = (record.detections.tag == 3) | (record.true < START + 0.4 * DAY)
    heard = record.detections.take(np.flatnonzero(kept))
    anywhere = SyncTag(tag="T3", receiver=None, position=None)
    found = synchronize(heard, [*OWN_TAGS, anywhere], SITES, reference="R0")
    assert np.abs(clock_errors(found, ahead)).max() < 0.6e-3  # half the receptions of a full day: 1.5 times its bound above
    without = synchronize(heard, OWN_TAGS, SITES, reference="R0")
    assert np.abs(clock_errors(without, ahead)).max() > 3e-3


def test_late_arrivals_are_found_counted_and_do_no_harm():
    found = synchronize(deploy(late=0.05).detections, OWN_TAGS, SITES, reference="R0")
    assert np.abs(clock_errors(found, ahead)).max() < 0.5e-3
    # 5 % are late by 40 to 120 sigma. In a ping of two, both go; where two of three or four are late, the wrong ones may.
    assert 0.05 <= np.mean(~found.used) < 0.1
    assert sum(model.outliers for model in found.models.values()) == np.sum(~found.used)
    assert np.abs(found.residual[found.used]).max() < 5e-3


def test_a_clock_that_bends_by_the_week_takes_segments():
    def wavy(receiver: int, time: Floats) -> Floats:
        return ahead(receiver, time) + 0.02 * (receiver == 1) * np.sin(2 * np.pi * (time - START) / (20 * DAY))

    record = deploy(days=30, ahead=wavy, interval=(1200.0, 1900.0))
    single = synchronize(record.detections, OWN_TAGS, SITES, SyncSetting(segment=float("inf")), reference="R0")
    weekly = synchronize(record.detections, OWN_TAGS, SITES, SyncSetting(segment=5 * DAY), reference="R0")
    # The sine's 20 ms over one and a half periods are past any cubic, but no reason to throw its points away.
    assert single.models["R1"].rms > 2e-3 and single.models["R1"].outliers == 0
    assert np.abs(clock_errors(weekly, wavy, days=30)).max() < 0.5e-3
    model = weekly.models["R1"]
    assert len(model.limits) == 7  # 30 days in segments of 5
    np.testing.assert_allclose(model.offset(model.limits[1:-1] - 1e-3), model.offset(model.limits[1:-1]), atol=1e-6)


def test_segments_are_as_long_as_the_clocks_ask_for():
    def wavy(receiver: int, time: Floats) -> Floats:
        return ahead(receiver, time) + 0.02 * (receiver == 1) * np.sin(2 * np.pi * (time - START) / (20 * DAY))

    bent = synchronize(deploy(days=30, ahead=wavy, interval=(1200.0, 1900.0)).detections, OWN_TAGS, SITES, reference="R0")
    # Cubics over 7.5 days follow a sine of 20 days to 20 ms (2 pi 7.5 / 20)^4 / (2^7 4!) = 0.2 ms, over 15 days not to 3 ms.
    assert bent.segment < 8 * DAY
    assert np.abs(clock_errors(bent, wavy, days=30)).max() < 0.5e-3
    straight = synchronize(deploy(days=30, interval=(1200.0, 1900.0)).detections, OWN_TAGS, SITES, reference="R0")
    assert straight.segment == float("inf") and len(straight.models["R1"].limits) == 2


def test_a_segment_with_too_few_points_joins_its_neighbour():
    record = deploy(days=10, interval=(1200.0, 1900.0))
    since = record.true - START
    gap = record.detections.take((since < 4 * DAY) | (since > 6.5 * DAY))
    model = synchronize(gap, OWN_TAGS, SITES, SyncSetting(segment=DAY), reference="R0").models["R1"]
    assert not np.any((model.limits - START > 4.5 * DAY) & (model.limits - START < 6.5 * DAY))


def test_a_receiver_that_shares_no_ping_is_reported_and_left_out():
    record = deploy(deaf=3)
    found = synchronize(record.detections, OWN_TAGS, SITES, reference="R0")
    assert set(found.excluded) == {"R3"} and "shares too few pings" in found.excluded["R3"]
    corrected = correct(record.detections, found.models)
    assert not np.any(corrected.receiver == 3)
    assert corrected.time.size == np.sum(record.detections.receiver != 3)


def test_corrected_detections_are_in_order_and_true():
    record = deploy()
    found = synchronize(record.detections, OWN_TAGS, SITES, reference="R0")
    corrected = correct(record.detections, found.models)
    assert (np.diff(corrected.time) >= 0).all()
    np.testing.assert_allclose(corrected.time, np.sort(record.true), atol=0.5e-3)


def test_the_middle_clock_is_the_reference():
    assert coarse_clocks(deploy().detections).reference == "R0"  # -103, 0, 25, 61 s: the lower of the middle two


def test_receivers_with_a_tag_of_their_own_come_first_as_reference():
    clocks = deploy().detections
    alone = [name for name in clocks.receivers if coarse_clocks(clocks, tagged=[name]).reference == name]
    assert alone == list(clocks.receivers)
    assert coarse_clocks(clocks, tagged=["elsewhere"]).reference == "R0"


def test_tags_with_a_fixed_interval_take_clocks_that_are_nearer_than_half_of_it():
    regular = deploy(interval=(500.0, 500.0), days=0.5, ahead=lambda receiver, time: ahead(receiver, time) / 10).detections
    with pytest.raises(ValueError, match="or none that stand out"):
        synchronize(regular, OWN_TAGS, SITES, SyncSetting(largest_offset=1100.0))
    found = synchronize(regular, OWN_TAGS, SITES, SyncSetting(largest_offset=200.0), reference="R0")
    assert np.abs(clock_errors(found, lambda receiver, time: ahead(receiver, time) / 10, days=0.5)).max() < 0.8e-3


def test_all_that_are_tied_only_by_others_get_a_clock():
    # R0 and R3 never hear the same ping; R1 and R2 hear what either does.
    record = deploy()
    hears = (record.detections.receiver != 0) | (record.detections.tag != 1)
    hears &= (record.detections.receiver != 3) | (record.detections.tag == 1)
    found = synchronize(record.detections.take(hears), OWN_TAGS, SITES, reference="R0")
    assert np.abs(clock_errors(found, ahead)).max() < 1e-3


@pytest.mark.parametrize("gain", [0, 3e-6])
def test_a_clock_goes_on_by_its_tangent(gain):
    pieces = np.array([[1.0, gain, 0.1], [11.0, 2.0, 0.0]])
    model = ClockModel(receiver="R1", reference="R0", limits=np.array([0.0, 10.0, 20.0]), coefficients=pieces)
    np.testing.assert_allclose(model.offset([-5.0, 0.0, 4.0]), [1.0 - 5 * gain, 1.0, 2.6 + 4 * gain])
    np.testing.assert_allclose(model.offset([10.0, 20.0, 25.0]), [11.0, 31.0, 41.0])
    assert model.beyond(np.array([-1.0, 0.0, 20.0, 21.0])) == 2


def test_mistakes_are_named():
    record = deploy()
    with pytest.raises(ValueError, match="degree of a clock's polynomial must be 1 to 9, got 0"):
        SyncSetting(degree=0)
    with pytest.raises(ValueError, match="segment must be positive, got -1"):
        SyncSetting(segment=-1.0)
    with pytest.raises(ValueError, match="no detection of a sync tag .X.; there are T0, T1, T2"):
        synchronize(record.detections, [SyncTag(tag="X", receiver=None, position=None)], SITES)
    with pytest.raises(ValueError, match="no detection by the reference 'R9'"):
        synchronize(record.detections, OWN_TAGS, SITES, reference="R9")
    with pytest.raises(ValueError, match="listed twice: T0"):
        synchronize(record.detections, [*OWN_TAGS, OWN_TAGS[0]], SITES)
    few = record.detections.take(record.detections.receiver == 0)
    with pytest.raises(ValueError, match="R0 shares too few pings"):
        synchronize(few, OWN_TAGS, SITES)
