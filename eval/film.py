"""A film of one episode: the same fish under several policies, side by side, to one scale."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tagtrack.envs.legend import BELIEF, FAINT, FAN, FISH, GRID, INK, LAST_BELIEF, MESSAGE, PAPER, VEHICLE, WATER
from tagtrack.envs.rendering import MAP, Picture
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.task import Task
from tagtrack.eval.progress import progress_bar
from tagtrack.eval.rollout import PolicyMaker
from tagtrack.policies.files import replace_file

if TYPE_CHECKING:
    from PIL.Image import Image

HEADER = 40  # above each panel [pixels]
GAP = 6  # between panels
FORMATS = (".gif", ".webp")


def play(task: Task, maker: PolicyMaker, *, seed: int) -> Iterator[Simulation]:
    """One episode of a policy: its simulation after the reset and after each step, the same object each time."""
    simulation = Simulation(task.scenario, tracks=task.tracks)
    fleet, components = task.scenario.vehicles, len(simulation.action_names)
    observation, state = simulation.reset(seed), None
    policy = maker(simulation)
    yield simulation
    for step in range(task.scenario.episode_steps):
        starts = np.full(fleet, step == 0)
        action, state = policy.predict(observation.reshape(fleet, -1), state, starts, deterministic=True)
        simulation.step(np.reshape(action, (1, fleet, components)))
        observation = simulation.observation
        yield simulation
    simulation.close()


def film(task: Task, makers: Mapping[str, PolicyMaker], *, seed: int, frames: int = 60, side: int = 320) -> list[Image]:
    """The frames of an episode.

    Args:
        makers: by name. seed: of the world (``block_seed``). frames: at most so many, evenly in time, the last one the end.
        side: of each policy's panel [pixels].
    Raises:
        ImportError: without pygame-ce (extra ``render``).
    """
    steps = task.scenario.episode_steps
    shown = np.unique(np.linspace(0, steps, min(frames, steps + 1)).round().astype(int))
    with progress_bar(2 * len(makers) * steps) as advance:
        low, high = _bounds(task, makers, seed, advance)
        panels = [_panels(task, name, maker, seed, shown, side, (low, high), advance) for name, maker in makers.items()]
    return [_beside(list(each)) for each in zip(*panels, strict=True)]


def save_film(path: Path, frames: list[Image], *, seconds: float = 8.0) -> None:
    """Write an animated GIF or WebP that goes on for ever, whole or not at all; its last frame stays a little longer."""
    from PIL import Image

    palette = _palette()
    if path.suffix == ".gif":
        frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    each = round(1000 * seconds / len(frames))
    with replace_file(path) as temporary:
        frames[0].save(
            temporary,
            format=path.suffix[1:].upper(),
            save_all=True,
            append_images=frames[1:],
            duration=[*[each] * (len(frames) - 1), 2000],
            loop=0,
            optimize=True,
        )


def _palette() -> Image:
    """The picture's colours and what they fade to on water: few, so that files stay small, and none that an average swallows."""
    from PIL import Image

    drawn = (WATER, (VEHICLE, FISH, BELIEF, LAST_BELIEF, INK, MESSAGE)), (PAPER, (INK, FAINT)), (FAN, (BELIEF,))
    faded = [
        tuple(round(share * ink + (1 - share) * paper) for ink, paper in zip(colour, ground, strict=True))
        for ground, colours in drawn
        for colour in colours
        for share in (0.25, 0.5, 0.75, 1.0)
    ]
    colours = [PAPER, WATER, GRID, FAN, tuple((a + b) // 2 for a, b in zip(WATER, FAN, strict=True)), *faded]
    palette = Image.new("P", (1, 1))
    palette.putpalette([part for colour in colours for part in colour])
    return palette


def _bounds(task: Task, makers: Mapping[str, PolicyMaker], seed: int, advance: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners (2,) [m] of what holds all vehicles and fish of the episode under every policy."""
    places = []
    for name, maker in makers.items():
        for simulation in play(task, maker, seed=seed):
            places += [simulation.vehicle_position[0].copy(), simulation.fish_position[0].copy()]
            advance(name, 1)
    found = np.concatenate(places)
    return found.min(axis=0), found.max(axis=0)


def _panels(
    task: Task, name: str, maker: PolicyMaker, seed: int, shown: np.ndarray, side: int, view: tuple[np.ndarray, ...], advance: Any
) -> list[Image]:
    """One policy's panels at the steps ``shown``."""
    from PIL import Image

    found, errors = [], []
    picture: Picture | None = None
    for step, simulation in enumerate(play(task, maker, seed=seed)):
        if picture is None:
            picture = Picture(simulation)
            picture.hold_view(*view)
        picture.follow()
        errors.append(float(simulation.error[0].mean()))
        if step in shown:
            map_alone = Image.fromarray(picture.paint()[:, :MAP]).resize((side, side), Image.Resampling.LANCZOS)
            found.append(_headed(map_alone, name, errors, step * task.scenario.time_step))
        advance(name, 1)
    return found


def _headed(picture: Image, name: str, errors: list[float], seconds: float) -> Image:
    """A map under the policy's name, the mean error so far and the time."""
    from PIL import Image, ImageDraw, ImageFont

    whole = Image.new("RGB", (picture.width, picture.height + HEADER), PAPER)
    whole.paste(picture, (0, HEADER))
    draw, bold, plain = ImageDraw.Draw(whole), ImageFont.load_default(size=15), ImageFont.load_default(size=12)
    draw.text((6, 3), _shortened(draw, name, bold, picture.width - 12), INK, font=bold)
    steps = errors[1:] or errors
    draw.text((6, 22), f"error {errors[-1]:.3g} m, mean {sum(steps) / len(steps):.3g} m", FAINT, font=plain)
    clock = f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
    draw.text((picture.width - 6, 22), clock, FAINT, font=plain, anchor="ra")
    return whole


def _shortened(draw: Any, name: str, font: Any, width: int) -> str:
    kept = name
    while draw.textlength(kept, font=font) > width:
        kept = kept.rstrip(".")[:-1] + "..."
    return kept


def _beside(panels: list[Image]) -> Image:
    """Panels of one size in a row."""
    from PIL import Image

    width, height = panels[0].size
    whole = Image.new("RGB", (len(panels) * (width + GAP) - GAP, height), PAPER)
    for place, panel in enumerate(panels):
        whole.paste(panel, (place * (width + GAP), 0))
    return whole
