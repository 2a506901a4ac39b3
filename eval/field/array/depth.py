"""How deep tags are: given for all, read from a file of what their sensors told, or to be estimated with the position.

Files and options tell depths, downwards, as people do; positions have z, upwards, from the same zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagtrack.envs.csv_table import open_csv
from tagtrack.eval.field.static_array.detections import shorten
from tagtrack.eval.field.static_array.model import Floats
from tagtrack.eval.field.telemetry.places import read_height

FREE = "free"
LONGEST_BRIDGE = 600.0  # [s] from a reading to a ping without one: a fish may change its depth in minutes
THINNEST = 1e-3  # spread of receivers across the plane nearest to them, over that along it, from which they stand in space


@dataclass(frozen=True, kw_only=True)
class TagHeight:
    """Heights [m] of tags over time, by tag: rising times (M,) [s] and z (M,) of what a sensor told; one alone holds always."""

    of: Mapping[str, tuple[Floats, Floats]]

    def at(self, tag: str, time: Floats) -> Floats:
        """(K,) [m] at times (K,) [s]: on lines between readings, NaN where none is within ten minutes.

        Raises:
            ValueError: for a tag without readings, with those that have some.
        """
        if tag not in self.of:
            raise ValueError(f"no depth of tag {tag!r}; there are {shorten(tuple(self.of))}: add it, or name --tags")
        known, height = self.of[tag]
        if known.size == 1 and not np.isfinite(known[0]):
            return np.full(len(time), height[0])
        after = np.searchsorted(known, time)
        apart = np.minimum(
            np.abs(time - known[np.minimum(after, known.size - 1)]), np.abs(time - known[np.maximum(after - 1, 0)])
        )
        return np.where(apart <= LONGEST_BRIDGE, np.interp(time, known, height), np.nan)


def read_tag_height(text: str) -> float | TagHeight | None:
    """What ``--depth`` says: None for ``free``; z [m] of all tags from a depth [m]; or a csv file of depths.

    A file has columns ``tag,depth`` [m, downwards] (or z, upwards), for tags that stay at one depth, and ``t_unix_s`` for
    readings of a sensor.

    Raises:
        ValueError: for a number that is not finite, a file without these columns or rows, times of a tag that do not rise.
        FileNotFoundError: where there is no such file.
    """
    if text == FREE:
        return None
    try:
        depth = float(text)
    except ValueError:
        return _read_depths(Path(text))
    if not np.isfinite(depth):
        raise ValueError(f"--depth must be metres below the surface, {FREE}, or a file, got {text}")
    return -depth


def _read_depths(path: Path) -> TagHeight:
    found: dict[str, list[tuple[float, float]]] = {}
    with open_csv(path, "depth", ("tag", "depth")) as table:
        moving = "t_unix_s" in table.columns
        column, sign = read_height(table.columns) or ("depth", -1.0)
        for row in table.rows(("tag", column, *(("t_unix_s",) if moving else ()))):
            rows = found.setdefault(row.name("tag"), [])
            time = row.number("t_unix_s") if moving else np.inf
            if rows and not time > rows[-1][0]:
                what = f"times must rise, got {time:.3f} after {rows[-1][0]:.3f}" if moving else "tag is given twice; remove one"
                raise ValueError(f"{row.where}: {what}")
            rows.append((time, sign * row.number(column)))
    if not found:
        raise ValueError(f"{path} holds no depths; give one row for each tag, or each time")
    return TagHeight(of={tag: (np.array(rows)[:, 0], np.array(rows)[:, 1]) for tag, rows in found.items()})


def require_depths(receivers: Floats) -> None:
    """Raise ValueError where receivers (R, 3) [m] lie in one plane: above and below it would look alike."""
    spread = np.linalg.svd(receivers - receivers.mean(axis=0), compute_uv=False)
    if len(spread) < 3 or spread[-1] <= THINNEST * spread[0]:
        level = float(np.ptp(receivers[:, 2])) == 0.0
        where = f"at one depth ({-receivers[0, 2]:g} m)" if level else "in one plane"
        raise ValueError(
            f"all {len(receivers)} receivers stand {where}, from which a tag's depth cannot be told (both sides look alike); "
            "give the tags' depth (--depth M or FILE), or leave it out for positions in the plane"
        )
