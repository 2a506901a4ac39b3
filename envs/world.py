"""One step of every world, as the papers' loop reads: steer, swim, hear | predict, correct, summarize, observe | judge.

The wall runs between hearing and predicting: what the belief and the observation are given of a world are its vehicles'
navigation and their measurements. Only the referee, at the end, sets estimates beside the truth.

All state stands in arrays whose axes come in one order: B worlds, V vehicles, T tags (one fish each), O belief owners, N
particles. ``Simulation`` holds them; the loops here own nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.listening import ping_phase
from tagtrack.envs.belief.row import begin_listeners, begin_row, correct_row, predict_row
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.kernels.calling import ROW
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import FISH, PURPOSES, START, TRACK, fill_bits, place_of, stream_of, uniform_pair
from tagtrack.envs.measurement import Status
from tagtrack.envs.motions.motion import begin_at, follow_at, start_swimming, swim
from tagtrack.envs.observation import OWN_COUNT, begin_outlook, decode_action, look, look_to_port, observe_own, observe_tag
from tagtrack.envs.rewards.term import judge_at
from tagtrack.envs.sensors.sensor import DRAWS
from tagtrack.envs.sim.acoustics import listen, meet, open_encounter
from tagtrack.envs.sim.tags import ping_within, start_pinging
from tagtrack.envs.sim.vehicle import hold_course, launch

# A world's own numbers: its seed, the episode and the step it is in. They key every random draw.
WORLD = np.dtype([("seed", np.uint64), ("episode", np.uint64), ("step", np.int64)])


class Worlds(NamedTuple):
    """The whole state of B worlds: the truth, what passes the wall, and the belief's side."""

    clock: np.ndarray  # (B,) WORLD
    vehicles: np.ndarray  # (B, V) VEHICLE
    targets: np.ndarray  # (B, T) TARGET
    fish: np.ndarray  # (B, T, 4, 1) float32: x, y [m], heading [rad], speed [m/s]; a row of one particle
    encounters: np.ndarray  # (B, V, T) ENCOUNTER
    navigation: np.ndarray  # (B, V) NAVIGATION
    measurements: np.ndarray  # (B, V, T) MEASUREMENT
    beliefs: np.ndarray  # (B, O, T) BELIEF
    particles: np.ndarray  # (B, O, T, 4 or 5, N) float32, as fish; the fifth row is an estimated number of the sensor
    carried: np.ndarray  # (B, O, T, N or 0) float32: weights that the particles carry; none where every correction resamples
    listeners: np.ndarray  # (B, V, T) LISTENER
    outlooks: np.ndarray  # (B, V, T) OUTLOOK


class Outputs(NamedTuple):
    """What a step gives back; written over by the next."""

    observation: np.ndarray  # (B, V, D) float32
    terms: np.ndarray  # (B, V, K) float64: the weighted terms of the reward
    error: np.ndarray  # (B, O, T) from estimate to fish [m]
    outcomes: np.ndarray  # (B, V) OUTCOME


TRUTH = ("vehicles", "targets", "fish", "encounters")  # what the belief's half of a step must not read


@compiled
def reset_worlds(first, last, chosen, parameters, tracks, places, worlds, outputs, scratch):
    """Begin an episode in the chosen worlds among first..last-1; vehicles begin at ``places`` (V, 2)."""
    p = parameters[0]
    for b in range(first, last):
        if chosen[b]:
            worlds.clock[b].step = 0
            begin_truth(b, p, tracks, places, worlds, scratch)
            begin_beliefs(b, p, worlds, scratch)
            believe(b, p, worlds, outputs)
            judge(b, p, worlds, outputs)


@compiled
def begin_truth(b, p, tracks, places, worlds, scratch):
    stream = stream_of(worlds.clock[b])
    for v in range(worlds.vehicles.shape[1]):
        launch(worlds.vehicles[b, v], worlds.navigation[b, v], places[v, 0], places[v, 1], stream, v, p.vehicle)
    for t in range(worlds.fish.shape[1]):
        target, fish = worlds.targets[b, t], worlds.fish[b, t]
        place_fish(target, fish, stream, t, p, tracks, scratch)
        for v in range(worlds.vehicles.shape[1]):
            encounter = worlds.encounters[b, v, t]
            open_encounter(encounter, stream, place_of(v, t), p.water, p.clock_sigma)
            meet(encounter, worlds.vehicles[b, v], target, np.float64(fish[0, 0]), np.float64(fish[1, 0]), p.tag.period)
            worlds.measurements[b, v, t].status = Status.ABSENT


