"""A progress bar, over env steps or what else a command counts, on a terminal only: logs and pipes stay clean."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(total: int, unit: str = "steps") -> Iterator[Callable[[str, int], None]]:
    """Give a function that is told which policy (or stage) has just done how many units, of ``total`` for all."""
    from tqdm import tqdm

    running = ""
    with tqdm(total=total, unit=f" {unit}", unit_scale=True, disable=None, leave=False, dynamic_ncols=True) as bar:

        def advance(policy: str, steps: int) -> None:
            nonlocal running
            if policy != running:
                running = policy
                bar.set_description(policy, refresh=False)
            bar.update(steps)

        yield advance
