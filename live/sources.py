"""Where lines come from and go to: ``-``, a file that grows, ``udp:PORT``, ``tcp:HOST:PORT``, ``serial:DEV:BAUD``.

Nothing here waits: ``read`` gives the lines that have come so far. A connection that breaks is made anew.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import time
from abc import ABC, abstractmethod
from collections import Counter
from pathlib import Path
from typing import Any

from tagtrack.live.lines import LONGEST_LINE

CHUNK = 1 << 16
RETRY = 1.0  # between two attempts to connect [s]
MOST_WAITING = 1 << 20  # bytes that wait to be sent; older ones are of no use to a vehicle


class Source(ABC):
    """A stream of lines both ways."""

    def __init__(self) -> None:
        self._rest = b""
        self._too_long = False
        self.counts: Counter[str] = Counter()
        self.ended = False  # nothing will come any more

    def read(self) -> list[bytes]:
        """Whole lines that have come since, without their ends; overlong ones are dropped and counted."""
        data = self._receive()
        if not data:
            return []
        *lines, self._rest = (self._rest + data.replace(b"\r", b"\n")).split(b"\n")
        if self._too_long and lines:
            lines, self._too_long = lines[1:], False
        if len(self._rest) > LONGEST_LINE:
            if not self._too_long:
                self.counts["line too long"] += 1
            self._rest, self._too_long = b"", True
        whole = [line for line in lines if line]
        self.counts["line too long"] += sum(len(line) > LONGEST_LINE for line in whole)
        return [line for line in whole if len(line) <= LONGEST_LINE]

    @abstractmethod
    def _receive(self) -> bytes:
        """Bytes that have come; none if there are none."""

    def write(self, data: bytes) -> bool:
        """Send bytes; whether they went out."""
        return False

    def descriptor(self) -> int | None:
        """What ``select`` may wait on."""
        return None

    def close(self) -> None:  # noqa: B027 - most have nothing to let go of
        """Let go of it."""


class Standard(Source):
    """Standard input and output."""

    def __init__(self) -> None:
        super().__init__()
        if sys.stdin is None or sys.stdout is None:
            raise ValueError("-: standard input or output is closed; open it, or name another source")
        self._in = sys.stdin.fileno()

    def _receive(self) -> bytes:
        if self.ended or not select.select([self._in], [], [], 0)[0]:
            return b""
        data = os.read(self._in, CHUNK)
        self.ended = not data
        return data

    def write(self, data: bytes) -> bool:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return True

    def descriptor(self) -> int | None:
        return None if self.ended else self._in


class GrowingFile(Source):
    """A file that somebody appends to (the papers' receiver): read from its end on. What is sent goes to ``FILE.out``."""

    def __init__(self, path: Path, *, from_start: bool = False) -> None:
        super().__init__()
        self.path = path
        self._place = path.stat().st_size if path.is_file() and not from_start else 0

    def _receive(self) -> bytes:
        try:
            with self.path.open("rb") as file:
                size = file.seek(0, os.SEEK_END)
                if size < self._place:  # begun anew
                    self._place, self._rest = 0, b""
                file.seek(self._place)
                data = file.read(CHUNK)
        except FileNotFoundError:
            return b""
        except OSError:
            self.counts["file that cannot be read"] += 1
            return b""
        self._place += len(data)
        return data

    def write(self, data: bytes) -> bool:
        with self.path.with_name(self.path.name + ".out").open("ab") as file:
            file.write(data)
        return True


class Udp(Source):
    """Datagrams to a port of ours from one machine, that of the first; answers go where the last one came from."""

    def __init__(self, port: int, host: str = "") -> None:
        super().__init__()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._peer: Any = None
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise OSError(f"udp port {port} cannot be had ({error.strerror}); is another vehicle or receiver on it?") from None
        self._socket.setblocking(False)

    def _receive(self) -> bytes:
        parts = []
        for _ in range(256):
            try:
                data, sender = self._socket.recvfrom(CHUNK)
            except (BlockingIOError, ConnectionError):
                break
            if self._peer is None or sender[0] == self._peer[0]:
                self._peer = sender  # a receiver that was switched off and on again has another port
            else:
                self.counts["from another sender"] += 1
                continue
            parts.append(data if data.endswith((b"\n", b"\r")) else data + b"\n")
        return b"".join(parts)

    def write(self, data: bytes) -> bool:
        if self._peer is None:
            return False
        try:
            self._socket.sendto(data, self._peer)
        except OSError:
            return False
        return True

    def descriptor(self) -> int | None:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


class Tcp(Source):
    """A connection to a server, made anew whenever it breaks."""

    def __init__(self, host: str, port: int, *, wait: float = 10.0) -> None:
        super().__init__()
        self._address = host, port
        self._socket: socket.socket | None = None
        self._waiting = b""
        self._retry = 0.0
        last: OSError | None = None
        until = time.monotonic() + wait
        while self._socket is None:
            last = self._connect() or last
            if self._socket is None:
                if time.monotonic() > until:
                    reason = last.strerror if last is not None and last.strerror else last
                    raise OSError(f"tcp:{host}:{port} does not answer ({reason}); is the other end running?")
                time.sleep(0.1)

    def _connect(self) -> OSError | None:
        try:
            self._socket = socket.create_connection(self._address, timeout=2.0)
        except OSError as error:
            return error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._rest, self._waiting = b"", b""
        return None

    def _receive(self) -> bytes:
        if self._socket is None:
            if time.monotonic() >= self._retry:
                self._retry = time.monotonic() + RETRY
                self._connect()
            return b""
        self._flush()
        try:
            data = self._socket.recv(CHUNK) if self._socket is not None else b""
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._break()
        return data

    def _break(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self.counts["connection broken"] += 1
        self._socket, self._retry = None, time.monotonic() + RETRY

    def write(self, data: bytes) -> bool:
        if self._socket is None:
            return False
        self._waiting = (self._waiting + data)[-MOST_WAITING:]
        self._flush()
        return self._socket is not None

    def _flush(self) -> None:
        while self._waiting and self._socket is not None:
            try:
                sent = self._socket.send(self._waiting)
            except BlockingIOError:
                return
            except OSError:
                self._break()
                return
            self._waiting = self._waiting[sent:]

    def descriptor(self) -> int | None:
        return None if self._socket is None else self._socket.fileno()

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()


class Serial(Source):
    """A serial line (pyserial)."""

    def __init__(self, device: str, baud: int) -> None:
        super().__init__()
        try:
            import serial
        except ImportError:
            raise ImportError('serial lines need pyserial: pip install "tagtrack[live]"') from None
        self._open = lambda: serial.Serial(device, baud, timeout=0, write_timeout=1.0, exclusive=True)
        self._retry = 0.0
        try:
            self._port: Any = self._open()
        except (OSError, ValueError) as error:  # pyserial's errors are of these kinds
            raise OSError(f"serial:{device}:{baud} cannot be opened ({error}); is it there, and nobody else on it?") from None

    def _receive(self) -> bytes:
        if self._port is None:
            if time.monotonic() >= self._retry:
                self._retry = time.monotonic() + RETRY
                with contextlib.suppress(OSError, ValueError):
                    self._port = self._open()
            return b""
        try:
            return bytes(self._port.read(CHUNK))
        except (OSError, TypeError):
            self._break()
            return b""

    def _break(self) -> None:
        self.counts["connection broken"] += 1
        with contextlib.suppress(OSError):
            self._port.close()
        self._port, self._rest, self._retry = None, b"", time.monotonic() + RETRY

    def write(self, data: bytes) -> bool:
        if self._port is None:
            return False
        try:
            return self._port.write(data) == len(data)
        except (OSError, TypeError):
            self._break()
            return False

    def descriptor(self) -> int | None:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            return int(self._port.fileno())
        return None

    def close(self) -> None:
        if self._port is not None:
            self._port.close()


def open_source(spec: str, *, wait: float = 10.0) -> Source:
    """The source of a specification.

    Args:
        wait: how long a tcp server may take to answer [s].
    Raises:
        ValueError: for a specification that is none. OSError: where it cannot be had.
    """
    kind, _, rest = spec.partition(":")
    if spec == "-":
        return Standard()
    if kind == "udp":
        return Udp(_port(rest, spec))
    if kind == "tcp":
        host, _, port = rest.rpartition(":")
        return Tcp(host or "127.0.0.1", _port(port, spec), wait=wait)
    if kind == "serial":
        device, _, baud = rest.rpartition(":")
        if not device or not (baud.isascii() and baud.isdecimal()):
            raise ValueError(f"{spec}: a serial line is serial:DEVICE:BAUD, as serial:/dev/ttyUSB0:115200")
        return Serial(device, int(baud))
    path = Path(spec)
    if not path.absolute().parent.is_dir():
        raise ValueError(f"{spec}: neither -, udp:PORT, tcp:HOST:PORT, serial:DEVICE:BAUD nor a file in a folder that is there")
    return GrowingFile(path)


def _port(text: str, spec: str) -> int:
    if not (text.isascii() and text.isdecimal()) or not 0 < int(text) < 65536:
        raise ValueError(f"{spec}: a port is a number from 1 to 65535, got {text!r}")
    return int(text)


def wait_for(sources: list[Source], timeout: float) -> None:
    """Sleep until a source may have something, or for ``timeout`` seconds."""
    descriptors = [each for source in sources if (each := source.descriptor()) is not None]
    polled = any(source.descriptor() is None for source in sources)
    if polled:  # a file, or a connection that is to be made again
        timeout = min(timeout, 0.02)
    if descriptors:
        select.select(descriptors, [], [], timeout)
    else:
        time.sleep(timeout)


