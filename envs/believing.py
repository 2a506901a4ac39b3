"""What vehicles make of what they measure and are told: beliefs, what they know of teammates, observations. No truth is read."""

from __future__ import annotations

import numpy as np

from tagtrack.envs.belief.listening import get_to_know, ping_phase
from tagtrack.envs.belief.row import begin_listeners, begin_row, correct_row, predict_row
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.kernels.compiling import inner, outlined
from tagtrack.envs.kernels.random import place_of, stream_of
from tagtrack.envs.measurement import Status
from tagtrack.envs.observation import (
    begin_outlook,
    look,
    look_to_port,
    observe_mate,
    observe_own,
    observe_tag,
    observe_teammates,
)


@outlined
def begin_beliefs(b, p, worlds, scratch):
    """First particles about each belief's vehicle; nothing was heard, nothing told."""
    stream = stream_of(worlds.clock[b])
    for t in range(worlds.beliefs.shape[2]):
        for o in range(worlds.beliefs.shape[1]):
            own = worlds.navigation[b, o]
            begin_row(
                worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t], own.x, own.y, stream,
                place_of(o, t), p.belief, scratch,
            )  # fmt: skip
            begin_listeners(worlds.listeners[b, o, t], 0.0, p.belief)
    look_first(b, worlds)


@inner
def look_first(b, worlds):
    """Nothing was seen yet of any tag or teammate."""
    for v in range(worlds.outlooks.shape[1]):
        for t in range(worlds.outlooks.shape[2]):
            begin_outlook(worlds.outlooks[b, v, t])
        for other in range(worlds.mates.shape[1]):
            worlds.mates[b, v, other].known = False


@inner
def update_beliefs(b, step, p, worlds, scratch):
    """Prediction, correction with what the vehicles that share a belief have measured or were told, and summary.

    A belief that has gone back for something that came late goes on from step ``worlds.since`` (``exchange.py``).
    """
    k0, k1, episode, _ = stream_of(worlds.clock[b])
    stream, place = (k0, k1, episode, np.uint64(step)), step % worlds.past_poses.shape[3]
    for o in range(worlds.beliefs.shape[1]):
        if not (p.modem.shares or worlds.navigation[b, o].active):
            continue
        for t in range(worlds.beliefs.shape[2]):
            if step >= worlds.since[b, o, t]:
                particles, carried, belief = worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t]
                listeners, row = worlds.listeners[b, o, t], place_of(o, t)
                told, pose = worlds.past_measurements[b, o, t, place], worlds.past_poses[b, o, t, place]
                predict_row(particles, carried, belief, listeners, stream, row, p.belief, p.time_step, scratch)
                correct_row(particles, carried, belief, told, listeners, stream, row, p.belief, scratch)
                port = summarize(particles, carried, belief, pose.x, pose.y, pose.heading, p.belief)
                worlds.outlooks[b, o, t].port = port


@inner
def note_told(b, p, worlds):
    """What each belief is told of this step: what all vehicles measured, or its own one, and the others that it has just heard.

    Where vehicles talk in packets the others' places were emptied when the step began (``hindsight.recall``).
    """
    place = worlds.clock[b].step % worlds.past_poses.shape[3]
    for o in range(worlds.beliefs.shape[1]):
        for t in range(worlds.beliefs.shape[2]):
            worlds.past_poses[b, o, t, place] = worlds.navigation[b, o]
            for v in range(worlds.navigation.shape[1]):
                told = worlds.past_measurements[b, o, t, place]
                called = p.modem.calls and worlds.mail[b, o, v] > 0
                if p.modem.shares or v == o or called:
                    told[v] = worlds.measurements[b, v, t]
                    if called:  # from the place where it says it is
                        told[v].x += worlds.packets[b, v, 0].x - worlds.navigation[b, v].x
                        told[v].y += worlds.packets[b, v, 0].y - worlds.navigation[b, v].y
                elif not p.modem.talks:
                    told[v].status = Status.ABSENT


@inner
def meet_mates(b, p, worlds):
    """With a fusion centre every vehicle knows of every other that takes part; else of those just heard."""
    if p.modem.calls:
        for w in range(worlds.mates.shape[1]):
            for v in range(worlds.mates.shape[1]):
                if worlds.mail[b, w, v] > 0:
                    get_to_know(worlds.mates[b, w, v], worlds.packets[b, v, 0], worlds.clock[b].step * p.time_step)
    if p.modem.shares and worlds.mates.shape[1] > 1:
        for w in range(worlds.mates.shape[1]):
            for v in range(worlds.mates.shape[1]):
                get_to_know(worlds.mates[b, w, v], worlds.navigation[b, v], worlds.clock[b].step * p.time_step)
                worlds.mates[b, w, v].known = worlds.navigation[b, v].active


@outlined
def condense(b, p, worlds):
    """The summary of every belief, as it is after each step, at the beginning."""
    for o in range(worlds.beliefs.shape[1]):
        own = worlds.navigation[b, o]
        for t in range(worlds.beliefs.shape[2]):
            particles, carried, belief = worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t]
            worlds.outlooks[b, o, t].port = summarize(particles, carried, belief, own.x, own.y, own.heading, p.belief)
    meet_mates(b, p, worlds)


@inner
def observe_all(b, p, worlds, outputs):
    """Write what each vehicle sees; nothing where it takes no part any more."""
    for v in range(worlds.navigation.shape[1]):
        if worlds.navigation[b, v].active:
            observe(b, v, p, worlds, outputs.observation[b, v])
        else:
            outputs.observation[b, v, :] = 0.0


@inner
def observe(b, v, p, worlds, out):
    """The observation of one vehicle: tags, teammates, itself."""
    owners, tags, vehicles = worlds.beliefs.shape[1], worlds.beliefs.shape[2], worlds.navigation.shape[1]
    o = 0 if owners == 1 else v
    navigation = worlds.navigation[b, v]
    time = worlds.clock[b].step * p.time_step
    for t in range(tags):
        belief, outlook, listener = worlds.beliefs[b, o, t], worlds.outlooks[b, v, t], worlds.listeners[b, o, t, v]
        if v != o:
            look_to_port(outlook, worlds.particles[b, o, t], worlds.carried[b, o, t], navigation)
        look(outlook, belief, navigation, p.scale.memory, p.time_step)
        phase = ping_phase(listener, time, p.belief.period, p.belief.random_delay)
        block = out[t * p.layout.tag : (t + 1) * p.layout.tag]
        if vehicles > 1:
            last = p.layout.tag - 1
            observe_teammates(block[last:], belief, navigation, worlds.mates[b, v], v, p.scale)
            block = block[:last]
        observe_tag(block, belief, listener, outlook, navigation, phase, p.belief, p.scale)
    first = tags * p.layout.tag
    for other in range(vehicles):
        if other != v:
            observe_mate(
                out[first : first + p.layout.mate], worlds.mates[b, v, other], navigation, time, p.vehicle.max_speed, p.scale
            )  # fmt: skip
            first += p.layout.mate
    observe_own(out[first:], navigation, worlds.radios[b, v], v, time, p)
