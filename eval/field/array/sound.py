"""The speed of sound over a campaign: one number, or a file of what was measured when.

Distances follow from differences of arrivals times the speed. A ping that was sent while sound was faster is brought to the usual
speed by stretching its differences, so that all that follows knows one speed alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tagtrack.envs.csv_table import open_csv
from tagtrack.envs.sim.sound_speed import sound_speed
from tagtrack.eval.field.static_array.model import Floats, Pings

USUAL_SALINITY = 35.0  # [parts per thousand], of the open ocean
SLOWEST, FASTEST = 1300.0, 1700.0  # [m/s] of any water


@dataclass(frozen=True, kw_only=True)
class SoundSpeed:
    """Speeds (M,) [m/s] at rising times (M,) [s], on straight lines between them and constant beyond."""

    time: Floats
    speed: Floats

    @property
    def usual(self) -> float:
        """The median [m/s]."""
        return float(np.median(self.speed))

    def level(self, pings: Pings) -> Pings:
        """Pings as they would have arrived had sound had its usual speed."""
        if self.speed.size == 1:
            return pings
        factor = np.interp(pings.time, self.time, self.speed) / self.usual
        heard = np.isfinite(pings.arrival)
        first = np.min(pings.arrival, axis=1, keepdims=True, where=heard, initial=np.inf)
        first = np.where(np.isfinite(first), first, 0.0)
        return replace(pings, arrival=first + (pings.arrival - first) * factor[:, None])


def read_sound_speed(text: str) -> SoundSpeed:
    """A speed [m/s], or a csv file with ``t_unix_s`` and ``sound_speed`` [m/s], or ``temperature`` [degrees Celsius] and, if
    measured, ``salinity`` [parts per thousand] and ``depth`` [m].

    Raises:
        ValueError: for a number that is no speed of sound, a file without these columns, times that do not rise; names them.
        FileNotFoundError: where there is no such file.
    """
    try:
        number = float(text)
    except ValueError:
        return _read_series(Path(text))
    if not SLOWEST <= number <= FASTEST:
        raise ValueError(f"--sound-speed must be from {SLOWEST:g} to {FASTEST:g} m/s, or a file, got {text}")
    return SoundSpeed(time=np.zeros(1), speed=np.array([number]))


def _read_series(path: Path) -> SoundSpeed:
    with open_csv(path, "sound speed", ("t_unix_s", "sound_speed")) as table:
        told = "sound_speed" if "sound_speed" in table.columns else "temperature"
        more = [name for name in ("salinity", "depth") if told == "temperature" and name in table.columns]
        columns = ("t_unix_s", told, *more)
        rows = []
        for row in table.rows(columns):
            rows.append([row.number(name) for name in columns])
            if len(rows) > 1 and rows[-1][0] <= rows[-2][0]:
                raise ValueError(f"{row.where}: times must rise, got {rows[-1][0]:.3f} after {rows[-2][0]:.3f}")
    if not rows:
        raise ValueError(f"{path} holds no speed of sound; give a row for each time, or a number in place of the file")
    time, values, *others = np.array(rows).T
    found = dict(zip(more, others, strict=True))
    try:
        speed = values
        if told == "temperature":
            speed = sound_speed(values, found.get("salinity", USUAL_SALINITY), found.get("depth", 0.0))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if not ((speed >= SLOWEST) & (speed <= FASTEST)).all():
        wrong = speed[(speed < SLOWEST) | (speed > FASTEST)][0]
        raise ValueError(f"{path}: a speed of sound must be from {SLOWEST:g} to {FASTEST:g} m/s, got {wrong:g}")
    return SoundSpeed(time=time, speed=speed)
