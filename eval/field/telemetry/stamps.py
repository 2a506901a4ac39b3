"""Times as files write them, to seconds since 1970: numbers, stamps in UTC or with an offset, and columns that name their zone.

What is to the letter is read. Where a number is hardly seconds, or a stamp in a zone that summer time shifts, the error says so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tagtrack.envs.csv_table import shown
from tagtrack.eval.field.static_array.detections import Floats

LATEST = 1e11  # s since 1970: later times (year 5138) are in another unit
_OFFSET = r"([+-]\d\d)(?::?(\d\d))?"
_STAMP = re.compile(rf"(\d{{4}}-\d\d-\d\d[ T]\d\d:\d\d:\d\d)(\.\d{{1,9}})?(?:Z| ?{_OFFSET})?", re.ASCII)
_NO_SECONDS = re.compile(r"\S+[ T]\d{1,2}:\d\d", re.ASCII)
_DATE = re.compile(r"\d{4}-\d\d-\d\d|\d{1,2}[./]\d{1,2}[./]\d{2,4}", re.ASCII)
_NUMBER = re.compile(r"\d+(\.\d*)?", re.ASCII)
_ZONE = re.compile(r"(?:utc|gmt) ?([+-]) ?(\d{1,2})(?::?(\d\d))?", re.ASCII)

# Words with which columns of times begin, in small letters alone.
TIME_WORDS = ("dateandtime", "datetime", "detectiontimestamp", "timestamp", "datecollected", "devicetime", "time")
# Day numbers that people mistake for seconds: first and last in the years 1990 to 2060, and the day from which they count.
DAYS = (
    (32874.0, 58440.0, "1899-12-30", "as a spreadsheet counts"),
    (7305.0, 32873.0, "1970-01-01", "as R counts"),
    (726834.0, 752402.0, "0000-01-00", "as MATLAB counts"),
    (2447892.0, 2473460.0, "-4713-11-24", "as Julian dates count"),
)
FINER = ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"))
PLAUSIBLE = (6e8, 3e9)  # [s since 1970] 1989 to 2065


def unix_seconds(texts: Sequence[str]) -> Floats:
    """Seconds since 1970. The error speaks of the first text: it is for the reader who has narrowed it down to one row."""
    try:
        time = np.fromiter(map(float, texts), np.float64, len(texts))
    except ValueError:
        hint = "; name a column of stamps in UTC Date and Time (UTC)" if _STAMP.fullmatch(texts[0].strip()) else ""
        raise ValueError(f"the time must be in seconds since 1970, got {shown(texts[0])}{hint}") from None
    if not ((time >= 0) & (time < LATEST)).all():
        unit = _finer(time[0])
        hint = f": these look like {unit[1]}, divide them by {unit[0]:.0e}" if unit else ""
        raise ValueError(f"the time must be in seconds since 1970, from 0 to {LATEST:.0e}, got {shown(texts[0])}{hint}")
    return time


def _finer(value: float) -> tuple[float, str] | None:
    """In which smaller unit a number tells a time of our days."""
    return next((each for each in FINER if PLAUSIBLE[0] <= value / each[0] <= PLAUSIBLE[1]), None)


def utc_seconds(texts: Sequence[str], zone: float = 0.0) -> Floats:
    """Seconds since 1970 of times in UTC, as the nearest float64: 2019-09-09 16:04:12.574 is 1568045052.574.

    Args:
        zone: of stamps that do not end in Z or an offset from UTC, as +02:00: by how much they are ahead of UTC [s].
    """
    try:
        parts = [_STAMP.fullmatch(text) for text in texts]
        if all(parts):
            plain = [found[1] + (found[2] or "") for found in parts if found is not None]
            fine = max(map(len, plain)) > len("2019-09-09 16:04:12.574123")
            unit, second = ("ns", 1e9) if fine else ("us", 1e6)
            stamp = np.array(plain, dtype=f"datetime64[{unit}]").astype(np.int64)
            ahead = [_ahead(found, zone) for found in parts if found is not None]
            if any(ahead):
                stamp = stamp - np.round(np.array(ahead) * second).astype(np.int64)
            time = stamp / second
            if (time >= 0).all():
                return time
    except ValueError:  # the 30th of February
        pass
    raise ValueError(f"{_what_is_wrong(texts[0])}, got {shown(texts[0])}")


def _ahead(found: re.Match[str], zone: float) -> float:
    """By how much a stamp is ahead of UTC [s]."""
    if found[3] is None:
        return 0.0 if found[0].endswith("Z") else zone
    hours, minutes = int(found[3]), int(found[4] or 0)
    return 3600.0 * hours + (-60.0 if found[3].startswith("-") else 60.0) * minutes


def _what_is_wrong(text: str) -> str:
    """Why a text is no time in UTC."""
    if _NO_SECONDS.fullmatch(text):
        return "the time has no seconds, as a spreadsheet writes it; export the file again, and do not save it from a spreadsheet"
    if _DATE.fullmatch(text):
        return "a date without a time of day, as a spreadsheet writes midnight; export the file again, and save it from none"
    if _NUMBER.fullmatch(text):
        days = name_days(float(text), float(text))
        if days:
            return f"the time is a number of {days}; export the file again, and do not save it from a spreadsheet"
        if PLAUSIBLE[0] <= float(text) <= PLAUSIBLE[1]:
            return "the time is a number, as of seconds since 1970; name its column t_unix_s"
    return "the time must be in UTC from 1970 on, like 2019-09-09 16:04:11.123"


def name_days(first: float, last: float) -> str | None:
    """Days since when numbers from first to last tell, if times of 1990 to 2060; else None.

    >>> name_days(45291.0, 45300.5)
    'days since 1899-12-30, as a spreadsheet counts'
    """
    return next((f"days since {begin}, {how}" for low, high, begin, how in DAYS if low <= first and last <= high), None)


def zone_of_column(name: str) -> float | None:
    """By how much times in a column such as ``Date and Time (UTC+2)`` are ahead of UTC [s]; None where its name does not say.

    >>> zone_of_column("Date and Time (UTC-03:30)")
    -12600.0
    """
    found = _ZONE.search(name.lower().replace("\N{MINUS SIGN}", "-"))
    if found is None or not is_time(name):
        return None
    seconds = 3600.0 * int(found[2]) + 60.0 * int(found[3] or 0)
    return -seconds if found[1] == "-" else seconds


def is_time(name: str) -> bool:
    """Whether a column's name begins with a word for time."""
    return re.sub(r"[^a-z]", "", name.lower()).startswith(TIME_WORDS)
