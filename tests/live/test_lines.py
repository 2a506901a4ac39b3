"""Lines of instruments: those that vendors print are understood, and what is not one has a name."""

from __future__ import annotations

import random

import pytest

from tagtrack.live.lines import BadLine, nmea, number
from tagtrack.live.receivers import RECEIVERS, Heard, JsonReceiver, RxLive, Tbr, Vr2c
from tagtrack.live.vehicles import VEHICLES, Fix, Goby, Iver, JsonVehicle, Order

# As printed in data sheets, public drivers and logs.
TBR = b"$1000042,1589557202,615,S64K,1285,0,24,69,11"
VR2C = b"450281,239,2024-10-07 20:02:07,A69-9001,6277,#A8"
RX_LIVE = b"667057,006,2019-09-05 09:41:12.623,A69-1601,999,S=66.5,N=39.5,C=0, #7B"
COMPASS = b"$C82.8P-3.89R-2.63T20.3D3.2*78"


def test_printed_lines_of_receivers() -> None:
    assert Tbr().read(TBR) == [Heard(1589557202.615, "S64K-1285")]
    assert Tbr().read(TBR.rpartition(b",")[0]) == Tbr().read(TBR)  # an older firmware leaves the last field out
    assert Tbr().read(b"$1000042,1589557202,TBR Sensor,285,8,14,69,12") == []
    (heard,) = Vr2c().read(VR2C)
    assert (heard.tag, heard.t) == ("A69-9001-6277", 1728331327.0)
    (heard,) = RxLive(check=False).read(RX_LIVE)  # its printed checksum is not that of the others
    assert (heard.tag, heard.t) == ("A69-1601-999", 1567676472.623)


def test_lines_of_vehicles() -> None:
    iver = Iver()
    assert iver.read(COMPASS) is None
    said = nmea("OSI,80,P,1,33.551,-117.95,2.5,0,N,30,0,0,m,0,271.5,0.0").strip()
    assert iver.read(said) == Fix(None, -117.95, 33.551, 271.5, pytest.approx(1.286, abs=1e-3))
    without = nmea("OSI,80,P,1,33.551,-117.95,2.5,0,N,30,0,0,m,0,,0.0").strip()
    found = iver.read(without)
    assert found is not None and found.heading == 82.8  # the compass's
    assert iver.order(Order(0.0, 359.97, 1.3, 0.0)) == b"$OMS,0.0,0.0,45,2.5,5*60\r\n"
    assert Iver(feet=True).order(Order(0.0, 90.0, 1.0, 3.048)).startswith(b"$OMS,90.0,10.0,45,1.9,5*")
    fix = Goby().read(b"NAV,LAT:42.1234,LON:10.1234,DEPTH:0,HEADING:260,SPEED:1.5")
    assert fix == Fix(None, 10.1234, 42.1234, 260.0, 1.5)
    assert Goby().read(b"CTRL,STATE:PAYLOAD") is None and Goby().read(b"CMD,RESULT:OK") is None
    assert Goby().order(Order(0.0, 260.0, 1.5, 100.0)) == b"CMD,HEADING:260.00,SPEED:1.500,DEPTH:100.0\r\n"


@pytest.mark.parametrize("kind", VEHICLES)
def test_a_simulated_vehicle_understands_what_it_is_told_and_is_understood(kind: str) -> None:
    link, fix = VEHICLES[kind](), Fix(12.5, -117.95, 33.55, 271.5, 1.25)
    found = [told for line in link.tell(fix).splitlines() if (told := link.read(line)) is not None]
    assert [(each.first, each.second, each.heading, each.speed) for each in found] == [
        pytest.approx((-117.95, 33.55, 271.5, 1.25), abs=1e-3)
    ]
    assert link.obey(link.order(Order(3.0, 123.4, 1.0, 0.0)).strip()) == pytest.approx((123.4, 1.0), abs=0.03)


@pytest.mark.parametrize("kind", RECEIVERS)
def test_a_simulated_receiver_is_understood(kind: str) -> None:
    receiver = RECEIVERS[kind]()
    (heard,) = receiver.read(receiver.write(Heard(1567676472.623, "999"), 7).strip())
    assert heard.tag.endswith("999")
    assert heard.t == pytest.approx(1567676472.623, abs=1e-3 if kind != "vr2c" else 1.0)


