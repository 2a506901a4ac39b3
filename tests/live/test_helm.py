"""What follows from lines: orders within the box, safe actions where navigation stalls, and nothing from lines that are wrong."""

from __future__ import annotations

import math
import random
from typing import Any

import numpy as np
import pytest

from tagtrack.envs.task import build_task
from tagtrack.live.helm import Helm, Orders, parse_corners
from tagtrack.live.lines import nmea
from tagtrack.live.receivers import JsonReceiver, Tbr
from tagtrack.live.rehearse import SILENT
from tagtrack.live.safety import Box, Guard
from tagtrack.live.steer import make_orders
from tagtrack.live.vehicles import Goby, Iver, JsonVehicle, VehicleLink
from tests.live.conftest import MATHEMATICAL
from tests.live.test_lines import mutate

SQUARE = ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))


def helm_of(vehicle: VehicleLink | None = None, receiver: Any = None, env: str = "AreaOnly-v0", **options: Any) -> Helm:
    task = build_task(env, particles=100)
    values = {"tags": ("1285",), "policy": "circle:200", "conventions": MATHEMATICAL, **options}
    return Helm(Orders(task=task, **values), receiver or JsonReceiver(), vehicle or JsonVehicle())


def fix(t: float, x: float, y: float, heading: float = 0.0, speed: float = 1.0) -> bytes:
    return f'{{"t": {t}, "x": {x}, "y": {y}, "heading": {heading}, "speed": {speed}}}'.encode()


def test_no_order_leads_out_of_the_box() -> None:
    """The vehicle goes where it is told for an hour: it comes near the edge and never beyond."""
    helm = helm_of(box=SQUARE, policy="circle:200")  # whose circle is far wider than the box
    x, y, heading, reasons = 0.0, 0.0, 0.0, set()
    for second in range(3600):
        order = helm.steer(fix(float(second), x, y, heading), float(second))
        assert order is not None
        turn = (order.course - heading + math.pi) % (2 * math.pi) - math.pi
        heading += max(-0.05, min(0.05, 0.05 * turn))
        x, y = x + order.speed * math.cos(heading), y + order.speed * math.sin(heading)
        reasons.add(helm.reason)
        assert max(abs(x), abs(y)) < 50.0
    assert reasons >= {"box"}


def test_outside_the_box_it_turns_back() -> None:
    helm = helm_of(box=SQUARE)
    order = helm.steer(fix(0.0, 80.0, 0.0), 0.0)
    assert order is not None and helm.reason == "outside the box"
    assert abs(order.course) == pytest.approx(math.pi)


NOTCH = ((-150, -150), (150, -150), (150, 150), (40, 150), (40, -30), (-40, -30), (-40, 150), (-150, 150))
BOXES = {"none": (), "square": SQUARE, "notch": NOTCH}


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("action", ["hold", "stop", "home"])
def test_a_vehicle_whose_navigation_is_silent_stays_where_it_may_be(action: str, box: str) -> None:
    """For 25 minutes it is told what it does by time alone: it never leaves the box, and comes to rest at last, or at home."""
    helm = helm_of(safe=action, stale=10.0, box=BOXES[box], policy="circle:30")
    x, y = (0.0, 0.0) if box != "notch" else (-95.0, 0.0)
    heading, orders = 0.3, 0
    order = helm.steer(fix(0.0, x, y, heading), 0.0)
    for second in range(1, 1500):
        assert order is not None
        turn = (order.course - heading + math.pi) % (2 * math.pi) - math.pi
        heading += max(-0.05, min(0.05, turn))
        x, y = x + order.speed * math.cos(heading), y + order.speed * math.sin(heading)
        assert not BOXES[box] or Box(BOXES[box]).holds(x, y), (second, x, y)
        if second <= 60:
            order = helm.steer(fix(float(second), x, y, heading, order.speed), float(second))
            away = x, y
        else:
            told = helm.watch(float(second))
            assert (told is None) == (second <= 70)
            order, orders = told or order, orders + (told is not None)
    assert helm.reason.endswith("stop") and order is not None and order.speed == 0.0
    assert orders > 1400 and math.dist((x, y), away) < 300.0
    if action == "home":
        assert math.dist((x, y), (0.0, 0.0) if box != "notch" else (-95.0, 0.0)) < 25.0
    assert helm.steer(fix(1500.0, x, y), 1500.0) is not None and "old" not in helm.reason


