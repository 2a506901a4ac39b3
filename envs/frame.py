"""What the course of an action is relative to."""

from __future__ import annotations

import enum


class Frame(enum.IntEnum):
    """What the course of an action is relative to."""

    AUTO = 0  # the line where there is one tag, the heading where there are several
    LINE = 1  # from the vehicle to the estimate of the first tag
    HEADING = 2  # the vehicle's own, by its compass
    CHOSEN = 3  # to the estimate of the tag that the action chooses
