"""One belief about one tag: begin, predict, weigh what was heard or surely missed, resample, recover (Clark et al. 2013, Alg. 1).

Particles are rows: x, y, heading, speed and, where a belief estimates a number of its sensor, that number. ``carried`` holds the
weight that each carries since it was drawn, with a mean of 1; it has no places where every correction resamples. ``listeners``
(V,) hold what each vehicle that tells the belief something remembers; ``measurements`` (V,) what each tells at this time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.assumptions import Estimate
from tagtrack.envs.belief.listening import begin_listening, note
from tagtrack.envs.belief.recovery import follow_likelihood, scatter_share, wants_second_resampling
from tagtrack.envs.belief.renewal import is_refuted, part_siblings, renew, scatter_on_ring, spread_estimated, walk_estimated
from tagtrack.envs.kernels.compiling import compiled, inner, outlined
from tagtrack.envs.kernels.motion_loops import scatter_on_annulus, scatter_uniformly
from tagtrack.envs.kernels.random import PREDICT, PURPOSES, RESAMPLE, SPREAD, fill_bits, uniform_pair
from tagtrack.envs.kernels.resample_loops import copy_row, fill_row, heaviest, normalize, resample
from tagtrack.envs.measurement import Status
from tagtrack.envs.motions.motion import start_swimming, swim, swim_by_weight
from tagtrack.envs.sensors.sensor import weigh_at

f32 = np.float32

# One owner's belief about one tag. Means [m], spreads [m^2], velocities [m/s] (an average), `best` the index of the particle that
# weighed most, `corrections` how many there were, `estimated` and its `_spread` (standard deviation) what is believed of a number
# of the sensor, `w_slow` and `w_fast` likelihoods of readings averaged (see ``recovery.py``).
BELIEF = np.dtype(
    [
        (name, np.float64)
        for name in (
            "mean_x", "mean_y", "estimate_x", "estimate_y", "xx", "yy", "xy", "velocity_x", "velocity_y", "estimated",
            "estimated_spread", "w_slow", "w_fast",
        )
    ]
    + [("best", np.int64), ("corrections", np.int64)]
)  # fmt: skip


class Scratch(NamedTuple):
    """Rows that one thread works in; nothing in them outlives a row of particles."""

    bits: np.ndarray  # int32, particles rounded up to a multiple of 32
    normal_1: np.ndarray  # (N,) float32, as the next two
    normal_2: np.ndarray
    weight: np.ndarray
    fixed: np.ndarray  # (N,) int32
    parent: np.ndarray  # (N + 1,) int32
    whole: np.ndarray  # (4 N,) float32: x, y, heading, speed of each particle side by side


def make_scratch(particles: int) -> Scratch:
    return Scratch(
        bits=np.zeros(-(-particles // 32) * 32, np.int32),
        normal_1=np.zeros(particles, np.float32),
        normal_2=np.zeros(particles, np.float32),
        weight=np.zeros(particles, np.float32),
        fixed=np.zeros(particles, np.int32),
        parent=np.zeros(particles + 1, np.int32),
        whole=np.zeros(4 * particles, np.float32),
    )


@inner
def begin_row(particles, carried, belief, x, y, stream, row, rule, scratch):
    """First particles: uniform in a square about the vehicle at (x, y), with random headings and speeds (4.1)."""
    fill_bits(stream, SPREAD + PURPOSES * row, scratch.bits)
    if rule.farthest > 0.0:
        scatter_on_annulus(particles[0], particles[1], scratch.bits, f32(x), f32(y), f32(0.0), f32(rule.farthest))
    else:
        scatter_uniformly(particles[0], particles[1], scratch.bits, f32(x), f32(y), f32(rule.half_width))
    fill_bits(stream, PREDICT + PURPOSES * row, scratch.bits)
    start_swimming(particles, scratch.bits, rule.calls.start, rule.motion[:])
    fill_row(carried, f32(1.0))
    belief.velocity_x = 0.0
    belief.velocity_y = 0.0
    belief.best = 0
    belief.corrections = 0
    belief.w_slow = 0.0
    belief.w_fast = 0.0
    if particles.shape[0] > 4:
        spread_estimated(particles[4], stream, row, rule, scratch)


@inner
def begin_listeners(listeners, time, rule):
    """Nobody has heard anything."""
    for v in range(listeners.shape[0]):
        begin_listening(listeners[v], time, rule.longest_interval)


@inner
def predict_row(particles, carried, belief, listeners, stream, row, rule, time_step, scratch):
    """Prediction (Alg. 1, lines 2-3), at every step, whether or not a ping was heard."""
    bits, normal_1, normal_2 = scratch.bits, scratch.normal_1, scratch.normal_2
    choose, motion, purpose = rule.calls.choose, rule.motion[:], PREDICT + PURPOSES * row
    if carried.shape[0] > 0:
        step_x, step_y = swim_by_weight(particles, carried, stream, purpose, bits, normal_1, normal_2, choose, motion, time_step)
    else:
        step_x, step_y = swim(particles, stream, purpose, bits, normal_1, normal_2, choose, motion, time_step)
    share = min(1.0, time_step / rule.velocity_memory)
    belief.velocity_x += share * (np.float64(step_x) / time_step - belief.velocity_x)
    belief.velocity_y += share * (np.float64(step_y) / time_step - belief.velocity_y)
    for v in range(listeners.shape[0]):
        listeners[v].silence += time_step
        listeners[v].status = Status.NOTHING


@inner
def correct_row(particles, carried, belief, measurements, listeners, stream, row, rule, scratch):
    """Correction with what the vehicles tell (Alg. 1, lines 12-18), where they tell anything."""
    told = 0
    heard = 0
    last = 0  # vehicle that heard something, or else that was told by silence
    ringing = -1  # vehicle with the shortest range
    for v in range(measurements.shape[0]):
        if measurements[v].status == Status.ABSENT:
            continue
        note(listeners[v], measurements[v], rule.longest_interval)
        if is_told(listeners[v], rule):
            told += 1
            hears = listeners[v].status == Status.HEARD
            if hears or heard == 0:
                last = v
            if hears:
                heard += 1
                ringing = nearer_ring(measurements, ringing, v, rule)
    if told == 0:
        return
    renew(particles, carried, belief, stream, row, rule)
    weigh_all(particles, carried, measurements, listeners, rule, scratch)
    ranged = rule.ring_reading >= 0 and heard > 0
    if ranged and (belief.corrections == 0 or is_refuted(scratch.weight, heard, rule)):
        scatter_on_ring(particles, carried, measurements[ringing], stream, row, rule, scratch)
        weigh_all(particles, carried, measurements, listeners, rule, scratch)
    share = follow_likelihood(belief, scratch.weight, told, rule.recovery) if rule.recovery.fast_rate > 0.0 else 0.0
    belief.corrections += 1
    offset, second_offset = uniform_pair(stream, RESAMPLE, row)
    drawn = draw_by_weight(particles, carried, belief, offset, rule, scratch)
    if drawn and rule.jitter > 0.0:
        part_siblings(particles, belief, stream, row, rule, scratch)
    if drawn and particles.shape[0] > 4:
        walk_estimated(particles[4], stream, row, rule, scratch)
    if rule.recovery.fast_rate > 0.0:
        scatter_share(particles, carried, share, measurements[last].x, measurements[last].y, stream, row, rule.half_width)
        if wants_second_resampling(share, rule.recovery):  # Lin et al. 2013, Alg. 2, lines 9-16
            weigh_all(particles, carried, measurements, listeners, rule, scratch)
            draw_by_weight(particles, carried, belief, second_offset, rule, scratch)


@inner
def nearer_ring(measurements, first, second, rule):
    """Which of two vehicles has the shorter range: its ring is the smaller one, and fullest of particles. -1: none yet."""
    if rule.ring_reading < 0 or first < 0:
        return second
    k = rule.ring_reading
    return second if measurements[second].readings[k] < measurements[first].readings[k] else first


@compiled
def is_told(listener, rule):
    """Whether the latest measurement is one that the filter uses: a ping, or a silence where silence is weighed.

    A ping whose range jumps from the one heard before is not (Lin et al. 2013, Alg. 1); the first, with none before it, passes.
    """
    if listener.status == Status.HEARD:
        if rule.gate_reading < 0:
            return True
        k = rule.gate_reading
        return not abs(listener.readings[k] - listener.previous[k]) > rule.largest_jump
    return listener.status == Status.MISSED and rule.weighs_silence


@outlined
def weigh_all(particles, carried, measurements, listeners, rule, scratch):
    """The weights by what all vehicles tell, and by what the particles carry."""
    if carried.shape[0] > 0:
        copy_row(carried, scratch.weight)
    else:
        fill_row(scratch.weight, f32(1.0))
    for v in range(measurements.shape[0]):
        if measurements[v].status != Status.ABSENT and is_told(listeners[v], rule):
            weigh(particles, measurements[v], rule, scratch)


@inner
def weigh(particles, measurement, rule, scratch):
    """Multiply the weights by the likelihood of what one vehicle heard, or of its silence (Alg. 1)."""
    weigh_at(rule.calls.weigh)(
        scratch.weight, particles, measurement, f32(rule.weight_floor), scratch.normal_1, rule.model[:]
    )


@outlined
def draw_by_weight(particles, carried, belief, offset, rule, scratch):
    """Resample, and keep hold of the particle that weighed most. Returns whether: or particles carry their weights on.

    They do as long as the effective sample size, (sum of weights)^2 / (sum of their squares), is no less than the share of the
    particles that the belief asks for.
    """
    best = heaviest(scratch.weight) if rule.estimate == Estimate.BEST else 0
    if carried.shape[0] > 0 and normalize(scratch.weight, carried) * rule.resample_below <= carried.shape[0]:
        belief.best = best
        return False
    if resample(particles, scratch.weight, scratch.fixed, scratch.parent, scratch.whole, offset):
        belief.best = min(scratch.fixed[best], particles.shape[1] - 1)
        fill_row(carried, f32(1.0))
    return True
