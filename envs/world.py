"""One step of every world, as the papers' loop reads: steer, swim, hear, predict, correct, summarize, observe, judge.

All state stands in arrays whose axes come in one order: B worlds, V vehicles, T tags (one fish each), O belief owners, N
particles. ``Simulation`` holds them; the loops here own nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.filter import spread_particles
from tagtrack.envs.belief.summary import summarize
from tagtrack.envs.belief.update import update_belief
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import FISH, PURPOSES, START, TRACK, fill_bits, uniform_pair
from tagtrack.envs.observation import (
    TAG_COUNT,
    decode_action,
    follow_bearing,
    observe_own,
    observe_reading,
    observe_tag,
    ping_phase,
)
from tagtrack.envs.reward import judge
from tagtrack.envs.sim.acoustics import listen, open_contact
from tagtrack.envs.sim.legs import begin_legs, follow_legs
from tagtrack.envs.sim.motion import MotionKind, start_swimming, swim
from tagtrack.envs.sim.replay import begin_replay, follow_track
from tagtrack.envs.sim.tags import ping_within, start_pinging
from tagtrack.envs.sim.vehicle import hold_course, launch

# A world's own numbers: its seed, the episode and the step it is in. They key every random draw.
WORLD = np.dtype([("seed", np.uint64), ("episode", np.uint64), ("step", np.int64)])


class Worlds(NamedTuple):
    """The whole state of B worlds."""

    clock: np.ndarray  # (B,) WORLD
    vehicles: np.ndarray  # (B, V) VEHICLE
    targets: np.ndarray  # (B, T) TARGET
    fish: np.ndarray  # (B, T, 4, 1) float32: x, y [m], heading [rad], speed [m/s]; a row of one particle
    contacts: np.ndarray  # (B, V, T) CONTACT
    beliefs: np.ndarray  # (B, O, T) BELIEF
    particles: np.ndarray  # (B, O, T, 4 or 5, N) float32, as fish; the fifth row is an estimated range of the receiver [m]


class Outputs(NamedTuple):
    """What a step gives back; written over by the next."""

    observation: np.ndarray  # (B, V, D) float32
    terms: np.ndarray  # (B, V, K) float64: the weighted terms of the reward


@compiled
def stream_of(clock):
    """The words that key all draws of one step of one world."""
    seed = clock.seed
    return seed & np.uint64(0xFFFFFFFF), seed >> np.uint64(32), clock.episode, np.uint64(clock.step)


@compiled
def reset_worlds(first, last, chosen, parameters, tracks, worlds, outputs, scratch):
    """Begin an episode in the chosen worlds among first..last-1."""
    p = parameters[0]
    for b in range(first, last):
        if not chosen[b]:
            continue
        clock = worlds.clock[b]
        clock.step = 0
        stream = stream_of(clock)
        for v in range(worlds.vehicles.shape[1]):
            launch(worlds.vehicles[b, v], stream, v, p.vehicle)
        for t in range(worlds.fish.shape[1]):
            place_fish(worlds.targets[b, t], worlds.fish[b, t], stream, t, p, tracks, scratch)
            for v in range(worlds.vehicles.shape[1]):
                contact = worlds.contacts[b, v, t]
                vehicle = worlds.vehicles[b, v]
                index = v * worlds.fish.shape[1] + t
                longest_interval = p.tag.period + p.tag.random_delay
                open_contact(contact, worlds.targets[b, t], stream, index, p.water, p.receiver, longest_interval)
                dx = np.float64(worlds.fish[b, t, 0, 0]) - vehicle.x
                dy = np.float64(worlds.fish[b, t, 1, 0]) - vehicle.y
                contact.range = math.sqrt(dx * dx + dy * dy)
            for o in range(worlds.beliefs.shape[1]):
                row = o * worlds.fish.shape[1] + t
                own = worlds.vehicles[b, o]
                spread_particles(
                    worlds.particles[b, o, t], worlds.beliefs[b, o, t], own.believed_x, own.believed_y,
                    stream, row, p.belief, scratch,
                )  # fmt: skip
        summarize_world(b, worlds, p)
        observe_world(b, worlds, p, outputs)


@compiled
def place_fish(target, fish, stream, t, p, tracks, scratch):
    """Put a fish at a random bearing and distance from the origin, swimming, with its tag."""
    start_pinging(target, stream, t, p.tag)
    depth, _ = uniform_pair(stream, START, 16 * t + 6)
    target.depth = p.start.shallowest + (p.start.deepest - p.start.shallowest) * depth
    reach, reception = uniform_pair(stream, START, 16 * t + 7)
    target.max_range = p.receiver.max_range + p.receiver.max_range_spread * (2.0 * reach - 1.0)
    target.reception = p.receiver.reception + p.receiver.reception_spread * (2.0 * reception - 1.0)
    direction, distance = uniform_pair(stream, START, 16 * t + 3)
    distance = p.start.nearest + (p.start.farthest - p.start.nearest) * distance
    fish[0, 0] = distance * math.cos(2.0 * math.pi * direction)
    fish[1, 0] = distance * math.sin(2.0 * math.pi * direction)
    fish[2, 0] = 0.0
    fish[3, 0] = 0.0
    if p.fish.kind == MotionKind.REPLAY:
        begin_replay(target, fish, stream, t, tracks, p.episode_steps)
    elif p.fish.kind == MotionKind.LEGS:
        begin_legs(target, fish, stream, t, p.fish)
    else:
        fill_bits(stream, TRACK + PURPOSES * t, scratch.bits[:4])
        start_swimming(fish, scratch.bits, p.fish)


@compiled
def step_worlds(first, last, parameters, tracks, actions, worlds, outputs, scratch):
    """Advance worlds first..last-1 by one time step under ``actions`` (B, V, A)."""
    p = parameters[0]
    for b in range(first, last):
        clock = worlds.clock[b]
        clock.step += 1
        stream = stream_of(clock)
        steer_vehicles(b, actions, worlds, p, stream)
        swim_fish(b, tracks, worlds, p, stream, scratch)
        hear_tags(b, worlds, p, stream)
        update_beliefs(b, worlds, p, stream, scratch)
        summarize_world(b, worlds, p)
        observe_world(b, worlds, p, outputs)


@compiled
def steer_vehicles(b, actions, worlds, p, stream):
    shared = worlds.beliefs.shape[1] == 1
    for v in range(worlds.vehicles.shape[1]):
        vehicle = worlds.vehicles[b, v]
        belief = worlds.beliefs[b, 0 if shared else v, 0]
        course, speed = decode_action(actions[b, v], vehicle, belief, p.vehicle.max_speed, p.speed_control)
        hold_course(vehicle, course, speed, stream, v, p.vehicle, p.time_step)


@compiled
def swim_fish(b, tracks, worlds, p, stream, scratch):
    for t in range(worlds.fish.shape[1]):
        fish = worlds.fish[b, t]
        if p.fish.kind == MotionKind.REPLAY:
            follow_track(worlds.targets[b, t], fish, tracks.position, worlds.clock[b].step, p.time_step)
        elif p.fish.kind == MotionKind.LEGS:
            before = (worlds.clock[b].step - 1) * p.time_step
            follow_legs(worlds.targets[b, t], fish, stream, t, p.fish, before, p.time_step)
        else:
            swim(
                fish, stream, FISH + PURPOSES * t, scratch.bits[:4], scratch.normal_1[:1], scratch.normal_2[:1],
                p.fish, p.time_step,
            )  # fmt: skip


@compiled
def hear_tags(b, worlds, p, stream):
    before = (worlds.clock[b].step - 1) * p.time_step
    tags = worlds.fish.shape[1]
    for t in range(tags):
        target = worlds.targets[b, t]
        pinged = ping_within(target, stream, t, p.tag, before, p.time_step)
        x = np.float64(worlds.fish[b, t, 0, 0])
        y = np.float64(worlds.fish[b, t, 1, 0])
        for v in range(worlds.vehicles.shape[1]):
            listen(
                worlds.contacts[b, v, t], worlds.vehicles[b, v], target, x, y, pinged, stream, v * tags + t,
                p.tag, p.water, p.receiver, before + p.time_step, p.time_step,
            )  # fmt: skip


@compiled
def update_beliefs(b, worlds, p, stream, scratch):
    """Prediction, and correction with whatever the vehicles that share a belief have heard or surely missed."""
    owners, tags = worlds.beliefs.shape[1], worlds.beliefs.shape[2]
    vehicles = worlds.vehicles.shape[1]
    for o in range(owners):
        first, last = (0, vehicles) if owners == 1 else (o, o + 1)
        for t in range(tags):
            update_belief(
                worlds.particles[b, o, t], worlds.beliefs[b, o, t],
                worlds.vehicles[b, first:last], worlds.contacts[b, first:last, t],
                stream, o * tags + t, p.belief, p.time_step, scratch,
            )  # fmt: skip


@compiled
def summarize_world(b, worlds, p):
    """Condense every belief, and compare its estimate with the truth."""
    shared = worlds.beliefs.shape[1] == 1
    for t in range(worlds.beliefs.shape[2]):
        for v in range(worlds.vehicles.shape[1]):
            belief = worlds.beliefs[b, 0 if shared else v, t]
            port = summarize(worlds.particles[b, 0 if shared else v, t], belief, worlds.vehicles[b, v], p.belief)
            worlds.contacts[b, v, t].port = port
            follow_bearing(worlds.contacts[b, v, t], worlds.vehicles[b, v], belief, p.scale.memory, p.time_step)
            miss_x = belief.estimate_x - np.float64(worlds.fish[b, t, 0, 0])
            miss_y = belief.estimate_y - np.float64(worlds.fish[b, t, 1, 0])
            belief.error = math.sqrt(miss_x * miss_x + miss_y * miss_y)


@compiled
def observe_world(b, worlds, p, outputs):
    """Write each vehicle's observation and the terms of its reward."""
    shared = worlds.beliefs.shape[1] == 1
    tags = worlds.beliefs.shape[2]
    time = worlds.clock[b].step * p.time_step
    for v in range(worlds.vehicles.shape[1]):
        vehicle = worlds.vehicles[b, v]
        error = 0.0
        nearest = np.inf
        for t in range(tags):
            belief = worlds.beliefs[b, 0 if shared else v, t]
            contact = worlds.contacts[b, v, t]
            out = outputs.observation[b, v, t * TAG_COUNT : (t + 1) * TAG_COUNT]
            observe_tag(out, belief, contact, vehicle, ping_phase(worlds.targets[b, t], contact, p.tag, time), p.scale)
            observe_reading(out, belief, contact, vehicle, p.receiver.kind, p.scale)
            error += belief.error / tags
            nearest = min(nearest, contact.range)
        observe_own(outputs.observation[b, v, tags * TAG_COUNT :], vehicle, p.vehicle.max_speed)
        judge(outputs.terms[b, v], error, nearest, p.reward)
