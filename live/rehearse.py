"""`tagtrack live rehearse`: whole missions over loopback, beside the environment's own episodes."""

from __future__ import annotations

import argparse
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tagtrack.envs.task import Task
from tagtrack.live.helm import Helm, Orders
from tagtrack.live.journal import JOURNAL_FILE, Journal
from tagtrack.live.simulate import ORIGIN, Port, Sea, Terminal, Theatre, check_play
from tagtrack.live.sources import open_source
from tagtrack.live.steer import Loop, make_clock, make_orders, make_receiver, make_vehicle
from tagtrack.live.vehicles import Order

SILENT: dict[str, Any] = {
    "filter": None, "origin": None, "box": None, "safe": "hold", "home": None, "depth": 0.0, "late": 60.0, "stale": 1e9,
}  # fmt: skip


class Observed(Helm):
    """A helm that remembers what it believed at each fix."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.believed: list[tuple[float, np.ndarray]] = []  # time [s], (T, 2) [m]
        self.seconds: list[float] = []  # from each fix to its order

    def steer(self, line: bytes, now: float) -> Order | None:
        fixes, begun = self.fixes, time.perf_counter()
        order = super().steer(line, now)
        self.seconds.append(time.perf_counter() - begun)
        if self.fixes > fixes and self.tracker is not None:
            self.believed.append((self._last_time, self.tracker.believer.estimate[0, 0].copy()))
        return order


def rehearse(
    env: str,
    *,
    policy: str,
    receiver: str,
    vehicle: str,
    seed: int,
    port: int,
    overrides: tuple[str, ...] = (),
    particles: int | None = None,
    speed: float = 0.0,
    latency: float = 0.0,
    loss: float = 0.0,
    pty: bool = False,
    mathematical: bool = False,
    steps: int | None = None,
) -> tuple[np.ndarray, Observed]:
    """One mission over TCP (or a pseudo-terminal): (K,) mean error of each step [m], and the helm as it was at the end."""
    ears, link = make_receiver(receiver), make_vehicle(vehicle)
    asked = {
        **SILENT, "env": env, "particles": particles, "set": [list(overrides)] if overrides else [], "seed": seed,
        "policy": policy, "speed": speed, "headings": "mathematical" if mathematical else None,
        "stamp": "receiver", "tags": ["1285"],
    }  # fmt: skip
    orders: Orders = make_orders(asked, in_degrees=link.in_degrees, mathematical_allowed=vehicle == "json")
    tags = [str(1285 + tag) for tag in range(orders.task.scenario.targets)]
    if link.in_degrees:
        asked["origin"] = ORIGIN
    orders = make_orders({**asked, "tags": tags}, in_degrees=link.in_degrees, mathematical_allowed=vehicle == "json")
    sea = Sea(orders.task, seed, make_receiver(receiver), make_vehicle(vehicle), mathematical=mathematical)
    water: Port | Terminal = Terminal() if pty else Port(port + 1)
    hydrophone = Port(port)
    helm = Observed(orders, ears, link)
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / JOURNAL_FILE, fresh=True)
        sources = open_source(hydrophone.spec), open_source(water.spec)
        loop = Loop(helm, journal, *sources, clock=make_clock(speed), speed=speed, tell=False)
        thread = threading.Thread(target=loop.run, args=(None,), daemon=True)
        thread.start()
        theatre = Theatre(sea, hydrophone, water, speed=speed, latency=latency, loss=loss, seed=seed)
        try:
            theatre.play(steps or orders.task.scenario.episode_steps, wait=20.0)
        finally:
            loop.stop()
            thread.join(10.0)
            for each in (*sources, hydrophone, water, journal):
                each.close()
    return errors_of(helm, sea, theatre.epoch), helm


def errors_of(helm: Observed, sea: Sea, epoch: float) -> np.ndarray:
    """Mean error over tags [m] at the end of each step, of what was believed at the last fix by then."""
    fish = np.array(sea.report()["fish"]).reshape(-1, len(sea.tags), 2)[1:]
    ends = epoch + sea.task.scenario.time_step * np.arange(1, len(fish) + 1)
    if not helm.believed:
        raise RuntimeError(f"no fix came through: {dict(helm.dropped)}")
    times = np.array([at for at, _ in helm.believed])
    believed = np.array([places for _, places in helm.believed])
    last = np.maximum(np.searchsorted(times, ends + 0.5 * sea.task.scenario.time_step, side="right") - 1, 0)
    return np.linalg.norm(believed[last] - fish, axis=-1).mean(axis=1)


def own_errors(task: Task, policy: str, *, episodes: int, seed: int, steps: int | None = None) -> np.ndarray:
    """(E, K) errors [m] of the environment's own episodes."""
    from tagtrack.eval.contestants import find_makers
    from tagtrack.eval.rollout import roll_out

    maker = find_makers({policy: policy}, task, task.env_id)[policy]
    return roll_out(task, maker, episodes=episodes, seed=seed).error[:, :steps]


def run(options: argparse.Namespace) -> None:
    """The command."""
    from tagtrack.envs.task import build_task, parse_overrides
    from tagtrack.eval.statistics.bootstrap import Bootstrap

    overrides = tuple(text for group in options.set for text in group)
    task = build_task(options.env, overrides=parse_overrides(list(overrides), None), particles=options.particles)
    check_play(options, task)
    own = own_errors(task, options.policy, episodes=options.episodes, seed=options.seed).mean(axis=1)
    played = np.empty(options.episodes)
    tell = progress(options.episodes)
    seconds: list[float] = []
    for episode in range(options.episodes):
        error, helm = rehearse(
            options.env, policy=options.policy, receiver=options.receiver, vehicle=options.vehicle,
            seed=options.seed + episode, port=options.port + 2 * (episode % 500), overrides=overrides,
            particles=options.particles, speed=options.speed, latency=options.latency, loss=options.loss, pty=options.pty,
        )  # fmt: skip
        played[episode] = error.mean()
        seconds += helm.seconds
        tell()
    bootstrap = Bootstrap()
    ratio = bootstrap.interval(bootstrap.ratio_estimate(played, own))
    print(
        f"{task.env_id} by {options.receiver} and {options.vehicle}, {options.policy}, {options.episodes} episodes: mean error "
        f"{played.mean():.3f} m, the environment's own {own.mean():.3f} m, "
        f"ratio {ratio.value:.3f} [{ratio.low:.3f}, {ratio.high:.3f}]"
    )
    median, most = 1e3 * np.quantile(seconds, (0.5, 0.99))
    print(f"from a line of navigation to its order: median {median:.2f} ms, 99 % within {most:.2f} ms")


def progress(total: int) -> Callable[[], Any]:
    """A bar on terminals."""
    from tqdm import tqdm

    bar = tqdm(total=total, unit=" episodes", disable=None, leave=False)
    return bar.update
