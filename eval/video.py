"""`tagtrack eval video`: one episode of any policies, as a moving picture; `tagtrack eval watch`: the same in a window."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tagtrack.eval.options import TaskOptions
from tagtrack.eval.whole_number import WholeNumber

if TYPE_CHECKING:
    from tagtrack.envs.task import Task
    from tagtrack.eval.rollout import PolicyMaker

MOST_PANELS = 4


@dataclass(frozen=True, kw_only=True)
class Video:
    """Film one episode of some policies: the same fish, side by side, as an animated GIF.

    Vehicles are yellow, fish red, what the particle filter believes is blue.
    """

    task: TaskOptions = field(default_factory=TaskOptions)
    policies: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="POLICY ...", help_behavior_hint="(the paper's controller and learned)")
    ] = ()
    """One to four, as in `tagtrack eval benchmark`."""
    seed: WholeNumber = 0
    """Of the episode: number e of a benchmark with seed s is s + e."""
    frames: WholeNumber = 60
    """Pictures in all."""
    side: WholeNumber = 320
    """Of each panel [pixels]."""
    seconds: float = 8.0
    """Playing time."""
    trust: bool = False
    """Load models of Stable-Baselines3 (model.zip), which runs the code in them."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(runs/video-ID-TIME.gif)")] = None
    """File to write, .gif or .webp."""

    def run(self) -> None:
        """Run it."""
        from tagtrack.eval.film import FORMATS, film, save_film
        from tagtrack.eval.results_folder import default_folder, require_writable_file
        from tagtrack.eval.rollout import SeedBlock, block_seed

        if self.out is not None and self.out.suffix not in FORMATS:
            raise ValueError(f"--out must end in {' or '.join(FORMATS)}, got {self.out}")
        for name, least, most in (("frames", 2, 2000), ("side", 100, 2000)):
            if not least <= getattr(self, name) <= most:
                raise ValueError(f"--{name} must be from {least} to {most}, got {getattr(self, name)}")
        if not 0.1 <= self.seconds <= 3600:
            raise ValueError(f"--seconds must be from 0.1 to 3600, got {self.seconds:g}")
        require_writable_file(self.out)
        task = self.task.build()
        makers = steering(self.policies or default_pair(task), task, self.task.env_id, trust=self.trust)
        if len(makers) > MOST_PANELS:
            raise ValueError(f"--policies has room for {MOST_PANELS}, got {len(makers)}")
        frames = film(task, makers, seed=block_seed(SeedBlock.BENCHMARK, self.seed), frames=self.frames, side=self.side)
        folder = default_folder("video", self.task.env_id)
        path = self.out or folder.with_name(f"{folder.name}.gif")
        path.parent.mkdir(parents=True, exist_ok=True)
        save_film(path, frames, seconds=self.seconds)
        print(f"written: {path} ({len(frames)} pictures, {path.stat().st_size / 1000:.0f} kB)")


@dataclass(frozen=True, kw_only=True)
class Watch:
    """Watch a policy in a window, episode after episode, until it is closed."""

    task: TaskOptions = field(default_factory=TaskOptions)
    policy: Annotated[str, tyro.conf.arg(metavar="POLICY")] = "learned"
    """As in `tagtrack eval benchmark`."""
    seed: WholeNumber = 0
    """Of the first episode."""
    episodes: WholeNumber = 1000
    """At most so many."""
    trust: bool = False
    """Load a model of Stable-Baselines3 (model.zip), which runs the code in it."""

    def run(self) -> None:
        """Run it."""
        from tagtrack.envs.rendering import Picture
        from tagtrack.eval.film import play
        from tagtrack.eval.rollout import SeedBlock, block_seed

        task = self.task.build()
        (maker,) = steering((self.policy,), task, self.task.env_id, trust=self.trust).values()
        for episode in range(self.episodes):
            picture: Picture | None = None
            for simulation in play(task, maker, seed=block_seed(SeedBlock.BENCHMARK, self.seed + episode)):
                if picture is None:
                    picture = Picture(simulation)
                picture.follow()
                if not picture.show():
                    return


def steering(specs: tuple[str, ...], task: Task, env_id: str, *, trust: bool) -> dict[str, PolicyMaker]:
    """Policies that steer a vehicle, by name. Raises ValueError for moored receivers, which show no vehicle."""
    from tagtrack.eval.contestants import each_run, make_groups, name_groups
    from tagtrack.eval.rollout import Localizer

    makers: dict[str, PolicyMaker] = {}
    for name, maker in each_run(make_groups(name_groups(specs), task, env_id, trust=trust), all_runs=False).items():
        if isinstance(maker, Localizer):
            raise ValueError(f"{name} steers no vehicle: there is nothing to film")
        makers[name] = maker
    return makers


def default_pair(task: Task) -> tuple[str, ...]:
    """The paper's controller, and the policy that comes with the package where there is one for the task."""
    from tagtrack.eval.rivals import rivals_of
    from tagtrack.policies.box import LEARNED, boxed_policy

    first = rivals_of(task)[0]
    try:
        boxed_policy(task.env_id, vehicles=task.scenario.vehicles, tags=task.scenario.targets)
    except (ValueError, OSError):
        return (first,)
    return first, LEARNED