@compiled
def place_fish(target, fish, stream, t, p, tracks, scratch):
    """Put a fish at a random bearing and distance from the origin, swimming, with its tag."""
    start_pinging(target, stream, t, p.tag)
    depth, _ = uniform_pair(stream, START, 16 * t + 6)
    target.depth = p.start.shallowest + (p.start.deepest - p.start.shallowest) * depth
    drawn = uniform_pair(stream, START, 16 * t + 7)
    for k in range(DRAWS):
        target.drawn[k] = p.drawn_middle[k] + p.drawn_reach[k] * (2.0 * drawn[k] - 1.0)
    direction, distance = uniform_pair(stream, START, 16 * t + 3)
    distance = p.start.nearest + (p.start.farthest - p.start.nearest) * distance
    fish[0, 0] = distance * math.cos(2.0 * math.pi * direction)
    fish[1, 0] = distance * math.sin(2.0 * math.pi * direction)
    fish[2, 0] = 0.0
    fish[3, 0] = 0.0
    if p.calls.begin != 0:
        begin_at(p.calls.begin)(
            fish, target.memory[:], stream[0], stream[1], stream[2], t, p.fish[:], tracks.position, tracks.last,
            p.episode_steps,
        )  # fmt: skip
    else:
        fill_bits(stream, TRACK + PURPOSES * t, scratch.bits[:4])
        start_swimming(fish, scratch.bits[:4], p.calls.start, p.fish[:])


@compiled
def begin_beliefs(b, p, worlds, scratch):
    stream = stream_of(worlds.clock[b])
    for t in range(worlds.beliefs.shape[2]):
        for o in range(worlds.beliefs.shape[1]):
            own = worlds.navigation[b, o]
            begin_row(
                worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t], own.x, own.y, stream,
                place_of(o, t), p.belief, scratch,
            )  # fmt: skip
        begin_listeners(worlds.listeners[b, :, t], 0.0, p.belief)
        for v in range(worlds.listeners.shape[1]):
            begin_outlook(worlds.outlooks[b, v, t])


@compiled
def step_worlds(first, last, parameters, tracks, actions, worlds, outputs, scratch):
    """Advance worlds first..last-1 by one time step under ``actions`` (B, V, A)."""
    p = parameters[0]
    for b in range(first, last):
        sense(b, p, tracks, actions, worlds, scratch)
        update_beliefs(b, p, worlds, scratch)
        believe(b, p, worlds, outputs)
        judge(b, p, worlds, outputs)


@compiled
def sense_worlds(first, last, parameters, tracks, actions, worlds, outputs, scratch):
    """The first half of ``step_worlds``, up to the wall."""
    for b in range(first, last):
        sense(b, parameters[0], tracks, actions, worlds, scratch)


@compiled
def believe_worlds(first, last, parameters, worlds, outputs, scratch):
    """The second half of ``step_worlds`` but for the referee."""
    for b in range(first, last):
        update_beliefs(b, parameters[0], worlds, scratch)
        believe(b, parameters[0], worlds, outputs)


@compiled
def sense(b, p, tracks, actions, worlds, scratch):
    """Steer, swim, hear: all that happens in the water."""
    clock = worlds.clock[b]
    clock.step += 1
    stream = stream_of(clock)
    shared = worlds.beliefs.shape[1] == 1
    for v in range(worlds.vehicles.shape[1]):
        navigation = worlds.navigation[b, v]
        belief = worlds.beliefs[b, 0 if shared else v, 0]
        course, speed = decode_action(actions[b, v], navigation, belief, p.vehicle.max_speed, p.speed_control, p.by_heading)
        hold_course(worlds.vehicles[b, v], navigation, course, speed, stream, v, p.vehicle, p.time_step)
    before = (clock.step - 1) * p.time_step
    for t in range(worlds.fish.shape[1]):
        target, fish = worlds.targets[b, t], worlds.fish[b, t]
        swim_fish(target, fish, stream, t, p, tracks, clock.step, scratch)
        pinged = ping_within(target, stream, t, p.tag, before, p.time_step)
        x, y = np.float64(fish[0, 0]), np.float64(fish[1, 0])
        for v in range(worlds.vehicles.shape[1]):
            listen(
                worlds.encounters[b, v, t], worlds.vehicles[b, v], worlds.navigation[b, v], target, x, y, pinged,
                worlds.measurements[b, v, t], v, t, stream, p, before + p.time_step,
            )  # fmt: skip


@compiled
def swim_fish(target, fish, stream, t, p, tracks, step, scratch):
    if p.calls.follow != 0:
        follow_at(p.calls.follow)(
            fish, target.memory[:], stream[0], stream[1], stream[2], t, p.fish[:], tracks.position, tracks.last, step,
            p.time_step,
        )  # fmt: skip
    else:
        swim(
            fish, stream, FISH + PURPOSES * t, scratch.bits[:4], scratch.normal_1[:1], scratch.normal_2[:1],
            p.calls.choose, p.fish[:], p.time_step,
        )  # fmt: skip


