"""Anything may be handed in: what comes out is an error of one line, or finite numbers inside the spaces.

    python -m tests.harness.fuzz [EXAMPLES_OF_EACH_KIND] [KIND ...]

Prints a line for each kind of input, and stops at the first example that ends otherwise, shrunk and ready to be made a test; one
that does not end within a minute is printed as it is.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis import HealthCheck, Phase, given, settings

from tests.harness.fuzz_files import FILES
from tests.harness.fuzz_lines import LINE_KINDS
from tests.harness.fuzz_worlds import WORLDS

KINDS: dict[str, Callable[..., None]] = {**WORLDS, **FILES, **LINE_KINDS}
PATIENCE = 60.0  # [s] for one example


def fuzz(kind: str, examples: int, *, seed: int | None = None) -> None:
    """Try a kind of input so many times. Raises whatever an example ends with that is no refusal."""
    case, strategy = KINDS[kind]

    def try_case(asked: Any) -> None:
        with ended(kind, asked):
            case(asked)

    tried = settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=seed is None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )(given(strategy)(try_case))
    if seed is not None:
        from hypothesis import seed as with_seed

        tried = with_seed(seed)(tried)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tried()


@contextmanager
def ended(kind: str, asked: Any) -> Iterator[None]:
    """End the process, with a line that names the example, if it does not end: compiled code heeds no exception."""

    def give_up() -> None:
        print(f"{kind}: no end after {PATIENCE:g} s: {asked!r}", flush=True)
        os._exit(1)

    timer = threading.Timer(PATIENCE, give_up)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def main() -> None:
    words = sys.argv[1:]
    examples = int(float(words.pop(0))) if words else 1000
    for kind in words or KINDS:
        begun = time.perf_counter()
        fuzz(kind, examples, seed=time.time_ns() % 2**32)
        print(
            f"{kind:<12} {examples:>8,} examples in {time.perf_counter() - begun:5.0f} s: refused in one line, or finite",
            flush=True,
        )


if __name__ == "__main__":
    main()
