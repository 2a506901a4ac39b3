"""What the commands of ``tagtrack eval`` have in common: which task, how many episodes, which seeds.

The help of a command must not wait for numba: methods import what builds a task.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from tagtrack.eval.whole_number import OptionalWholeNumber, WholeNumber

if TYPE_CHECKING:
    from tagtrack.envs.task import Task


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """Which task."""

    env: Annotated[str, tyro.conf.arg(metavar="ID")] = "TagTrack/LeopardShark-v0"
    """Environment id, with or without `TagTrack/`."""
    preset: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(none)")] = None
    """Other settings: surf_zone of LeopardShark-v0; masmitja2023, utracking_medium, utracking_hard of RangeOnly-v0."""
    overrides: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.arg(name="set", metavar="NAME=VALUE ..."),
        tyro.conf.UseAppendAction,
    ] = ()
    """Parameters of the scenario by their dotted names, as water.noisy_share=0.3 belief=levy; a wrong name lists others."""
    tracks: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(none)")] = None
    """csv file (t_unix_s,x,y; of several animals with a column tag) of recorded tracks for the fish to swim."""
    time_scale: Annotated[float | None, tyro.conf.arg(metavar="X", help_behavior_hint="(1)")] = None
    """How fast it swims its track: 0.5 is half the recorded speed."""
    motion: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(the task's own)")] = None
    """How the fish moves instead: momentum, brownian, levy or boat (as --set fish=levy); not with --tracks."""
    particles: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(the scenario's or preset's own)")] = None
    """Particles of the belief."""

    vehicles: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(the task's own, 1)")] = None
    """Vehicles of the fleet, at most 20."""
    tags: Annotated[OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(the task's own, 1)")] = None
    """Tagged fish, at most 20."""
    modem: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(the task's own, perfect)")] = None
    """What the vehicles may tell one another: perfect (one belief for all), none (one each), instant (all told at once), tdma
    (packets in turn)."""

    least_particles: ClassVar[int] = 0  # without --particles

    def build(self) -> Task:
        """The task. Raises ValueError or FileNotFoundError with one line on what is wrong."""
        from tagtrack.envs.overrides import with_overrides
        from tagtrack.envs.task import build_task

        task = build_task(self.env, **self.make_options())
        if self.particles is None and task.scenario.belief.particles < self.least_particles:
            task = task._replace(scenario=with_overrides(task.scenario, {"belief.particles": self.least_particles}))
        return task

    @property
    def env_id(self) -> str:
        """The id with its namespace."""
        from tagtrack.envs.task import full_id

        return full_id(self.env)

    def make_options(self) -> dict[str, Any]:
        """The keyword arguments of ``gymnasium.make``."""
        from tagtrack.envs.task import parse_overrides

        overrides = parse_overrides([text for group in self.overrides for text in group], self.motion)
        if "belief.particles" in overrides:
            raise ValueError("the number of particles is set by --particles, not by --set belief.particles")
        return {
            "preset": self.preset,
            "particles": self.particles,
            "tracks": self.tracks,
            "time_scale": self.time_scale,
            "overrides": overrides,
            "vehicles": self.vehicles,
            "tags": self.tags,
            "modem": self.modem,
        }

    def describe(self, task: Task) -> dict[str, Any]:
        """The choices as JSON has them, with the number of particles of the ``task`` built."""
        return {"env": self.env_id, **self.make_options(), "particles": task.scenario.belief.particles}


@dataclass(frozen=True, kw_only=True)
class ManyParticles(TaskOptions):
    """Which task, its belief with many particles."""

    particles: Annotated[
        OptionalWholeNumber, tyro.conf.arg(help_behavior_hint="(4000, or the scenario's or preset's own if more)")
    ] = None
    """Particles of the belief."""

    least_particles: ClassVar[int] = 4000


@dataclass(frozen=True, kw_only=True)
class EpisodeOptions:
    """Which episodes."""

    episodes: WholeNumber = 512
    """Number of episodes; the same ones for every policy."""
    seed: WholeNumber = 0
    """Of the first episode; the others follow. The same number gives other fish to benchmark, tune and train."""
    threads: WholeNumber = 1
    """Threads of the simulation; results do not depend on them."""

    def check(self) -> None:
        """Raise ValueError for a number out of range (not when made, for tyro would frame the message)."""
        for name in ("episodes", "threads"):
            if getattr(self, name) < 1:
                raise ValueError(f"--{name} must be at least 1, got {getattr(self, name)}")
        if not 0 <= self.seed < 2**31:
            raise ValueError(f"--seed must be from 0 to {2**31 - 1}, got {self.seed}")