@compiled
def update_beliefs(b, p, worlds, scratch):
    """Prediction, and correction with whatever the vehicles that share a belief have heard or surely missed."""
    stream = stream_of(worlds.clock[b])
    owners = worlds.beliefs.shape[1]
    for o in range(owners):
        first, last = (0, worlds.navigation.shape[1]) if owners == 1 else (o, o + 1)
        for t in range(worlds.beliefs.shape[2]):
            particles, carried, belief = worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t]
            listeners = worlds.listeners[b, first:last, t]
            predict_row(particles, carried, belief, listeners, stream, place_of(o, t), p.belief, p.time_step, scratch)
            correct_row(
                particles, carried, belief, worlds.measurements[b, first:last, t], listeners, stream, place_of(o, t), p.belief,
                scratch,
            )  # fmt: skip


@compiled
def believe(b, p, worlds, outputs):
    """Condense every belief, and write what each vehicle sees of it."""
    owners, tags = worlds.beliefs.shape[1], worlds.beliefs.shape[2]
    for o in range(owners):
        for t in range(tags):
            own = worlds.navigation[b, o]
            particles, carried, belief = worlds.particles[b, o, t], worlds.carried[b, o, t], worlds.beliefs[b, o, t]
            worlds.outlooks[b, o, t].port = summarize(particles, carried, belief, own.x, own.y, own.heading, p.belief)
    time = worlds.clock[b].step * p.time_step
    size = (outputs.observation.shape[2] - OWN_COUNT) // tags
    for v in range(worlds.navigation.shape[1]):
        navigation = worlds.navigation[b, v]
        o = 0 if owners == 1 else v
        for t in range(tags):
            belief, outlook, listener = worlds.beliefs[b, o, t], worlds.outlooks[b, v, t], worlds.listeners[b, v, t]
            if v != o:
                look_to_port(outlook, worlds.particles[b, o, t], worlds.carried[b, o, t], navigation)
            look(outlook, belief, navigation, p.scale.memory, p.time_step)
            phase = ping_phase(listener, time, p.belief.period, p.belief.random_delay)
            out = outputs.observation[b, v, t * size : (t + 1) * size]
            observe_tag(out, belief, listener, outlook, navigation, phase, p.belief, p.scale)
        observe_own(outputs.observation[b, v, tags * size :], navigation, p.vehicle.max_speed)


@compiled
def judge(b, p, worlds, outputs):
    """The referee: how far the estimates are from the truth, and what that is worth."""
    owners, tags = worlds.beliefs.shape[1], worlds.beliefs.shape[2]
    vehicles = worlds.vehicles.shape[1]
    for o in range(owners):
        for t in range(tags):
            miss_x = worlds.beliefs[b, o, t].estimate_x - np.float64(worlds.fish[b, t, 0, 0])
            miss_y = worlds.beliefs[b, o, t].estimate_y - np.float64(worlds.fish[b, t, 1, 0])
            outputs.error[b, o, t] = math.sqrt(miss_x * miss_x + miss_y * miss_y)
    for v in range(vehicles):
        outcome = outputs.outcomes[b, v]
        outcome.time = worlds.clock[b].step * p.time_step
        outcome.error = 0.0
        outcome.worst_error = 0.0
        outcome.spread = 0.0
        outcome.range = np.inf
        outcome.heard = 0.0
        outcome.tags = tags
        outcome.speed = worlds.vehicles[b, v].speed
        for t in range(tags):
            belief = worlds.beliefs[b, 0 if owners == 1 else v, t]
            error = outputs.error[b, 0 if owners == 1 else v, t]
            outcome.error += error / tags
            outcome.worst_error = max(outcome.worst_error, error)
            outcome.spread += math.sqrt(belief.xx + belief.yy) / tags
            outcome.range = min(outcome.range, worlds.encounters[b, v, t].range)
            outcome.heard += worlds.encounters[b, v, t].heard
        outcome.separation = np.inf
        for other in range(vehicles):
            if other != v:
                dx = worlds.vehicles[b, v].x - worlds.vehicles[b, other].x
                dy = worlds.vehicles[b, v].y - worlds.vehicles[b, other].y
                outcome.separation = min(outcome.separation, math.sqrt(dx * dx + dy * dy))
        for k in range(outputs.terms.shape[2]):
            outputs.terms[b, v, k] = judge_at(p.judges[k])(outcome, p.terms[k * ROW : (k + 1) * ROW])
