"""Experiments one after another, or in processes of their own: the same figures either way."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

from tagtrack.eval.papers.frame import Experiment, Findings, Setting
from tagtrack.eval.papers.registry import EXPERIMENTS

Advance = Callable[[str, int], None]  # title of the experiment, steps just done
Taken = tuple[Findings, float]  # and the time it took [s]
POLL = 0.05  # [s] between looks at what the processes report

_reports: Any = None  # in a process of the pool: where it reports its progress


def title_of(experiment: Experiment) -> str:
    return f"{experiment.paper}, {experiment.table}"


def run_experiments(
    chosen: Sequence[Experiment], setting: Setting, advance: Advance, processes: int = 1
) -> Mapping[Experiment, Taken]:
    """What each experiment found; with several ``processes`` each runs in one, on one thread."""
    if processes == 1 or len(chosen) == 1:
        return {each: _timed(each, replace(setting, advance=_bind(advance, title_of(each)))) for each in chosen}
    context = get_context("spawn")  # a fork would copy locks of threads that it does not have
    reports = context.SimpleQueue()
    plain = replace(setting, threads=1, advance=print)  # what can be sent: the process reports in its own way
    with ProcessPoolExecutor(min(processes, len(chosen)), context, _begin, (reports,)) as pool:
        running: dict[Experiment, Future[Taken]] = {
            each: pool.submit(_run_there, each.paper, each.table, plain) for each in chosen
        }
        waiting = set(running.values())
        try:
            while waiting:
                done, waiting = wait(waiting, POLL, FIRST_COMPLETED)
                while not reports.empty():
                    advance(*reports.get())
                for future in done:
                    future.result()  # an error ends the others, too
        except BaseException:
            pool.shutdown(cancel_futures=True)  # what runs ends first: a process that is told to go while it starts complains
            raise
        return {each: future.result() for each, future in running.items()}


def _begin(reports: Any) -> None:
    global _reports
    _reports = reports


def _run_there(paper: str, table: str, setting: Setting) -> Taken:
    experiment = next(each for each in EXPERIMENTS[paper] if each.table == table)
    return _timed(experiment, replace(setting, advance=_bind(lambda *done: _reports.put(done), title_of(experiment))))


def _timed(experiment: Experiment, setting: Setting) -> Taken:
    begun = time.perf_counter()
    found = experiment.run(setting)
    return found, time.perf_counter() - begun


def _bind(advance: Advance, title: str) -> Callable[[int], None]:
    return lambda steps: advance(title, steps)
