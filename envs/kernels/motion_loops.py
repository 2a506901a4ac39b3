"""Loops that move a row of particles by one time step; a fish is a row of one (Clark et al. 2013, Algs. 2-4).

Each loop takes few arrays, because LLVM gives up on SIMD where it would have to prove many pairs of rows disjoint.
Rows are float32: x, y [m], heading [rad], speed [m/s]; ``bits`` holds 32 random bits for each particle.
"""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.maths import sin_of_turns
from tagtrack.envs.kernels.random import high_unit, low_turn

f32 = np.float32
TURNS = f32(0.5 / math.pi)  # turns per radian
FULL_TURN = f32(2.0 * math.pi)


@inner
def scatter_uniformly(x, y, bits, centre_x, centre_y, half_width):
    """Place particles uniformly in a square about a centre (Clark et al. 2013, 4.1)."""
    for i in range(x.shape[0]):
        x[i] = centre_x + f32(2.0) * half_width * (high_unit(bits[i]) - f32(0.5))
        y[i] = centre_y + f32(2.0) * half_width * low_turn(bits[i])


@inner
def scatter_on_annulus(x, y, bits, centre_x, centre_y, least, largest):
    """Place particles about a centre at distances uniform between two and in all directions."""
    for i in range(x.shape[0]):
        distance = least + (largest - least) * high_unit(bits[i])
        turn = low_turn(bits[i])
        x[i] = centre_x + distance * sin_of_turns(f32(0.25) - abs(turn))
        y[i] = centre_y + distance * sin_of_turns(turn)


@compiled
def scatter_velocities(heading, speed, bits, max_speed, moving_share):
    """Uniform headings; speeds uniform up to ``max_speed`` for the share that moves, zero for the rest."""
    for i in range(heading.shape[0]):
        heading[i] = low_turn(bits[i]) * FULL_TURN
        unit = high_unit(bits[i])
        speed[i] = max_speed * unit / moving_share if unit < moving_share else f32(0.0)


@compiled
def change_momentum(heading, speed, normal_1, normal_2, speed_sigma, turn_sigma, max_speed):
    """Random change of speed and heading (Clark et al. 2013, Alg. 2, lines 2-3); speed stays within [0, max_speed]."""
    for i in range(heading.shape[0]):
        speed[i] = min(max(speed[i] + speed_sigma * normal_1[i], f32(0.0)), max_speed)
        turns = (heading[i] + turn_sigma * normal_2[i]) * TURNS
        heading[i] = (turns - np.floor(turns + f32(0.5))) * FULL_TURN


@compiled
def advance(x, y, heading, speed, time_step):
    """Move each particle along its heading (Alg. 2, lines 4-5). Returns the mean displacement (x, y) [m]."""
    sum_x = f32(0.0)
    sum_y = f32(0.0)
    for i in range(x.shape[0]):
        turns = heading[i] * TURNS
        length = speed[i] * time_step
        step_x = length * sin_of_turns(f32(0.25) - abs(turns))
        step_y = length * sin_of_turns(turns)
        x[i] += step_x
        y[i] += step_y
        sum_x += step_x
        sum_y += step_y
    count = f32(x.shape[0])
    return sum_x / count, sum_y / count


@compiled
def advance_by_weight(x, y, heading, speed, weight, time_step):
    """As ``advance``, for a row of particles that carry weights (N,): the mean is weighted."""
    sum_x = f32(0.0)
    sum_y = f32(0.0)
    total = f32(0.0)
    for i in range(x.shape[0]):
        turns = heading[i] * TURNS
        length = speed[i] * time_step
        step_x = length * sin_of_turns(f32(0.25) - abs(turns))
        step_y = length * sin_of_turns(turns)
        x[i] += step_x
        y[i] += step_y
        sum_x += weight[i] * step_x
        sum_y += weight[i] * step_y
        total += weight[i]
    return sum_x / total, sum_y / total


@inner
def displace(x, y, normal_1, normal_2, along, shared, own):
    """Add correlated normals: ``along`` times the first to x, ``shared`` times the first and ``own`` times the second to y."""
    for i in range(x.shape[0]):
        x[i] += along * normal_1[i]
        y[i] += shared * normal_1[i] + own * normal_2[i]


@compiled
def choose_brownian(heading, speed, bits, max_speed):
    """A new speed in [0, max_speed] and a new direction at every step (Alg. 3, lines 2-3)."""
    for i in range(heading.shape[0]):
        speed[i] = max_speed * high_unit(bits[i])
        heading[i] = low_turn(bits[i]) * FULL_TURN


@compiled
def choose_levy(heading, speed, bits, scale_speed, max_speed):
    """A step from the half-Cauchy density of Eq. 4 with gamma = scale_speed * time step, in a new direction (Alg. 4).

    The heavy tail is cut at ``max_speed``: no fish crosses the bay in one step.
    """
    for i in range(heading.shape[0]):
        quarter = f32(0.25) * high_unit(bits[i])
        tangent = sin_of_turns(quarter) / sin_of_turns(f32(0.25) - quarter)
        speed[i] = min(scale_speed * tangent, max_speed)
        heading[i] = low_turn(bits[i]) * FULL_TURN


@compiled
def choose_boat(heading, speed, bits, cruise_speed, stop_probability, start_probability):
    """Straight legs at one speed and idle spells, both of memoryless length; every new leg has a new course."""
    for i in range(heading.shape[0]):
        idle = speed[i] <= f32(0.0)
        changes = high_unit(bits[i]) < (start_probability if idle else stop_probability)
        new_speed = cruise_speed if idle else f32(0.0)
        new_heading = low_turn(bits[i]) * FULL_TURN
        heading[i] = new_heading if changes and idle else heading[i]
        speed[i] = new_speed if changes else speed[i]
