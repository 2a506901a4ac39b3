"""Several policies on the same episodes: the arrays of each, their figures, and how they stand to the first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tagtrack.envs.overrides import with_overrides
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.task import Task, build_task, full_id
from tagtrack.eval.cells.engine import Advance, Engine
from tagtrack.eval.contestants import PolicySpec, find_makers, name_groups
from tagtrack.eval.episode_record import EpisodeRecord, pool
from tagtrack.eval.episodes import Episodes
from tagtrack.eval.fleet_metrics import summarize_fleet
from tagtrack.eval.metrics import Metric, Runs, compare_runs, measure, summarize, summarize_runs
from tagtrack.eval.report import Document, benchmark_document
from tagtrack.eval.rollout import SeedBlock, block_seed, cells_of, cluster_episodes, join_parts
from tagtrack.eval.statistics.bootstrap import Bootstrap
from tagtrack.eval.statistics.clusters import Clusters
from tagtrack.eval.statistics.comparisons import holm
from tagtrack.eval.statistics.estimate import Interval

Named = Mapping[str, PolicySpec | Mapping[str, PolicySpec]]  # policies by name; of a training, runs by theirs


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What ``compare`` gives back; policies in the order in which they were named."""

    env: str
    task: Task
    seed: int
    from_step: int  # first of an episode that counts
    runs: Mapping[str, Mapping[str, EpisodeRecord]]  # of each policy that is a training: its runs by name
    records: Mapping[str, EpisodeRecord]  # error and range, each (E, K) [m], from that step on; of a training all runs' steps
    summaries: Mapping[str, Mapping[str, Interval]]  # figures of ``metrics.summarize``
    comparisons: Mapping[str, Mapping[str, Any]]  # keyed FIRST/NAME: ``metrics.compare_runs``, and ``p_holm``
    clusters: Clusters | None  # episodes that swim the same stretch of a recorded track
    notes: tuple[str, ...]  # what contestants that are no policies say of themselves

    @property
    def episodes(self) -> int:
        """E."""
        return next(iter(self.records.values())).episodes

    @property
    def ratios(self) -> dict[str, Interval]:
        """Mean error of the first policy over that of another one, keyed FIRST/NAME: above 1, NAME is better."""
        return {pair: found["ratio"] for pair, found in self.comparisons.items()}

    def mean_errors(self) -> dict[str, np.ndarray]:
        """By policy, each episode's mean error (E,) [m]; episode e met the same fish in all of them."""
        return {name: record.error.mean(axis=1) for name, record in self.records.items()}

    def each_run(self, name: str) -> Runs:
        """The records of a policy's runs, or its own."""
        return list(self.runs[name].values()) if name in self.runs else [self.records[name]]

    def document(self, versions: Mapping[str, str]) -> Document:
        """The layout of benchmark.json."""
        first = next(iter(self.records))
        firsts = np.mean([run.error.mean() for run in self.each_run(first)])
        return benchmark_document(
            env=self.env,
            episodes=self.episodes,
            seed=self.seed,
            from_step=self.from_step,
            groups={
                name: {
                    run: {"mean_error_m": float(record.error.mean()), "ratio": float(firsts / record.error.mean())}
                    for run, record in runs.items()
                }
                for name, runs in self.runs.items()
            },
            particles=self.task.scenario.belief.particles,
            tracks=self.task.describe_tracks(),
            clusters=self.clusters,
            fleet=describe_fleet(self.task.scenario),
            notes=self.notes,
            versions=versions,
            policies=self.summaries,
            comparisons=self.comparisons,
        )


