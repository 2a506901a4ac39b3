"""Presets of an id: settings of other people's systems, and a second water. ``gym.make(id, preset="masmitja2023")``.

Published settings, so that figures can be set beside theirs; what is left open there is chosen here, and says so.
"""

from __future__ import annotations

from dataclasses import replace

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.feature import Scale
from tagtrack.envs.motions import MomentumRandomWalk, StraightLegs
from tagtrack.envs.rewards import Reward
from tagtrack.envs.scenario import Scenario, Start
from tagtrack.envs.sensors import RangeReceiver
from tagtrack.envs.sim.acoustics import Water
from tagtrack.envs.sim.vehicle import Vehicle
from tagtrack.envs.tag import Tag
from tagtrack.envs.validation import guess

STEP = 30.0  # of both systems [s]: one range and one turn each
SCALE = Scale(length=200.0, near=60.0, spread=20.0, memory=200.0)

# One turn a step, as far as it is allowed, by a vehicle that knows where it is.
STEPWISE = Vehicle(
    max_speed=1.0,
    acceleration=1.0,
    max_turn_rate=0.3 / STEP,
    heading_gain=1.0 / STEP,
    control_interval=STEP,
    compass_sigma=0.0,
    fix_interval=0.0,
    fix_sigma=0.0,
    drift_sigma=0.0,
)

# Masmitja et al. 2023, Sci. Robot. 8: "Dynamic robotic tracking of underwater targets using reinforcement learning".
# Targets may also walk at random or by Levy flights: overrides={"fish": "levy"}. The belief is ours.
MASMITJA2023 = Scenario(
    time_step=STEP,
    episode_steps=200,
    vehicle=replace(STEPWISE, random_current=0.3),
    fish=StraightLegs(max_speed=0.6),
    start=Start(nearest=40.0, farthest=1000.0, shallowest=15.0, deepest=300.0),
    tag=Tag(period=STEP),
    water=Water(reach=900.0, edge_width=1.0, clear_hearing=0.9, noisy_share=0.0),
    receiver=RangeReceiver(range_sigma=0.0, range_tolerance=1.0, range_factor=1.01),
    belief=Belief(
        motion=MomentumRandomWalk(speed_sigma=0.005, turn_sigma=0.04, max_speed=0.7),
        receiver=RangeReceiver(range_sigma=6.0, max_range=900.0),
        farthest=1000.0,
        renewed_share=0.02,
    ),
    reward=Reward(error_cap=300.0),
    scale=SCALE,
)

MEDIUM_LEGS = StraightLegs(
    least_speed=0.2,
    max_speed=0.5,
    shortest_leg=35 * STEP,
    longest_leg=100 * STEP,
    least_turn=0.6,
    largest_turn=1.5,
)

# UTracking, the JAX environments for several vehicles, here with one vehicle and one target. The belief's motion is ours.
UTRACKING_MEDIUM = Scenario(
    time_step=STEP,
    episode_steps=256,
    vehicle=replace(STEPWISE, max_turn_rate=1.45 / STEP, heading_sigma=0.05, speed_sigma=0.1),
    fish=MEDIUM_LEGS,
    start=Start(nearest=30.0, farthest=500.0, shallowest=5.0, deepest=20.0),
    tag=Tag(period=STEP),
    water=Water(reach=1500.0, edge_width=1.0, clear_hearing=0.9, noisy_share=0.0),
    receiver=RangeReceiver(range_sigma=10.0),
    belief=Belief(
        particles=5000,
        motion=MomentumRandomWalk(speed_sigma=0.005, turn_sigma=0.04, max_speed=0.6),
        receiver=RangeReceiver(range_sigma=10.0),
        half_width=500.0,
        renewed_share=0.02,
    ),
    scale=SCALE,
)
UTRACKING_HARD = replace(
    UTRACKING_MEDIUM,
    fish=replace(MEDIUM_LEGS, least_speed=0.5, max_speed=0.7, shortest_leg=10 * STEP, longest_leg=50 * STEP),
    belief=replace(
        UTRACKING_MEDIUM.belief, motion=MomentumRandomWalk(speed_sigma=0.005, turn_sigma=0.07, max_speed=0.8)
    ),
)

# A second water, declared before anything was trained or measured in it, and never used to choose anything: a surf zone, where
# bubbles swallow whole stretches and sound carries less far. The task's own water was chosen among twenty (README).
SURF_ZONE = Scenario(
    water=Water(reach=80.0, edge_width=12.0, clear_hearing=0.85, noisy_hearing=0.05, noisy_share=0.4, noisy_duration=40.0)
)

PRESETS = {
    "TagTrack/LeopardShark-v0": {"surf_zone": SURF_ZONE},
    "TagTrack/RangeOnly-v0": {
        "masmitja2023": MASMITJA2023,
        "utracking_medium": UTRACKING_MEDIUM,
        "utracking_hard": UTRACKING_HARD,
    },
}


def find_preset(env_id: str, name: str) -> Scenario:
    """The preset of an id, with or without its namespace. Raises ValueError that lists what there is."""
    known = PRESETS.get(env_id) or PRESETS.get(f"TagTrack/{env_id}") or {}
    if name not in known:
        listed = f"known: {', '.join(known)}" if known else f"there are presets of {', '.join(PRESETS)}"
        raise ValueError(f"unknown preset {name!r} of {env_id}; {guess(name, known)}{listed}")
    return known[name]
