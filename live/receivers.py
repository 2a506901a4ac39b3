"""What receivers say, line by line. Formats are from data sheets and public drivers; none was tried on hardware.

A receiver turns a line into pings, or raises ``BadLine``; lines that tell of the receiver itself give none. Tags go by the name
that the line gives them: protocol and number, ``S64K-1285`` or ``A69-1601-999``; a mission may name them by their number alone.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import ClassVar

from tagtrack.live.lines import BadLine, number, object_of, text_of

LATEST = 4_102_444_800.0  # the year 2100 [s]
TBR_PROTOCOLS = frozenset(("R256", "R04K", "R64K", "R01M", "S256", "S64K", "HS256", "DS256", "OPi", "OPs"))
NAMED = ("t", "arrival", "depth", "bearing_units", "units", "strength", "range", "slant_range")


@dataclass(frozen=True)
class Heard:
    """A ping, or an answer that did not come."""

    t: float | None  # [s]; None: now
    tag: str
    heard: bool = True
    arrival: float | None = None
    depth: float | None = None
    values: dict[str, float] = field(default_factory=dict)


class Receiver(ABC):
    """Understands the lines of one kind of receiver."""

    name: ClassVar[str]

    @abstractmethod
    def read(self, line: bytes) -> list[Heard]:
        """What a line tells. Raises BadLine."""

    @abstractmethod
    def write(self, heard: Heard, number: int) -> bytes:
        """The line that would tell this, of the receiver that is simulated."""


class Tbr(Receiver):
    """Thelma TBR 700 RT and TB Live: ``$serial,unix,ms,protocol,id,data,SNR,kHz[,count]``. There is no checksum."""

    name = "tbr"

    def read(self, line: bytes) -> list[Heard]:
        text = text_of(line)
        if text.startswith("ack"):  # of the host's clock
            return []
        fields = text[1:].split(",")
        if not text.startswith("$") or len(fields) < 3:
            raise BadLine("no TBR sentence")
        if not fields[0].isdigit():
            raise BadLine("serial is no number")
        second = number(fields[1], "time", least=0.0, most=LATEST)
        if fields[2] == "TBR Sensor":
            return []
        if len(fields) not in (8, 9):
            raise BadLine("wrong number of fields")
        if fields[3] not in TBR_PROTOCOLS:
            raise BadLine("unknown protocol")
        if not (fields[1].isdigit() and fields[2].isdigit() and fields[4].isdigit()):
            raise BadLine("time or id is no whole number")
        millisecond = number(fields[2], "millisecond", least=0.0, most=999.0)
        for place, what, most in ((6, "SNR", 255.0), (7, "kHz", 1000.0)):
            number(fields[place], what, least=0.0, most=most)
        if fields[5]:
            number(fields[5], "data", least=0.0)
        if len(fields) == 9:
            number(fields[8], "count", least=0.0)
        return [Heard(second + millisecond / 1000.0, f"{fields[3]}-{int(fields[4])}")]

    def write(self, heard: Heard, number: int) -> bytes:
        stamp = round(1000.0 * (heard.t or 0.0))
        return f"$1000042,{stamp // 1000},{stamp % 1000:03d},S64K,{heard.tag},0,24,69,{number}\r".encode("ascii")


class _Innovasea(Receiver):
    """What lines of VR2C and Rx-LIVE have in common: ``serial,line,UTC,codespace,id,...,#checksum``."""

    def __init__(self, *, check: bool = True) -> None:
        self.check = check

    def read(self, line: bytes) -> list[Heard]:
        text = text_of(line)
        body, comma, end = text.rpartition(",")
        end = end.strip()
        if not comma or not end.startswith("#"):
            raise BadLine("no checksum")
        if self.check and end[1:].upper() != f"{sum(body.encode('ascii')) % 256:02X}":
            raise BadLine("wrong checksum")
        fields = [part.strip() for part in body.split(",")]
        if len(fields) < 4 or not (fields[0].isdigit() and fields[1].isdigit()):
            raise BadLine("no detection")
        if "STS" in fields:
            return []
        if len(fields) < 5 or not fields[4].isdigit():
            raise BadLine("id is no number")
        space = fields[3].split("-")
        if len(space) != 2 or not all(part.isalnum() for part in space):
            raise BadLine("no codespace")
        return [Heard(_utc(fields[2]), f"{fields[3]}-{int(fields[4])}")]

    def _line(self, heard: Heard, number: int, when: str, more: str) -> bytes:
        body = f"450281,{number % 1000:03d},{when},A69-9001,{heard.tag}{more}"
        return f"{body},#{sum(body.encode('ascii')) % 256:02X}\r\n".encode("ascii")


class Vr2c(_Innovasea):
    """Innovasea VR2C: whole seconds."""

    name = "vr2c"

    def write(self, heard: Heard, number: int) -> bytes:
        return self._line(heard, number, _stamp(heard.t or 0.0)[:19], "")


class RxLive(_Innovasea):
    """Innovasea Rx-LIVE: milliseconds, and signal and noise beside."""

    name = "rxlive"

    def write(self, heard: Heard, number: int) -> bytes:
        return self._line(heard, number, _stamp(heard.t or 0.0), ",S=66.5,N=39.5,C=0")


class JsonReceiver(Receiver):
    """Anything else: ``{"t": 12.5, "tag": "27", "bearing_units": -3}``; also strength, range, arrival, depth, ``"heard": false``.

    Without ``t`` it was now. Other names are taken for readings of a sensor of one's own.
    """

    name = "json"

    def read(self, line: bytes) -> list[Heard]:
        said = object_of(line)
        tag = said.pop("tag", None)
        if isinstance(tag, bool) or not isinstance(tag, (str, int)) or not str(tag).strip() or not str(tag).isprintable():
            raise BadLine("no tag")
        heard = said.pop("heard", True)
        if heard not in (True, False, 0, 1):
            raise BadLine("heard is neither true nor false")
        named = {name: said.pop(name) for name in NAMED if said.get(name) is not None}
        given = {name: number(value, name) for name, value in named.items()}
        # Of a sensor of one's own; what is no number is no reading.
        given |= {name: float(value) for name, value in said.items() if type(value) in (int, float) and abs(value) < 1e300}
        time, arrival, depth = (given.pop(name, None) for name in ("t", "arrival", "depth"))
        if given.get("range", 0.0) < 0.0:
            raise BadLine("range out of range")
        return [Heard(time, str(tag).strip(), bool(heard), arrival, depth, given)]

    def write(self, heard: Heard, number: int) -> bytes:
        said = {"t": heard.t, "tag": heard.tag, "heard": heard.heard, "arrival": heard.arrival, "depth": heard.depth}
        told = {name: value for name, value in said.items() if value is not None}
        return (json.dumps({**told, **heard.values}) + "\n").encode("ascii")


RECEIVERS: Mapping[str, type[Receiver]] = {kind.name: kind for kind in (Tbr, Vr2c, RxLive, JsonReceiver)}


def _utc(text: str) -> float:
    for layout in ("%Y-%m-%d %H:%M:%S.%f", "%Y-%m-%d %H:%M:%S"):
        try:
            found = datetime.strptime(text, layout).replace(tzinfo=timezone.utc).timestamp()
        except ValueError:
            continue
        if 0.0 <= found <= LATEST:
            return found
    raise BadLine("no time")


def _stamp(time: float) -> str:
    return datetime.fromtimestamp(round(time, 3), timezone.utc).strftime("%Y-%m-%d %H:%M:%S.%f")[:23]
