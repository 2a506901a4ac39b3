"""Rows of a batch on several threads: compiled kernels hold no lock, so plain threads run side by side.

The rows are cut into more parts than there are threads, and whoever is free takes the next: a thread that other programs hold up
delays one small part, not half of the batch. Which thread computes a row changes nothing in it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

PARTS_PER_THREAD = 4


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers:
    """Threads, each with a scratch of its own.

    Args:
        rows: B, the rows of the batch. threads: at least 1; the caller's own is one of them. make_scratch: called once a thread.
    """

    def __init__(self, rows: int, threads: int, make_scratch: Callable[[], Any]) -> None:
        self.threads = min(threads, rows)
        self.scratch = [make_scratch() for _ in range(self.threads)]
        parts = 1 if self.threads == 1 else min(rows, PARTS_PER_THREAD * self.threads)
        bounds = np.linspace(0, rows, parts + 1).astype(int).tolist()
        self._parts = list(zip(bounds[:-1], bounds[1:], strict=True))
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None
        self._process = os.getpid()

    def _ready_pool(self) -> ThreadPoolExecutor | None:
        """The pool; a forked process makes its own: threads do not come along, and to wait for them would never end."""
        if self._pool is not None and self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(self.threads - 1), os.getpid()
        return self._pool

    def run(self, kernel: Callable[..., None], *arguments: Any) -> None:
        """Call ``kernel(first, last, *arguments, scratch)`` for all parts of the batch; return when all are done."""
        if self.threads == 1:  # without ado, which took as long as a tenth of a step of one world
            for first, last in self._parts:
                kernel(first, last, *arguments, self.scratch[0])
            return
        parts = iter(self._parts)  # shared by the threads; taking the next is one step of the interpreter

        def work(scratch: Any) -> None:
            for first, last in parts:
                kernel(first, last, *arguments, scratch)

        pool = self._ready_pool()
        others = [pool.submit(work, scratch) for scratch in self.scratch[1:]] if pool is not None else []
        work(self.scratch[0])
        for other in others:
            other.result()

    def close(self) -> None:
        """End the threads but the caller's."""
        if self._pool is not None:
            self._ready_pool().shutdown()  # type: ignore[union-attr]
            self._pool = None
            self.threads, self.scratch = 1, self.scratch[:1]
