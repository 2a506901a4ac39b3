"""What vehicles make of what they measure and are told: beliefs, what they know of teammates, observations. No truth is read."""

from __future__ import annotations

from tagtrack.envs.belief.hindsight import Past, enter, is_worth_telling, live_through, open_step, take_down
from tagtrack.envs.belief.listening import ping_phase
from tagtrack.envs.belief.row import begin_listeners, begin_row, correct_row, predict_row
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import place_of, stream_of
from tagtrack.envs.observation import (
    begin_outlook,
    look,
    look_to_port,
    observe_mate,
    observe_own,
    observe_tag,
    observe_teammates,
)


@compiled
def begin_beliefs(b, p, worlds, scratch):
    """First particles about each belief's vehicle; nothing was heard, nothing told."""
    stream = stream_of(worlds.clock[b])
    for t in range(worlds.beliefs.shape[2]):
        for o in range(worlds.beliefs.shape[1]):
            own = worlds.navigation[b, o]
            begin_row(
                worlds.particles[b, o, t], worlds.beliefs[b, o, t], own.x, own.y, stream, place_of(o, t), p.belief, scratch
            )  # fmt: skip
            begin_listeners(worlds.listeners[b, o, t], 0.0, p.belief)
        for v in range(worlds.outlooks.shape[1]):
            begin_outlook(worlds.outlooks[b, v, t])
    for v in range(worlds.mates.shape[1]):
        for other in range(worlds.mates.shape[1]):
            worlds.mates[b, v, other].known = False


@compiled
def update_beliefs(b, p, worlds, scratch):
    """Prediction, and correction with whatever the vehicles that share a belief have heard or surely missed, or were told."""
    stream = stream_of(worlds.clock[b])
    if p.modem.talks:
        read_mail(b, worlds)
    for o in range(worlds.beliefs.shape[1]):
        if p.modem.shares or worlds.navigation[b, o].active:
            for t in range(worlds.beliefs.shape[2]):
                if p.modem.talks:
                    recall(b, o, t, p, worlds, stream, scratch)
                else:
                    go_on(b, o, t, p, worlds, stream, scratch)
    meet_mates(b, p, worlds)


@compiled
def go_on(b, o, t, p, worlds, stream, scratch):
    """One belief that hears of everything in time."""
    first, last = (0, worlds.navigation.shape[1]) if p.modem.shares else (o, o + 1)
    particles, belief = worlds.particles[b, o, t], worlds.beliefs[b, o, t]
    listeners = worlds.listeners[b, o, t, first:last]
    predict_row(particles, belief, listeners, stream, place_of(o, t), p.belief, p.time_step, scratch)
    correct_row(
        particles, belief, worlds.measurements[b, first:last, t], listeners, stream, place_of(o, t), p.belief, scratch
    )  # fmt: skip


@compiled
def recall(b, o, t, p, worlds, stream, scratch):
    """One belief of a vehicle that is told of measurements some time after they were made; the vehicle's own it has in time."""
    past = Past(
        worlds.past_particles[b, o, t], worlds.past_beliefs[b, o, t], worlds.past_listeners[b, o, t],
        worlds.past_measurements[b, o, t], worlds.past_poses[b, o, t],
    )  # fmt: skip
    now = worlds.clock[b].step
    first = now
    open_step(past, now, worlds.measurements[b, o, t], o, worlds.navigation[b, o])
    for v in range(worlds.mail.shape[2]):
        if worlds.mail[b, o, v] > 0:
            place = worlds.mail[b, o, v] - 1
            for k in range(worlds.packets[b, v, place].count):
                letter = worlds.letters[b, v, place, k]
                if letter.tag == t:
                    step = int(round(letter.time / p.time_step))
                    if enter(past, step, now, letter, v):
                        first = min(first, step)
                    else:
                        worlds.radios[b, o].too_late += 1
    live_through(
        past, first, now, worlds.particles[b, o, t], worlds.beliefs[b, o, t : t + 1], worlds.listeners[b, o, t], stream,
        place_of(o, t), p.belief, p.time_step, scratch,
    )  # fmt: skip
    status = worlds.listeners[b, o, t, o].status
    if is_worth_telling(status, p.belief.weighs_silence):
        take_down(worlds.radios[b, o], worlds.outbox[b, o], worlds.measurements[b, o, t], status)


