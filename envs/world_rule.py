"""A scenario as compiled code reads it: every step of ``world.py`` is given this one record."""

from __future__ import annotations

from dataclasses import dataclass

from tagtrack.envs.belief.filter import FilterRule, filter_rule
from tagtrack.envs.observation import SCALES, Scale
from tagtrack.envs.scenario import Reward, Scenario, Start
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.sim.motion import MotionRule
from tagtrack.envs.sim.receivers import ReceiverRule
from tagtrack.envs.sim.tags import Tag
from tagtrack.envs.sim.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class WorldRule:
    """What compiled code reads of a ``Scenario``."""

    time_step: float
    episode_steps: int
    speed_control: bool
    vehicle: Vehicle
    fish: MotionRule
    start: Start
    tag: Tag
    water: Water
    receiver: ReceiverRule
    belief: FilterRule
    reward: Reward
    scale: Scale


def world_rule(scenario: Scenario) -> WorldRule:
    return WorldRule(
        time_step=scenario.time_step,
        episode_steps=scenario.episode_steps,
        speed_control=scenario.speed_control,
        vehicle=scenario.vehicle,
        fish=scenario.fish.rule(scenario.time_step),
        start=scenario.start,
        tag=scenario.tag,
        water=scenario.water,
        receiver=scenario.receiver.rule(),
        belief=filter_rule(scenario.belief, scenario.time_step),
        reward=scenario.reward,
        scale=SCALES[scenario.receiver.kind],
    )
