"""A motion of one's own: a fish that darts and rests. It moves the true fish, the particles of a belief, or both.

    tagtrack eval benchmark --env LeopardShark-v0 --set fish=own_motion:DartAndRest belief.motion=own_motion:DartAndRest
"""

from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.calling import native
from tagtrack.envs.kernels.motion_loops import FULL_TURN
from tagtrack.envs.kernels.random import high_unit, low_turn
from tagtrack.envs.motions.motion import CHOOSE, START, Motion

f32 = np.float32


@native(START)
def start(heading, speed, bits, parameters):
    """First headings and speeds: at rest, in any direction."""
    for i in range(heading.shape[0]):
        heading[i] = low_turn(bits[i]) * FULL_TURN
        speed[i] = f32(0.0)


@native(CHOOSE)
def choose(heading, speed, bits, normal_1, normal_2, parameters, time_step):
    """New headings and speeds, which are then swum for a step: a dart begins by chance, in a new direction, and fades."""
    dart_speed, fading = f32(parameters[0]), f32(np.exp(-time_step / parameters[2]))
    chance = f32(1.0 - np.exp(-time_step / parameters[1]))
    for i in range(heading.shape[0]):
        darts = high_unit(bits[i]) < chance
        heading[i] = low_turn(bits[i]) * FULL_TURN if darts else heading[i]
        speed[i] = dart_speed if darts else speed[i] * fading


@dataclass(frozen=True, kw_only=True)
class DartAndRest(Motion):
    dart_speed: float = 0.8  # [m/s]
    rest: float = 20.0  # mean time from one dart to the next [s]
    fading: float = 8.0  # time in which the speed falls to 1/e [s]
    start = start
    choose = choose
