"""Progress bars over env steps or things, on a terminal only: logs and pipes stay clean."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(total: int) -> Iterator[Callable[[str, int], None]]:
    """Give a function that is told which policy has just done how many env steps, of ``total`` for all."""
    from tqdm import tqdm

    running = ""
    with tqdm(total=total, unit=" steps", unit_scale=True, disable=None, leave=False, dynamic_ncols=True) as bar:

        def advance(policy: str, steps: int) -> None:
            nonlocal running
            if policy != running:
                running = policy
                bar.set_description(policy, refresh=False)
            bar.update(steps)

        yield advance


@contextmanager
def item_bar(total: int, unit: str) -> Iterator[Callable[[str], None]]:
    """Give a function that is told the name of each of ``total`` items as it is done."""
    from tqdm import tqdm

    with tqdm(total=total, unit=f" {unit}", disable=None, leave=False, dynamic_ncols=True) as bar:

        def advance(name: str) -> None:
            bar.set_description(name, refresh=False)
            bar.update()

        yield advance
