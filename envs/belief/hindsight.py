"""Measurements that come late: a belief goes back to before them and on again, and what it passes on to others.

Each belief of a fleet that talks keeps a ring of its last steps: its state before each, and what it was told of it. Because every
draw is keyed by its step, a belief is then, bit for bit, what it would have been had the measurements come in time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tagtrack.envs.kernels.compiling import inner
from tagtrack.envs.kernels.resample_loops import copy_row
from tagtrack.envs.measurement import Status


class Past(NamedTuple):
    """The last K steps of one belief that hears of V vehicles; step s stands at place s modulo K."""

    particles: np.ndarray  # (K, 4 or 5, N) float32, before the step
    carried: np.ndarray  # (K, N or 0) float32, before the step
    beliefs: np.ndarray  # (K,) BELIEF, before the step
    listeners: np.ndarray  # (K, V) LISTENER, before the step
    measurements: np.ndarray  # (K, V) MEASUREMENT of the step
    poses: np.ndarray  # (K,) NAVIGATION of the belief's own vehicle after the step


@inner
def past_of(b, o, t, worlds):
    """The last steps of one belief."""
    return Past(
        worlds.past_particles[b, o, t], worlds.past_carried[b, o, t], worlds.past_beliefs[b, o, t],
        worlds.past_listeners[b, o, t], worlds.past_measurements[b, o, t], worlds.past_poses[b, o, t],
    )  # fmt: skip


@inner
def keep(past, step, particles, carried, beliefs, listeners):
    """Remember the state before a step; the belief is the one of ``beliefs`` (1,)."""
    place = step % past.beliefs.shape[0]
    past.beliefs[place] = beliefs[0]
    copy_rows(past.particles[place], particles)
    copy_row(carried, past.carried[place])
    for v in range(listeners.shape[0]):
        past.listeners[place, v] = listeners[v]


@inner
def recall(past, tag, coming, time_step, mail, packets, letters, radio, particles, carried, beliefs, listeners):
    """Take up what has just come about a tag, and go back to before it was measured.

    Args:
        past, particles, carried, beliefs (1,), listeners: of the belief, which stands before the step ``coming``.
        mail: (V,) of what came from each vehicle 1 + its place among ``packets`` (V, D) and ``letters`` (V, D, M); 0: nothing.
    Returns:
        The first step that the belief must go through anew.
    """
    keep(past, coming, particles, carried, beliefs, listeners)
    for v in range(mail.shape[0]):
        past.measurements[coming % past.beliefs.shape[0], v].status = Status.ABSENT
    first = coming
    for v in range(mail.shape[0]):
        place = mail[v] - 1
        if place >= 0:
            for k in range(packets[v, place].count):
                if letters[v, place, k].tag == tag:
                    step = int(round(letters[v, place, k].time / time_step))
                    if 0 < step < coming and coming - step < past.beliefs.shape[0]:
                        past.measurements[step % past.beliefs.shape[0], v] = letters[v, place, k]
                        first = min(first, step)
                    else:
                        radio.too_late += 1
    if first < coming:
        place = first % past.beliefs.shape[0]
        copy_rows(particles, past.particles[place])
        copy_row(past.carried[place], carried)
        beliefs[0] = past.beliefs[place]
        for v in range(listeners.shape[0]):
            listeners[v] = past.listeners[place, v]
    return first


@inner
def copy_rows(to, of):
    for r in range(of.shape[0]):
        for i in range(of.shape[1]):
            to[r, i] = of[r, i]


@inner
def is_worth_telling(status, weighs_silence):
    """A ping, or where silence is weighed one that was surely missed."""
    return status == Status.HEARD or (status == Status.MISSED and weighs_silence)


@inner
def take_down(radio, outbox, measurement, status):
    """Keep a vehicle's own measurement for its next packet, the newest first; where there is no room the oldest goes."""
    room = outbox.shape[0]
    for k in range(min(radio.waiting, room - 1), 0, -1):
        outbox[k] = outbox[k - 1]
    outbox[0] = measurement
    outbox[0].status = status
    radio.waiting = min(radio.waiting + 1, room)
