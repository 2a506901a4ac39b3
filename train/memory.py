"""Does a run fit this machine, its seed and its steps? Asked before anything is made."""

from __future__ import annotations

import os

from tagtrack.envs.layout import action_names, features
from tagtrack.envs.scenario import Scenario
from tagtrack.eval.rollout import EPISODES_OF_A_RUN
from tagtrack.train.settings import PPOSettings, Settings

WORLD_BYTES = 1024  # of a world without its particles, and of what the step hands on: rounded up
NUMBER_BYTES = 4


def memory_of_run(scenario: Scenario, settings: Settings) -> int:
    """Memory of particles and of the steps kept for learning [B], a little below what is really taken."""
    belief = scenario.belief
    worlds = settings.num_envs * ((belief.rows * belief.particles + belief.carried) * NUMBER_BYTES + WORLD_BYTES)
    observed = len(features(scenario))
    acted = len(action_names(scenario))
    if isinstance(settings, PPOSettings):
        return worlds + settings.rollout * NUMBER_BYTES * (observed + acted + 6)
    return worlds + settings.buffer * NUMBER_BYTES * (2 * observed + acted + 3)


def require_size(scenario: Scenario, settings: Settings) -> None:
    """Raise ValueError for what this machine's memory cannot hold, for worlds that would swim into the next seed's episodes,
    and for fewer steps than worlds.
    """
    worlds, kept = settings.num_envs, "rollout" if isinstance(settings, PPOSettings) else "buffer"
    taken, there = memory_of_run(scenario, settings), _memory_of_machine()
    if there is not None and taken > there:
        raise ValueError(
            f"{worlds:,} worlds of {scenario.belief.particles:,} particles, and the steps they learn from, take "
            f"{taken / 1e9:,.0f} GB of memory, and this machine has {there / 1e9:,.0f} GB; "
            f"lower --num-envs, --particles or {kept}"
        )
    if worlds > EPISODES_OF_A_RUN:
        raise ValueError(
            f"--num-envs must be at most {EPISODES_OF_A_RUN}, got {worlds}: the next worlds are those of the next seed"
        )
    if settings.steps < worlds:
        raise ValueError(f"--steps must be at least {worlds}, one for each of {worlds} worlds (--num-envs), got {settings.steps}")


def _memory_of_machine() -> int | None:
    """All of it [B]; None where the operating system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
