"""Cells in this process, one after the other, or in processes of this machine."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from itertools import islice
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait as wait_for
from typing import Any

from tagtrack.eval.cells.cell import Cell, Done, Parcel

Report = Callable[[int, int], None]  # number of a cell, units it has done in all
POLL = 0.1  # [s] between looks at what the processes report
ATTEMPTS = 3  # running, in which processes were ended from outside and no cell came to its end
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # the processes share the cores already

# In a process of the pool.
_counts: Any = None  # units done by each cell, shared with the parent
_busy = False
_interrupted = False  # by a Ctrl-C that came before there was anything to do


def run_here(cells: Mapping[int, Cell], report: Report) -> Iterator[tuple[int, Done]]:
    """One after the other."""
    for number, cell in cells.items():
        yield number, cell.run(_adding(partial(report, number)))


def run_in_processes(
    parcels: Mapping[int, Parcel], processes: int, report: Report, *, patient: bool = False
) -> Iterator[tuple[int, Done]]:
    """Several at a time. A process that is killed costs what it was at: that runs again, in a new one.

    Args:
        patient: Ctrl-C, which reaches all processes, is theirs to heed: they are waited for. Else they are ended.
    Raises:
        OSError: where processes are killed again and again. What a cell raises.
    """
    waiting, left = dict(parcels), ATTEMPTS
    while left:
        try:
            for number, done in _run_once(waiting, processes, report, patient):
                del waiting[number]
                left = ATTEMPTS
                yield number, done
            return
        except BrokenProcessPool:
            left -= 1
    raise OSError(
        f"processes ended {ATTEMPTS} times before any work was done: too little memory (take fewer with --processes), or a "
        "program that starts them outside of `if __name__ == '__main__':`"
    )


def _run_once(parcels: Mapping[int, Parcel], processes: int, report: Report, patient: bool) -> Iterator[tuple[int, Done]]:
    context = get_context("spawn")  # a fork would copy locks of threads that it does not have
    order, others = list(parcels), active_children()
    counts = context.RawArray("q", len(order))
    with _one_thread_each():
        pool = ProcessPoolExecutor(min(processes, len(order)), context, _begin, (counts, patient))
        running: dict[Future[Done], int] = {}
        waiting = iter(enumerate(order))
        try:
            while True:
                for place, number in islice(waiting, processes - len(running)):  # no more: what is handed in cannot be called off
                    running[pool.submit(_run, place, parcels[number])] = place
                if not running:
                    return
                finished, _ = wait(running, POLL, FIRST_COMPLETED)
                for place in running.values():
                    report(order[place], counts[place])
                for future in sorted(finished, key=lambda each: each.exception() is not None):  # what is done is not lost
                    yield order[running.pop(future)], future.result()
        except BaseException as error:
            children = [child for child in active_children() if child not in others]
            if patient and isinstance(error, KeyboardInterrupt):
                _stop_gently(running, children)
                pool.shutdown()
            for child in children:
                child.terminate()
            raise
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _stop_gently(running: Iterable[Future[Done]], children: Sequence[Any]) -> None:
    """Hand on Ctrl-C, and each further one, to the processes, until they are done."""
    while True:
        for child in children if hasattr(os, "setpgrp") else ():  # else the terminal has told them, too
            with suppress(ProcessLookupError):
                os.kill(child.pid, signal.SIGINT)
        try:
            wait(running)
            return
        except KeyboardInterrupt:
            continue


def _begin(counts: Any, patient: bool) -> None:
    """In a new process: Ctrl-C is the parent's business, and with the parent it ends."""
    global _counts
    _counts = counts
    if hasattr(os, "setpgrp"):
        os.setpgrp()  # the terminal's Ctrl-C goes to the parent alone

    def interrupt(number: int, frame: Any) -> None:
        global _interrupted
        if _busy:
            raise KeyboardInterrupt
        _interrupted = True

    signal.signal(signal.SIGINT, interrupt if patient else signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        wait_for([parent.sentinel])
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def _run(place: int, parcel: Parcel) -> Done:
    def put(total: int) -> None:
        _counts[place] = total

    global _busy
    put(0)  # it may run for the second time
    _busy = True
    try:
        if _interrupted:
            raise KeyboardInterrupt
        return parcel.run(_adding(put))
    finally:
        _busy = False


def _adding(put: Callable[[int], None]) -> Callable[[int], None]:
    """What is told of the steps just done, and tells the sum."""
    total = 0

    def tell(units: int) -> None:
        nonlocal total
        total += units
        put(total)

    return tell


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that start meanwhile do their matrix products on one thread."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ |= dict.fromkeys(ONE_THREAD, "1")
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
