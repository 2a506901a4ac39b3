"""A progress bar, over env steps or what else a command counts; where there is no terminal, as in a log, a line each minute."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

SILENCE = 60.0  # [s] between the lines of a log


@contextmanager
def progress_bar(total: int, unit: str = "steps") -> Iterator[Callable[[str, int], None]]:
    """Give a function that is told which policy (or stage) has just done how many units, of ``total`` for all."""
    from tqdm import tqdm

    running, done, told = "", 0, time.monotonic()
    with tqdm(total=total, unit=f" {unit}", unit_scale=True, disable=None, leave=False, dynamic_ncols=True) as bar:

        def advance(policy: str, steps: int) -> None:
            nonlocal running, done, told
            if bar.disable:
                done += steps
                if time.monotonic() - told >= SILENCE:
                    told = time.monotonic()
                    with suppress(OSError):  # nobody reads it any more
                        print(f"{policy}: {100 * done // max(total, 1)} % of all {unit}", file=sys.stderr, flush=True)
                return
            if policy != running:
                running = policy
                bar.set_description(policy, refresh=False)
            bar.update(steps)

        yield advance