@compiled
def read_mail(b, worlds):
    """Where teammates were when they sent what has just come."""
    for w in range(worlds.mail.shape[1]):
        for v in range(worlds.mail.shape[2]):
            if worlds.mail[b, w, v] > 0:
                packet, mate = worlds.packets[b, v, worlds.mail[b, w, v] - 1], worlds.mates[b, w, v]
                worlds.radios[b, w].received += 1
                mate.known = True
                mate.time = packet.time
                mate.x = packet.x
                mate.y = packet.y
                mate.heading = packet.heading
                mate.speed = packet.speed


@compiled
def meet_mates(b, p, worlds):
    """With a fusion centre every vehicle knows of every other one that takes part at any time."""
    if p.modem.shares:
        time = worlds.clock[b].step * p.time_step
        for w in range(worlds.mates.shape[1]):
            for v in range(worlds.mates.shape[1]):
                navigation, mate = worlds.navigation[b, v], worlds.mates[b, w, v]
                mate.known = navigation.active
                mate.time = time
                mate.x = navigation.x
                mate.y = navigation.y
                mate.heading = navigation.heading
                mate.speed = navigation.speed


@compiled
def believe(b, p, worlds, outputs):
    """Condense every belief, and write what each vehicle sees."""
    owners, tags = worlds.beliefs.shape[1], worlds.beliefs.shape[2]
    if worlds.clock[b].step == 0:
        meet_mates(b, p, worlds)
    for o in range(owners):
        own = worlds.navigation[b, o]
        if p.modem.shares or own.active:
            for t in range(tags):
                port = summarize(worlds.particles[b, o, t], worlds.beliefs[b, o, t], own.x, own.y, own.heading, p.belief)
                worlds.outlooks[b, o, t].port = port
    for v in range(worlds.navigation.shape[1]):
        if worlds.navigation[b, v].active:
            observe(b, v, p, worlds, outputs.observation[b, v])
        else:
            outputs.observation[b, v, :] = 0.0


@compiled
def observe(b, v, p, worlds, out):
    """The observation of one vehicle: tags, teammates, itself."""
    owners, tags, vehicles = worlds.beliefs.shape[1], worlds.beliefs.shape[2], worlds.navigation.shape[1]
    o = 0 if owners == 1 else v
    navigation, mates = worlds.navigation[b, v], worlds.mates[b, v]
    time = worlds.clock[b].step * p.time_step
    for t in range(tags):
        belief, outlook, listener = worlds.beliefs[b, o, t], worlds.outlooks[b, v, t], worlds.listeners[b, o, t, v]
        if v != o:
            look_to_port(outlook, worlds.particles[b, o, t], navigation)
        look(outlook, belief, navigation, p.scale.memory, p.time_step)
        phase = ping_phase(listener, time, p.belief.period, p.belief.random_delay)
        block = out[t * p.layout.tag : (t + 1) * p.layout.tag]
        if vehicles > 1:
            last = p.layout.tag - 1
            observe_teammates(block[last:], belief, navigation, mates, v, p.scale)
            block = block[:last]
        observe_tag(block, belief, listener, outlook, navigation, phase, p.belief, p.scale)
    first = tags * p.layout.tag
    for other in range(vehicles):
        if other != v:
            observe_mate(out[first : first + p.layout.mate], mates[other], navigation, time, p.vehicle.max_speed, p.scale)
            first += p.layout.mate
    observe_own(out[first:], navigation, worlds.radios[b, v], v, time, p)
