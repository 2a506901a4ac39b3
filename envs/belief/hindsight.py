"""Measurements that come late: a belief goes back to before them and on again, and what it passes on to others.

Each belief of a fleet that talks keeps a ring of its last steps: its state before each, and what it was told of it. Because every
draw is keyed by its step, a belief is then, bit for bit, what it would have been had the measurements come in time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.row import correct_row, predict_row
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.measurement import Status


class Past(NamedTuple):
    """The last K steps of one belief that hears of V vehicles; step s stands at place s modulo K."""

    particles: np.ndarray  # (K, 4 or 5, N) float32, before the step
    beliefs: np.ndarray  # (K,) BELIEF, before the step
    listeners: np.ndarray  # (K, V) LISTENER, before the step
    measurements: np.ndarray  # (K, V) MEASUREMENT of the step
    poses: np.ndarray  # (K,) NAVIGATION of the belief's own vehicle after the step


@compiled
def keep(past, step, particles, belief, listeners):
    """Remember the state before a step."""
    place = step % past.beliefs.shape[0]
    past.beliefs[place] = belief
    copy_rows(past.particles[place], particles)
    for v in range(listeners.shape[0]):
        past.listeners[place, v] = listeners[v]


@compiled
def open_step(past, step, own, v, pose):
    """A step begins: of it, only the own measurement is there so far."""
    place = step % past.beliefs.shape[0]
    past.poses[place] = pose
    for each in range(past.measurements.shape[1]):
        past.measurements[place, each].status = Status.ABSENT
    past.measurements[place, v] = own


@compiled
def enter(past, step, now, letter, v):
    """Enter a measurement that vehicle ``v`` made at a step. Returns whether the belief remembers that far back."""
    if not (0 < step <= now and now - step < past.beliefs.shape[0]):
        return False
    past.measurements[step % past.beliefs.shape[0], v] = letter
    return True


@compiled
def live_through(past, first, now, particles, beliefs, listeners, stream, row, rule, time_step, scratch):
    """Bring the one belief of ``beliefs`` (1,) to ``now``, with all that is known of the steps from ``first`` on.

    Where ``first`` is before ``now`` it goes back. The belief of the last step is left to be summarized.
    """
    steps, belief = past.beliefs.shape[0], beliefs[0]
    k0, k1, episode, _ = stream
    if first < now:
        place = first % steps
        copy_rows(particles, past.particles[place])
        beliefs[0] = past.beliefs[place]
        for v in range(listeners.shape[0]):
            listeners[v] = past.listeners[place, v]
    for step in range(first, now + 1):
        place = step % steps
        if step > first:
            pose = past.poses[(step - 1) % steps]
            summarize(particles, belief, pose.x, pose.y, pose.heading, rule)
        if step > first or first == now:
            keep(past, step, particles, belief, listeners)
        then = (k0, k1, episode, np.uint64(step))
        predict_row(particles, belief, listeners, then, row, rule, time_step, scratch)
        correct_row(particles, belief, past.measurements[place], listeners, then, row, rule, scratch)


@compiled
def copy_rows(to, of):
    for r in range(of.shape[0]):
        for i in range(of.shape[1]):
            to[r, i] = of[r, i]

@compiled
def take_down(radio, outbox, measurement, status):
    """Keep a measurement for the next packet, the newest first; where there is no room for it the oldest goes."""
    room = outbox.shape[0]
    if room == 0:
        return
    for k in range(min(radio.waiting, room - 1), 0, -1):
        outbox[k] = outbox[k - 1]
    outbox[0] = measurement
    outbox[0].status = status
    radio.waiting = min(radio.waiting + 1, room)


@compiled
def is_worth_telling(status, weighs_silence):
    """A ping, or a silence where silence is weighed."""
    return status == Status.HEARD or (status == Status.MISSED and weighs_silence)