def test_clocks_and_places_that_leap_are_counted_and_survived() -> None:
    helm = helm_of()
    assert helm.steer(fix(100.0, 0.0, 0.0), 100.0) is not None
    for t, x in ((99.0, 0.0), (5000.0, 0.0), (101.0, 5000.0), (200.0, 0.0)):
        assert helm.steer(fix(t, x, 0.0), 101.0) is None
    assert dict(helm.counts) == {"vehicle: clock goes back": 1, "vehicle: clock leaps": 2, "vehicle: place leaps": 1}
    assert helm.steer(fix(102.0, 1.0, 0.0), 102.0) is not None
    later = [helm.steer(fix(103.0 + k, 5000.0 + k, 0.0), 103.0 + k) for k in range(3)]  # it surfaced elsewhere: all agree
    assert later[:2] == [None, None] and later[2] is not None


def test_pings_of_strangers_and_of_other_times_do_not_count() -> None:
    helm = helm_of(receiver=Tbr())
    for unix, tag in ((60, 1285), (60, 99), (500, 1285)):
        helm.hear(f"$1000042,{unix},000,S64K,{tag},0,24,69".encode(), 61.0)
    helm.steer(fix(60.0, 0.0, 0.0), 60.0)
    helm.hear(b"$1000042,75,000,S64K,1285,0,24,69", 76.0)
    helm.steer(fix(90.0, 3.0, 0.0), 90.0)
    assert dict(helm.counts) == {"receiver: a tag that is not in this mission": 1, "receiver: clock is ahead of ours": 1}
    assert helm.tracker is not None and dict(helm.tracker.counts) == {"before the first navigation": 1}
    assert helm.tracker.last_estimates()[0].heard == 75.0
    host = helm_of(receiver=Tbr(), stamp="host")
    host.steer(fix(60.0, 0.0, 0.0), 60.0)
    host.hear(b"$1000042,1589557202,615,S64K,1285,0,24,69", 75.5)
    host.steer(fix(90.0, 0.0, 0.0), 90.0)
    assert host.tracker is not None and host.tracker.last_estimates()[0].heard == 75.5


def test_nothing_follows_from_lines_with_a_wrong_checksum() -> None:
    """Sentences of an Iver, thousands of them mutated: an order follows from those alone whose checksum holds."""
    pytest.importorskip("pymap3d")
    iver = Iver()
    helm = helm_of(vehicle=iver, receiver=Tbr(), policy="circle:50")
    rng = random.Random(2)
    good = [nmea(f"OSI,80,P,1,33.55{k:02d},-117.95,2.0,0,N,30,0,0,m,0,{k}.0,0.0").strip() for k in range(60)]
    orders = 0
    for second in range(3000):
        line = mutate(rng.choice(good), rng.choice(good), rng) if second % 2 else good[0]
        order = helm.steer(line, float(second))
        body, star, check = line.partition(b"*")
        right = f"{np.bitwise_xor.reduce(np.frombuffer(body[1:], np.uint8)):02X}"
        holds = bool(star) and check.decode("latin-1").upper() == right
        assert order is None or holds
        orders += order is not None
        helm.hear(mutate(b"$1000042,1589557202,615,S64K,1285,0,24,69,11", line, rng), float(second))
    assert 1400 < orders < 1700 and sum(helm.counts.values()) > 2000


def test_lines_in_degrees_and_metres_are_told_apart() -> None:
    helm = helm_of()
    assert helm.steer(b'{"lon": 10.0, "lat": 60.0}', 0.0) is None
    assert dict(helm.counts) == {"vehicle: degrees where metres are expected, or the other way round": 1}


