"""What vehicles that talk do between two steps: put down their news, send, receive, and go back for what has come late.

Compiled only for fleets that talk. The ring of what a belief remembers is in ``belief/hindsight.py``, the modem in
``sim/modem.py``.
"""

from __future__ import annotations

import numpy as np

from tagtrack.envs.belief.hindsight import is_worth_telling, keep, past_of, recall, take_down
from tagtrack.envs.belief.listening import get_to_know
from tagtrack.envs.believing import update_beliefs
from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.random import stream_of
from tagtrack.envs.sim.modem import deliver, send_in_turn


@compiled
def exchange_worlds(first, last, parameters, actions, worlds, scratch):
    """All that travels while worlds first..last-1 go from this step to the next."""
    p = parameters[0]
    for b in range(first, last):
        take_down_news(b, p, worlds)
        travel(b, p, actions, worlds)
        read_mail(b, worlds)
        recall_beliefs(b, p, worlds, scratch)


@inner
def take_down_news(b, p, worlds):
    """What a vehicle measured at this step waits for its next packet."""
    for v in range(worlds.radios.shape[1]):
        if worlds.navigation[b, v].active:
            for t in range(worlds.beliefs.shape[2]):
                status = worlds.listeners[b, v, t, v].status
                if is_worth_telling(status, p.belief.weighs_silence):
                    take_down(worlds.radios[b, v], worlds.outbox[b, v], worlds.measurements[b, v, t], status)


@inner
def travel(b, p, actions, worlds):
    """Packets leave in the slots until the next step, from where the vehicles are now; what comes by then is delivered."""
    k0, k1, episode, step = stream_of(worlds.clock[b])
    time = worlds.clock[b].step * p.time_step
    if p.message_control:
        for v in range(worlds.radios.shape[1]):
            worlds.radios[b, v].wants = actions[b, v, actions.shape[2] - 1] > 0.0
    send_in_turn(
        worlds.radios[b], worlds.packets[b], worlds.letters[b], worlds.arrivals[b], worlds.outbox[b], worlds.navigation[b],
        worlds.vehicles[b], (k0, k1, episode, step + np.uint64(1)), time, p.time_step, p.modem,
    )  # fmt: skip
    deliver(worlds.mail[b], worlds.arrivals[b], worlds.navigation[b], time + p.time_step)


@inner
def read_mail(b, worlds):
    """Teammates are where they were when they sent what has just come."""
    for w in range(worlds.mail.shape[1]):
        for v in range(worlds.mail.shape[2]):
            if worlds.mail[b, w, v] > 0:
                packet = worlds.packets[b, v, worlds.mail[b, w, v] - 1]
                worlds.radios[b, w].received += 1
                get_to_know(worlds.mates[b, w, v], packet, packet.time)


@inner
def recall_beliefs(b, p, worlds, scratch):
    """Where something has come late, beliefs go back to before it, and on again up to the step that has just been."""
    coming = worlds.clock[b].step + 1
    first = coming
    for o in range(worlds.beliefs.shape[1]):
        for t in range(worlds.beliefs.shape[2]):
            worlds.since[b, o, t] = coming
            if worlds.navigation[b, o].active:
                worlds.since[b, o, t] = recall(
                    past_of(b, o, t, worlds), t, coming, p.time_step, worlds.mail[b, o], worlds.packets[b], worlds.letters[b],
                    worlds.radios[b, o], worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t : t + 1],
                    worlds.listeners[b, o, t],
                )  # fmt: skip
            first = min(first, worlds.since[b, o, t])
    for step in range(first, coming):
        update_beliefs(b, step, p, worlds, scratch)
        for o in range(worlds.beliefs.shape[1]):
            for t in range(worlds.beliefs.shape[2]):
                if step >= worlds.since[b, o, t]:
                    keep(
                        past_of(b, o, t, worlds), step + 1, worlds.particles[b, o, t], worlds.carried[b, o, t],
                        worlds.beliefs[b, o, t : t + 1], worlds.listeners[b, o, t],
                    )  # fmt: skip