def compare(
    env: str | Task,
    policies: Named | Sequence[str],
    *,
    episodes: int = 512,
    seed: int = 0,
    particles: int | None = None,
    block: SeedBlock = SeedBlock.BENCHMARK,
    threads: int = 1,
    batch: int = 128,
    from_step: int = 0,
    perimeter: float | None = None,
    metrics: Mapping[str, Metric] | None = None,
    bootstrap: Bootstrap | None = None,
    env_id: str = "custom",
    engine: Engine | None = None,
    on_step: Advance | None = None,
) -> Comparison:
    """Run policies over the same episodes and set them side by side.

    All policies are made, and so checked, before the first one runs.

    Args:
        env: an environment's id, or a ``Task`` (``tagtrack.envs.task.build_task``).
        policies: by name, a baseline's spec (``"circle:40"``), a folder with a saved policy, a policy (anything with the
            ``predict`` of Stable-Baselines3), a function that makes one for a ``Simulation``, moored receivers
            (``"static_array:200"``) or another ``Localizer``; or a mapping of such things, the runs of one training, which are
            one row together. Of specs and folders a sequence will do: they go by the names that ``name_groups`` gives them
            (``"learned=runs/seed0,runs/seed1"``).
        episodes: E. seed: of the first episode within its ``block``.
        threads, batch, engine: change the speed, not the results. A batch of a policy's episodes is a part of the work; the
            engine runs the parts here, in other processes, or on a cluster (``tagtrack.eval.Engine``).
        particles: of the belief, instead of the task's.
        from_step: what comes before it is left out of all figures.
        perimeter: for ``inside_perimeter`` [m]; None: the scenario's, if it has one.
        metrics: further figures by name, each a function of an ``EpisodeRecord`` that gives one number (E,) for each episode.
        env_id: what a ``Task`` is called in the result.
        on_step: called with the policy's name and the number of env steps just done, for progress bars.
    Raises:
        ValueError: for a ``from_step`` outside the episode, a group without runs, a metric of another shape.
        ValueError, FileNotFoundError: as ``find_makers`` does. What ``Engine.run`` raises.
    """
    task, env_id = (build_task(env), full_id(env)) if isinstance(env, str) else (env, env_id)
    if particles is not None:
        task = task._replace(scenario=with_overrides(task.scenario, {"belief.particles": particles}))
    named: Named = policies if policies and isinstance(policies, Mapping) else name_groups(list(policies))
    if not 0 <= from_step < task.scenario.episode_steps:
        raise ValueError(f"from_step must be from 0 to {task.scenario.episode_steps - 1}, got {from_step}")
    runs = {name: _runs_of(name, spec) for name, spec in named.items()}
    makers = find_makers({(name, run): spec for name, each in runs.items() for run, spec in each.items()}, task, env_id)
    first = block_seed(block, seed)
    _try_metrics(metrics or {}, episodes)
    found: dict[str, dict[str, EpisodeRecord]] = {name: {} for name in runs}
    cells = {
        (name, run): cells_of(run or name, task, maker, episodes=episodes, seed=first, threads=threads, batch=batch)
        for (name, run), maker in makers.items()
    }
    done = (engine or Engine()).run([cell for parts in cells.values() for cell in parts], on_step)
    for (name, run), whole in join_parts(cells, done).items():
        found[name][run] = whole.from_step(from_step)
    clusters = cluster_episodes(task, Episodes(count=episodes, seed=first, batch=batch))
    bootstrap = replace(bootstrap or Bootstrap(), clusters=clusters)
    if perimeter is None:
        perimeter = task.scenario.reward.perimeter or math.nan
    figures = {"perimeter": perimeter, "lost_error": task.scenario.lost_error, "metrics": metrics, "bootstrap": bootstrap}
    return Comparison(
        env=env_id,
        task=task,
        seed=seed,
        from_step=from_step,
        runs={name: records for name, records in found.items() if isinstance(named[name], Mapping)},
        records={name: pool(list(each.values())) if len(each) > 1 else each[next(iter(each))] for name, each in found.items()},
        summaries={name: _summarize(list(each.values()), **figures) for name, each in found.items()},
        comparisons=_compare_to_first({name: list(each.values()) for name, each in found.items()}, bootstrap),
        clusters=clusters,
        notes=tuple(dict.fromkeys(note for maker in makers.values() if (note := getattr(maker, "note", None)))),
    )


def _runs_of(name: str, spec: PolicySpec | Mapping[str, PolicySpec]) -> Mapping[str, PolicySpec]:
    """A policy as its only run, which has no name; a training's runs."""
    if not isinstance(spec, Mapping):
        return {"": spec}
    if not spec:
        raise ValueError(f"the group {name!r} has no run; name its folders")
    return spec


def _try_metrics(metrics: Mapping[str, Metric], episodes: int) -> None:
    """Find out before anything runs whether metrics give numbers of the right shape."""
    for name, metric in metrics.items():
        measure(name, metric, EpisodeRecord(error=np.ones((episodes, 3)), range=np.ones((episodes, 3))))


def _summarize(records: Runs, **figures: Any) -> dict[str, Interval]:
    found = summarize(records[0], **figures) if len(records) == 1 else summarize_runs(records, **figures)
    fleets = [record.fleet for record in records if record.fleet is not None]
    if fleets:
        found |= summarize_fleet(fleets, lost_error=figures["lost_error"], bootstrap=figures["bootstrap"])
    return found


def _compare_to_first(records: Mapping[str, Runs], bootstrap: Bootstrap) -> dict[str, dict[str, Any]]:
    """How each policy stands to the first one, its p-value corrected for the number of comparisons."""
    first, *others = records
    found: dict[str, dict[str, Any]] = {
        f"{first}/{name}": dict(compare_runs(records[first], records[name], bootstrap)) for name in others
    }
    for each, corrected in zip(found.values(), holm([each["p"] for each in found.values()]), strict=True):
        each["p_holm"] = float(corrected)
    return found


def describe_fleet(scenario: Scenario) -> dict[str, Any] | None:
    """Numbers of vehicles and tags and the kind of modem, as plain values for JSON; None for one vehicle and one tag."""
    if scenario.vehicles == scenario.targets == 1:
        return None
    modem = scenario.modem.name or type(scenario.modem).__name__
    return {"vehicles": scenario.vehicles, "tags": scenario.targets, "modem": modem}


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