def test_the_first_fix_is_the_origin_where_none_was_named() -> None:
    pytest.importorskip("pymap3d")
    helm = helm_of(vehicle=Goby(), conventions=MATHEMATICAL.__class__(), box=())
    assert helm.steer(b"NAV,LAT:60.0,LON:10.0,DEPTH:0,HEADING:0,SPEED:1", 0.0) is not None
    assert helm.tracker is not None and (helm.tracker.pose.x, helm.tracker.pose.y) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_boxes() -> None:
    bent = Box(parse_corners("0,0 10,0 10,10 8,10 8,2 0,2"))
    assert bent.holds(9, 9) and bent.holds(1, 1) and not bent.holds(1, 9)
    assert bent.holds(*bent.nearest_inside(5, 20)) and bent.holds(*bent.nearest_inside(5, 4))
    assert Box().holds(1e9, 1e9)
    wrong = [("0,0 1,1", "at least three corners"), ("0,0 1,1 2,2", "some area"), ("0;0", "a corner is x,y")]
    wrong += [("0,0 9,8 9,0 0,9", "must not cross"), ("nan,0 1,1 2,0", "two numbers")]
    for text, message in wrong:
        with pytest.raises(ValueError, match=message):
            Box(parse_corners(text))
    with pytest.raises(ValueError, match="home .* lies outside"):
        Guard(box=Box(SQUARE), home=(100.0, 0.0))
    with pytest.raises(ValueError, match="hold, stop, home, got 'panic'"):
        Guard(box=Box(), action="panic")


def test_reasons_without_end_are_counted_as_one() -> None:
    helm = helm_of(vehicle=Iver(), conventions=MATHEMATICAL.__class__())
    for number in range(1000):
        helm.steer(nmea(f"ACK,9,0,{number + 1}").strip(), 0.0)
    assert len(helm.counts) <= 51 and sum(helm.counts.values()) == 1000


def test_after_a_long_gap_a_new_belief_begins() -> None:
    helm = helm_of()
    helm.steer(fix(0.0, 0.0, 0.0), 1e9)
    helm.hear(b'{"tag": "1285"}', 1e9 + 10)
    helm.steer(fix(30.0, 0.0, 0.0), 1e9 + 30)
    first = helm.tracker
    orders = [helm.steer(fix(9000.0 + 10 * k, 800.0, 0.0), 1e9 + 9000.0 + 10 * k) for k in range(4)]
    assert [order is None for order in orders] == [True, True, False, False]
    assert helm.tracker is not first and helm.tracker is not None and math.isnan(helm.tracker.last_estimates()[0].heard)


def test_a_vehicle_with_a_clock_of_its_own_times_the_pings_without_one() -> None:
    helm = helm_of(env="RangeOnly-v0", policy="circle")
    for step in range(5):
        helm.hear(b'{"tag": "1285", "range": 120.0, "serial": "ABC"}', 1e9 + 10.0 * step - 1.0)
        helm.steer(fix(7.0 + 10.0 * step, 0.0, 0.0), 1e9 + 10.0 * step)
    assert helm.tracker is not None and helm.tracker.last_estimates()[0].heard == pytest.approx(46.0)
    assert not helm.counts


def test_a_box_in_degrees_is_its_own_origin() -> None:
    pytest.importorskip("pymap3d")
    corners = "10.0,60.0 10.01,60.0 10.01,60.005 10.0,60.005"
    asked = {
        **SILENT, "env": "AreaOnly-v0", "particles": 50, "set": [], "tags": ["1285"], "seed": 0, "policy": "circle:50",
        "headings": None, "stamp": "receiver", "speed": 1.0, "box": corners, "stale": None,
    }  # fmt: skip
    orders = make_orders(asked, in_degrees=True, mathematical_allowed=False)
    assert orders.stale == 75.0
    helm = Helm(orders, Tbr(), Goby())
    assert helm.steer(b"NAV,LAT:0.0,LON:0.0,HEADING:0,SPEED:0", 0.0) is None
    assert helm.steer(b"NAV,LAT:60.0025,LON:10.005,HEADING:0,SPEED:1", 1.0) is not None and helm.reason in ("", "box")
    assert helm.steer(b"NAV,LAT:60.0025,LON:10.0105,HEADING:0,SPEED:1", 60.0) is not None and helm.reason == "outside the box"
    assert dict(helm.counts) == {"vehicle: no position yet": 1}
    for name, value, message in (
        ("box", "0,0 400,0 400,300", "longitude must be within"),
        ("box", "", "--box is empty"),
        ("depth", math.nan, "--depth must be from 0"),
        ("seed", -1, "--seed must be from 0"),
        ("home", (50.0, 50.0), "beyond|outside|from the origin"),
        ("stale", -5.0, "--stale must be from"),
        ("particles", 0, "--particles must be at least 1"),
    ):
        with pytest.raises(ValueError, match=message):
            Helm(make_orders({**asked, name: value}, in_degrees=True, mathematical_allowed=False), Tbr(), Goby())
