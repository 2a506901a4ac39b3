"""Several policies on the same episodes: the arrays of each, their figures, and their ratios to the first."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.task import Task, build_task, full_id
from tagtrack.eval.contestants import PolicySpec, find_makers, name_contestants
from tagtrack.eval.episode_record import EpisodeRecord, pool
from tagtrack.eval.fleet_metrics import summarize_fleet
from tagtrack.eval.metrics import Bootstrap, Interval, ratios_to_first, summarize
from tagtrack.eval.report import Document, benchmark_document
from tagtrack.eval.rollout import SeedBlock, block_seed, roll_out

OnStep = Callable[[str, int], None]  # name of the policy, env steps just done


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What ``compare`` gives back; policies in the order in which they were named."""

    env: str
    task: Task
    seed: int
    from_step: int  # first of an episode that counts
    together: tuple[str, ...]  # names of policies that have one more row as one
    records: Mapping[str, EpisodeRecord]  # error and range, each (E, K) [m], from that step on
    summaries: Mapping[str, Mapping[str, Interval]]  # figures of ``metrics.summarize``
    ratios: Mapping[str, Interval]  # keyed FIRST/NAME: above 1, NAME is better

    @property
    def episodes(self) -> int:
        """E."""
        return next(iter(self.records.values())).episodes

    def mean_errors(self) -> dict[str, np.ndarray]:
        """By policy, each episode's mean error (E,) [m]; episode e met the same fish in all of them."""
        return {name: record.error.mean(axis=1) for name, record in self.records.items()}

    def document(self, versions: Mapping[str, str]) -> Document:
        """The layout of benchmark.json."""
        return benchmark_document(
            env=self.env,
            episodes=self.episodes,
            seed=self.seed,
            from_step=self.from_step,
            together=self.together,
            particles=self.task.scenario.belief.particles,
            tracks=self.task.describe_tracks(),
            fleet=describe_fleet(self.task.scenario),
            versions=versions,
            policies=self.summaries,
            ratios=self.ratios,
        )


def compare(
    env: str | Task,
    policies: Mapping[str, PolicySpec] | Sequence[str],
    *,
    episodes: int = 512,
    seed: int = 0,
    particles: int | None = None,
    block: SeedBlock = SeedBlock.BENCHMARK,
    threads: int = 1,
    batch: int = 128,
    from_step: int = 0,
    together: Sequence[str] = (),
    perimeter: float | None = None,
    bootstrap: Bootstrap | None = None,
    env_id: str = "custom",
    on_step: OnStep | None = None,
) -> Comparison:
    """Run policies over the same episodes and set them side by side.

    All policies are made, and so checked, before the first one runs.

    Args:
        env: an environment's id, or a ``Task`` (``tagtrack.envs.task.build_task``).
        policies: by name, a baseline's spec (``"circle:40"``), a folder with a saved policy, a policy (anything with the
            ``predict`` of Stable-Baselines3), a function that makes one for a ``Simulation``, moored receivers
            (``"static_array:200"``) or another ``Localizer``. Of specs and folders a sequence will do: they go by the names
            that ``name_contestants`` gives them.
        episodes: E. seed: of the first episode within its ``block``. threads, batch: change the speed, not the results.
        particles: of the belief, instead of the task's.
        from_step: what comes before it is left out of all figures.
        together: names of policies, as of one training's seeds, that get one more row as one: each episode counts with the steps
            of all of them. It is called "5 runs", if there are five.
        perimeter: for ``inside_perimeter`` [m]; None: the scenario's, if it has one.
        env_id: what a ``Task`` is called in the result.
        on_step: called with the policy's name and the number of env steps just done, for progress bars.
    Raises:
        ValueError: for a ``from_step`` outside the episode or names ``together`` that no policy, or one too many, goes by.
        ValueError, FileNotFoundError: as ``find_makers`` does.
    """
    task, env_id = (build_task(env), full_id(env)) if isinstance(env, str) else (env, env_id)
    if particles is not None:
        task = task._replace(scenario=with_overrides(task.scenario, {"belief.particles": particles}))
    named = policies if policies and isinstance(policies, Mapping) else name_contestants(list(policies))
    if not 0 <= from_step < task.scenario.episode_steps:
        raise ValueError(f"from_step must be from 0 to {task.scenario.episode_steps - 1}, got {from_step}")
    if strange := [name for name in together if name not in named]:
        raise ValueError(f"{strange[0]!r} cannot be taken together with others: the policies are {', '.join(named)}")
    as_one = f"{len(together)} runs"
    if together and as_one in named:
        raise ValueError(f"a policy goes by the name of the row of all together, {as_one!r}; rename its folder")
    makers = find_makers(named, task, env_id)
    records = {}
    for name, maker in makers.items():
        tell = None if on_step is None else _bind(on_step, name)
        whole = roll_out(
            task, maker, episodes=episodes, seed=block_seed(block, seed), threads=threads, batch=batch, on_step=tell
        )
        records[name] = whole.from_step(from_step)
    if together:
        records[as_one] = pool([records[name] for name in together])
    if perimeter is None:
        perimeter = task.scenario.reward.perimeter or math.nan
    return Comparison(
        env=env_id,
        task=task,
        seed=seed,
        from_step=from_step,
        together=tuple(together),
        records=records,
        summaries={
            name: _summarize(record, perimeter, task.scenario.lost_error, bootstrap) for name, record in records.items()
        },
        ratios=ratios_to_first(records, bootstrap=bootstrap),
    )


def _summarize(record: EpisodeRecord, perimeter: float, lost_error: float, bootstrap: Bootstrap | None) -> dict[str, Interval]:
    figures = summarize(record, perimeter=perimeter, lost_error=lost_error, bootstrap=bootstrap)
    if record.fleet is not None:
        figures |= summarize_fleet(record.fleet, lost_error=lost_error, bootstrap=bootstrap)
    return figures


def describe_fleet(scenario: Scenario) -> dict[str, Any] | None:
    """Numbers of vehicles and tags and the kind of modem, as plain values for JSON; None for one vehicle and one tag."""
    if scenario.vehicles == scenario.targets == 1:
        return None
    modem = scenario.modem.name or type(scenario.modem).__name__
    return {"vehicles": scenario.vehicles, "tags": scenario.targets, "modem": modem}


def _bind(on_step: OnStep, name: str) -> Callable[[int], None]:
    return lambda steps: on_step(name, steps)


def typical_episodes(comparison: Comparison) -> dict[str, int]:
    """Two episodes worth a picture: the ``median`` one and a ``hard`` one (with 8 episodes and more, at 95 %).

    Episodes are ranked by the geometric mean of all policies' mean errors, so that a policy with large errors has no
    larger say.
    """
    errors = np.array(list(comparison.mean_errors().values()))
    order = np.argsort(np.log(np.maximum(errors, 1e-3)).mean(axis=0), kind="stable")
    places = {"median": (order.size - 1) // 2}
    if order.size >= 8:
        places["hard"] = int(0.95 * (order.size - 1))
    return {name: int(order[place]) for name, place in places.items()}