BAD = [
    (Tbr(), b"$1000042,1589557202,615,S64K,1285,0,24", "wrong number of fields"),
    (Tbr(), b"$1000042,1589557202,1615,S64K,1285,0,24,69", "millisecond out of range"),
    (Tbr(), b"$1000042,1589557202,615,S65K,1285,0,24,69", "unknown protocol"),
    (Tbr(), b"1000042,1589557202,615,S64K,1285,0,24,69", "no TBR sentence"),
    (Tbr(), b"$1000042,1589557202,615,S64K,\xff,0,24,69", "foreign bytes"),
    (Tbr(), b"$1000042,1589557202,615,S64K,nan,0,24,69", "no whole number"),
    (Vr2c(), VR2C.replace(b"6277", b"6278"), "wrong checksum"),
    (RxLive(), RX_LIVE, "wrong checksum"),
    (RxLive(check=False), RX_LIVE.replace(b"2019-09-05", b"2019-19-05"), "no time"),
    (JsonReceiver(), b'{"t": 1}', "no tag"),
    (JsonReceiver(), b'{"tag": "1", "range": -5}', "range out of range"),
    (JsonReceiver(), b'{"tag": "1", "range": 1e999}', "range out of range"),
    (JsonReceiver(), b'{"tag": "1", "t": NaN}', "t out of range"),
    (JsonReceiver(), b'{"tag": true}', "no tag"),
    (JsonReceiver(), b"[" * 900, "no JSON"),
    (Iver(), COMPASS.replace(b"82.8", b"82.9"), "wrong checksum"),
    (Iver(), COMPASS[:-3], "no checksum"),
    (Iver(), nmea("ACK,9,0,26").strip(), "the vehicle refused: error 26"),
    (Goby(), b"NAV,LAT:42,LON:10,HEADING:260", "no SPEED"),
    (Goby(), b"NAV,LAT:142,LON:10,HEADING:260,SPEED:1", "latitude out of range"),
    (Goby(), b"NAV,LAT:42,LAT:43,LON:10,HEADING:260,SPEED:1", "told twice"),
    (Goby(), b"CMD,RESULT:ERROR", "the vehicle refused"),
    (JsonVehicle(), b'{"lon": 1, "lat": 2}', "degrees where metres are expected"),
    (JsonVehicle(), b'{"x": 1}', "no x,y"),
]


@pytest.mark.parametrize(("link", "line", "reason"), BAD)
def test_what_is_no_line_has_a_reason(link, line: bytes, reason: str) -> None:
    with pytest.raises(BadLine, match=reason):
        link.read(line)


def mutate(line: bytes, other: bytes, rng: random.Random) -> bytes:
    """A byte flipped, a piece cut out, two lines joined, or foreign bytes put in."""
    data = bytearray(line)
    for _ in range(rng.randint(1, 3)):
        kind, place = rng.randrange(4), rng.randrange(len(data) + 1)
        if kind == 0 and data:
            data[place % len(data)] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[place : place + rng.randint(1, 9)]
        elif kind == 2:
            data = data[:place] + other[rng.randrange(len(other)) :]
        else:
            data[place:place] = bytes(rng.randrange(256) for _ in range(rng.randint(1, 4)))
    return bytes(data)


LINES = [TBR, VR2C, RX_LIVE, COMPASS]
LINES += [Goby().tell(Fix(1.0, 10.0, 42.0, 3.0, 1.0)).strip(), nmea("OSI,80,P,1,33,-117,2,0,N,3,0,0,m,0,2,0").strip()]
LINES += [b'{"t": 12.5, "tag": "27", "bearing_units": -3}', b'{"t": 1, "x": 2, "y": 3, "heading": 4, "speed": 1}']


@pytest.mark.parametrize("count", [4_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_mutated_lines_are_understood_or_refused(count: int) -> None:
    rng = random.Random(1)
    links = [kind() for kind in (*RECEIVERS.values(), *VEHICLES.values())]
    refused = 0
    for _ in range(count):
        line = mutate(rng.choice(LINES), rng.choice(LINES), rng)
        for link in links:
            try:
                link.read(line)
            except BadLine:
                refused += 1
    assert refused > 6 * count


@pytest.mark.parametrize("text", ["1_000", "inf", "nan", "0x10", "", "1e", "--1", "1 2", "\u0663"])
def test_only_plain_numbers_are_numbers(text: str) -> None:
    with pytest.raises(BadLine):
        number(text, "value")
    assert number(" -1.5e1 ", "value") == -15.0
