"""`tagtrack eval headroom`: how much lower the error could still be, by what better moves in imagined futures gain.

At states of the policy's own episodes one vehicle holds each of a few first moves in many futures, and then goes on as the policy
would. The move that is best in one half of the futures is judged by the other half, so that luck is no gain. Summed over the
decisions of an episode that is the first-order gain in its mean error (the performance difference of Kakade & Langford 2002, with
the states that the policy itself comes to). Nobody sees the truth: see ``baselines.futures``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from tagtrack.baselines.futures import HELD, HORIZON, PARTICLES, Futures, better_move, mean_error, steps_of
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.comparison import describe_fleet
from tagtrack.eval.contestants import find_makers, name_contestants
from tagtrack.eval.options import EpisodeOptions, TaskOptions
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.report import as_console_table, fleet_note, interval_cell, show, write_json
from tagtrack.eval.results_folder import require_writable_file
from tagtrack.eval.rollout import Localizer, PolicyMaker, SeedBlock, block_seed
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.estimate import Interval
from tagtrack.eval.versions import collect_versions
from tagtrack.eval.whole_number import WholeNumber

MOST_FUTURES = 4096


@dataclass(frozen=True, kw_only=True)
class Left:
    """How much is left above a policy, of E episodes."""

    gain: np.ndarray  # (E,) by which better moves would lower the mean error [m], to first order
    error: np.ndarray  # (E,) the policy's mean error [m]

    def share(self) -> Interval:
        """The gain as a share of the mean error, drawn anew by episodes."""
        bootstrap = Bootstrap()
        episodes, counts = len(self.gain), bootstrap.counts(len(self.gain))
        replicates = (counts @ self.gain) / (counts @ self.error)
        return bootstrap.interval(bootstrap.estimate(self.gain.mean() / self.error.mean(), replicates, episodes=episodes))


@dataclass(frozen=True, kw_only=True)
class Headroom:
    """Estimate how much better than a policy one could steer: the gain of better single moves, in imagined futures.

    A first-order estimate: what several better moves gain together may be more or less. Courses straight to the tag and at 45 and
    90 degrees to that line are tried, for five pings, in futures of 25 pings.
    """

    task: TaskOptions = field(default_factory=TaskOptions)
    policy: Annotated[tuple[str, ...], tyro.conf.arg(name="policies", metavar="POLICY ...")] = ("circle",)
    """Baselines and folders of training runs."""
    trial: EpisodeOptions = field(default_factory=lambda: EpisodeOptions(episodes=128))
    decisions: WholeNumber = 2
    """Decisions of each episode at which moves are tried, at random times."""
    futures: WholeNumber = 256
    """Futures of each move; an even number."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """JSON file to write."""

    def run(self) -> None:
        """Run it."""
        self.trial.check()
        if self.decisions < 1:
            raise ValueError(f"--decisions must be at least 1, got {self.decisions}")
        if not 2 <= self.futures <= MOST_FUTURES or self.futures % 2:
            raise ValueError(f"--futures must be an even number from 2 to {MOST_FUTURES}, got {self.futures}")
        task = self.task.build()
        makers = find_makers(name_contestants(self.policy), task, self.task.env_id)
        require_writable_file(self.out)
        rows: dict[str, Left] = {}
        with progress_bar(len(makers) * self.trial.episodes * self.decisions, "states") as advance:
            for name, maker in makers.items():
                if isinstance(maker, Localizer):
                    raise ValueError(f"{name} steers no vehicle, which could move otherwise; name policies")
                rows[name] = look_ahead(
                    task,
                    maker,
                    episodes=self.trial.episodes,
                    decisions=self.decisions,
                    futures=self.futures,
                    seed=self.trial.seed,
                    threads=self.trial.threads,
                    on_state=partial(advance, name),
                )
        document = {
            **self.task.describe(task),
            "episodes": self.trial.episodes,
            "seed": self.trial.seed,
            "decisions": self.decisions,
            "futures": self.futures,
            "held_s": steps_of(task.scenario, HELD) * task.scenario.time_step,
            "horizon_s": steps_of(task.scenario, HORIZON) * task.scenario.time_step,
            "filters": min(PARTICLES, task.scenario.belief.particles),
            "fleet": describe_fleet(task.scenario),
            "versions": collect_versions(),
            "policies": {name: describe(left) for name, left in rows.items()},
        }
        print_headroom(document)
        if self.out is not None:
            write_json(self.out, document)
            print(f"written: {self.out}")


def look_ahead(
    task: Task,
    make_policy: PolicyMaker,
    *,
    episodes: int,
    decisions: int = 4,
    futures: int = 128,
    seed: int = 0,
    threads: int = 1,
    on_state: Callable[[int], None] | None = None,
) -> Left:
    """Play episodes of a policy and, at some decisions of each, what other moves of one vehicle would lead to.

    Args:
        episodes: E. decisions: of each episode at which moves are tried. futures: of each move.
        on_state: called with the number of states tried, for progress bars.
    """
    scenario = task.scenario
    held, horizon = steps_of(scenario, HELD), steps_of(scenario, HORIZON)
    moments = max(1, scenario.episode_steps // held)
    generator = np.random.default_rng(seed)
    tried = min(decisions, moments)
    # One moment of each of so many equal parts of an episode: nearly as the whole episode would be.
    bounds = np.linspace(0, moments, tried + 1)
    when = held * np.floor(generator.uniform(bounds[:-1], bounds[1:], (episodes, tried))).astype(np.int64)
    who = generator.integers(scenario.vehicles, size=(episodes, tried))
    simulation = Simulation(scenario, episodes, threads=threads, tracks=task.tracks)
    policy, memory = make_policy(simulation), None
    imagined = Futures(simulation, futures=futures, threads=threads, seed=seed + 1)
    imagined_policy = make_policy(imagined.simulation)
    simulation.reset(block_seed(SeedBlock.BENCHMARK, seed))
    gain, error = np.zeros((episodes, tried)), np.zeros(episodes)
    starts = np.ones(episodes * scenario.vehicles, bool)
    for step in range(scenario.episode_steps):
        for world, part in zip(*np.nonzero(when == step), strict=True):
            if not simulation.worlds.navigation["active"][world, who[world, part]]:
                continue  # it has left
            steps = min(horizon, scenario.episode_steps - step)
            cost = imagined.play(imagined_policy, memory, world, who[world, part], held=held, steps=steps)
            gain[world, part] = best_gain(cost)
            if on_state is not None:
                on_state(1)
        observation = simulation.observation.reshape(len(starts), -1)
        action, memory = policy.predict(observation, memory, starts, deterministic=True)
        starts = np.zeros(len(starts), bool)
        simulation.step(action.reshape(episodes, scenario.vehicles, -1))
        error += mean_error(simulation) / scenario.episode_steps
    imagined.close()
    simulation.close()
    per_episode = gain.mean(axis=1) * moments * scenario.vehicles / scenario.episode_steps
    return Left(gain=per_episode, error=error)


def best_gain(cost: np.ndarray) -> float:
    """What the best move saves against the first one, given what each costs (K, M): in the mean no more than it truly does.

    The best by one half of the futures is judged by the other half, and the other way round.
    """
    halves = cost[:, 0::2], cost[:, 1::2]
    moves = [(better_move(chooses), judges.mean(axis=1)) for chooses, judges in (halves, halves[::-1])]
    return float(np.mean([judged[0] - judged[move] for move, judged in moves]))


def describe(left: Left) -> dict[str, Any]:
    """A policy's figures as JSON has them."""
    bootstrap = Bootstrap()
    return {
        "mean_error_m": bootstrap.mean(left.error).to_json(),
        "gain_m": bootstrap.mean(left.gain).to_json(),
        "left": left.share().to_json(),
    }


def print_headroom(document: Mapping[str, Any]) -> None:
    """A table: error, gain and share left of each policy."""
    header = ["policy", "mean error [m]", "gain [m]", "left [%]"]
    rows = [
        [name, interval_cell(row["mean_error_m"]), interval_cell(row["gain_m"]), interval_cell(row["left"], 100)]
        for name, row in document["policies"].items()
    ]
    note = (
        f"{document['episodes']} episodes of {document['env']}, seed {document['seed']}, {document['particles']} particles, "
        f"{document['decisions']} decisions of each, {document['futures']} futures of {document['horizon_s']:g} s for each move, "
        f"held {document['held_s']:g} s, with filters of {document['filters']} particles; in brackets 95 % bootstrap intervals "
        "over episodes. Left is by how much better single moves would lower the mean error, to first order; with few futures the "
        f"best move is often missed, and it comes out too low.{fleet_note(document['fleet']) if document['fleet'] else ''}"
    )
    show(as_console_table(header, rows, note))
