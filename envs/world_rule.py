"""A scenario as compiled code reads it: every step of ``world.py`` is given this one record."""

from __future__ import annotations

from dataclasses import dataclass

from tagtrack.envs.belief.assumptions import FilterRule, filter_rule
from tagtrack.envs.feature import Scale
from tagtrack.envs.kernels.calling import ROW, address_of
from tagtrack.envs.layout import LayoutRule, layout_rule
from tagtrack.envs.motions import Motion, Path
from tagtrack.envs.rewards import MOST_TERMS
from tagtrack.envs.scenario import Scenario, Start
from tagtrack.envs.sensors.sensor import DRAWS
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.sim.modem import ModemRule
from tagtrack.envs.sim.vehicle import Vehicle
from tagtrack.envs.tag import Tag


@dataclass(frozen=True, kw_only=True)
class WorldCalls:
    """Addresses of the functions of the truth's models, 0 for none; good for this process alone."""

    start: int  # of a motion
    choose: int
    begin: int  # of a path
    follow: int
    chance: int
    read: int


@dataclass(frozen=True, kw_only=True)
class WorldRule:
    """What compiled code reads of a ``Scenario``."""

    time_step: float
    episode_steps: int
    frame: int  # of courses, a ``Frame``
    speed_control: bool
    message_control: bool
    layout: LayoutRule
    modem: ModemRule
    shared_reward: bool
    least_separation: float  # [m]
    calls: WorldCalls
    vehicle: Vehicle
    fish: tuple[float, ...]  # parameters of the motion or path
    start: Start
    tag: Tag
    water: Water
    sensor: tuple[float, ...]  # parameters
    hydrophones: int
    asks: bool
    clock_sigma: float
    drawn_middle: tuple[float, ...]  # (DRAWS,)
    drawn_reach: tuple[float, ...]
    belief: FilterRule
    judges: tuple[int, ...]  # addresses of the terms of the reward
    terms: tuple[float, ...]  # their parameters, row after row
    scale: Scale


def world_rule(scenario: Scenario) -> WorldRule:
    fish, sensor, terms = scenario.fish, scenario.receiver, scenario.reward.terms
    draws = (*sensor.draws, *((0.0, 0.0),) * (DRAWS - len(sensor.draws)))
    empty = (0.0,) * ROW * (MOST_TERMS - len(terms))
    return WorldRule(
        time_step=scenario.time_step,
        episode_steps=scenario.episode_steps,
        speed_control=scenario.speed_control,
        frame=int(scenario.frame),
        message_control=scenario.message_control,
        layout=layout_rule(scenario),
        modem=scenario.modem_rule,
        shared_reward=scenario.reward.shared,
        least_separation=scenario.reward.least_separation,
        calls=WorldCalls(
            start=fish.start.address if isinstance(fish, Motion) else 0,
            choose=fish.choose.address if isinstance(fish, Motion) else 0,
            begin=fish.begin.address if isinstance(fish, Path) else 0,
            follow=fish.follow.address if isinstance(fish, Path) else 0,
            chance=address_of(sensor.chance),
            read=address_of(sensor.read),
        ),
        vehicle=scenario.vehicle,
        fish=fish.padded_row(),
        start=scenario.start,
        tag=scenario.tag,
        water=scenario.water,
        sensor=sensor.padded_row(),
        hydrophones=sensor.hydrophones,
        asks=sensor.asks,
        clock_sigma=sensor.clock_sigma,
        drawn_middle=tuple(float(middle) for middle, _ in draws),
        drawn_reach=tuple(float(reach) for _, reach in draws),
        belief=filter_rule(scenario.belief, scenario.tag),
        judges=tuple(term.judge.address for term in terms) + (0,) * (MOST_TERMS - len(terms)),
        terms=sum((term.padded_row() for term in terms), ()) + empty,
        scale=scenario.scale,
    )
