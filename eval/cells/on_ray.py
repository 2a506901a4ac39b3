"""Cells as tasks of Ray, on this machine or on a cluster. What a lost node was at runs again elsewhere."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from tagtrack.eval.cells.cell import Done, Parcel
from tagtrack.eval.cells.local import ONE_THREAD, Report

POLL = 0.5  # [s] between looks at what the tasks report
ANSWER = 10.0  # [s] in which a cluster must answer
RETRIES = 20  # of a task whose node or process is lost


class Board:
    """Lives beside the driver: how far the tasks are."""

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}

    def note(self, number: int, total: int) -> None:
        self.counts[number] = total

    def read(self) -> dict[int, int]:
        return self.counts


def run_on_ray(
    parcels: Mapping[int, Parcel], address: str | None, processes: int | None, report: Report
) -> Iterator[tuple[int, Done]]:
    """As many at a time as the cluster has cores.

    Args:
        address: of a cluster, "auto" for the one that runs here; None: that of RAY_ADDRESS, or a new one of ``processes`` cores.
    Raises:
        ImportError: without Ray. ConnectionError: where no cluster answers. OSError: where tasks are lost again and again.
        What a cell raises.
    """
    ray = connect(address, processes)
    running: dict[Any, int] = {}
    try:
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=True)
        board = ray.remote(Board).options(num_cpus=0, max_restarts=-1, scheduling_strategy=here).remote()
        work = ray.remote(_run).options(num_cpus=1, max_retries=RETRIES)
        running |= {work.remote(number, parcel, board): number for number, parcel in parcels.items()}
        while running:
            finished, _ = ray.wait(list(running), num_returns=1, timeout=POLL)
            with suppress(ray.exceptions.RayError):  # the bar stands still while its board is made anew
                for number, total in ray.get(board.read.remote(), timeout=POLL).items():
                    report(number, total)
            for reference in finished:
                yield running.pop(reference), _value(ray, reference)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.shutdown()


def import_ray() -> Any:
    """Ray, which then tells its makers nothing. Raises ImportError with the way out."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError:
        raise ImportError('--engine ray needs Ray: pip install "tagtrack[ray]"') from None
    return ray


def connect(address: str | None, processes: int | None) -> Any:
    """Ray, connected to a cluster, or to a new one of this machine alone."""
    ray = import_ray()
    found = address or os.environ.get("RAY_ADDRESS")
    if found and processes is not None:
        raise ValueError("a cluster that runs already has the cores it has; leave --processes out")
    if found:
        _require_answer(found)
    alone: dict[str, Any] = {} if found else {"num_cpus": processes, "include_dashboard": False}
    environment = {"env_vars": dict.fromkeys(ONE_THREAD, "1")}
    try:
        ray.init(address=address, logging_level="ERROR", log_to_driver=False, runtime_env=environment, **alone)
    except RuntimeError as error:  # other versions of Ray or Python there, for instance
        raise ConnectionError(f"no way into the Ray cluster: {' '.join(str(error).split())}") from None
    return ray


def _require_answer(address: str) -> None:
    """Raise ConnectionError where nobody listens: Ray would try for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdigit()):  # auto, or a name that Ray makes something of
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER).close()
    except OSError as error:
        raise ConnectionError(f"no Ray cluster answers at {address} ({error}); `ray start --head` prints its address") from None


def _run(number: int, parcel: Parcel, board: Any) -> Done:
    """In a process of the cluster."""
    told = 0.0
    total = 0

    def tell(units: int) -> None:
        nonlocal told, total
        total += units
        if time.monotonic() - told > POLL:
            told = time.monotonic()
            board.note.remote(number, total)

    return parcel.run(tell)


def _value(ray: Any, reference: Any) -> Done:
    try:
        done: Done = ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    except ray.exceptions.RayError as error:
        raise OSError(f"the cluster lost a part of the work {RETRIES} times: {str(error).splitlines()[0]}") from None
    return done
