"""All that happens in the water: vehicles are launched, steer and send, fish swim, tags ping, hydrophones and modems hear."""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.compiling import inner, outlined
from tagtrack.envs.kernels.random import FISH, PURPOSES, START, TRACK, fill_bits, place_of, stream_of, uniform_pair
from tagtrack.envs.measurement import Status
from tagtrack.envs.motions.motion import begin_at, follow_at, start_swimming, swim
from tagtrack.envs.observation import choose_tag, decode_action
from tagtrack.envs.sensors.sensor import DRAWS
from tagtrack.envs.sim.acoustics import is_destroyed, listen, meet, open_encounter
from tagtrack.envs.sim.modem import call_out, open_radio
from tagtrack.envs.sim.tags import ping_within, start_pinging
from tagtrack.envs.sim.vehicle import draw_power, hold_course, launch, turn_back


@outlined
def begin_truth(b, p, tracks, places, worlds, scratch):
    """Launch the vehicles at ``places`` (V, 2), put the fish in the water, and let nobody have heard or sent anything."""
    stream = stream_of(worlds.clock[b])
    for v in range(worlds.vehicles.shape[1]):
        launch(worlds.vehicles[b, v], worlds.navigation[b, v], places[v, 0], places[v, 1], stream, v, p.vehicle)
        open_radio(worlds.radios[b, v], worlds.arrivals[b, v])
        worlds.mail[b, v, :] = 0
    for t in range(worlds.fish.shape[1]):
        target, fish = worlds.targets[b, t], worlds.fish[b, t]
        place_fish(target, fish, stream, t, p, tracks, scratch)
        for v in range(worlds.vehicles.shape[1]):
            encounter = worlds.encounters[b, v, t]
            open_encounter(encounter, stream, place_of(v, t), p.water, p.clock_sigma)
            meet(encounter, worlds.vehicles[b, v], target, np.float64(fish[0, 0]), np.float64(fish[1, 0]), p.tag.period)
            worlds.measurements[b, v, t].status = Status.ABSENT


@inner
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


@inner
def sense(b, p, tracks, actions, worlds, scratch):
    """Steer, swim, hear: the first part of a step."""
    worlds.clock[b].step += 1
    steer_vehicles(b, p, actions, worlds, stream_of(worlds.clock[b]))
    live_on(b, p, tracks, worlds, scratch)


@inner
def sail(b, p, tracks, orders, worlds, scratch):
    """As ``sense``, for vehicles that are told course [rad] and speed [m/s] themselves, (V, 2) ``orders``."""
    worlds.clock[b].step += 1
    stream = stream_of(worlds.clock[b])
    for v in range(worlds.vehicles.shape[1]):
        vehicle, navigation = worlds.vehicles[b, v], worlds.navigation[b, v]
        hold_course(vehicle, navigation, orders[v, 0], orders[v, 1], stream, v, p.vehicle, p.time_step)
        draw_power(vehicle, navigation, p.vehicle, p.time_step)
    live_on(b, p, tracks, worlds, scratch)


@inner
def live_on(b, p, tracks, worlds, scratch):
    """Fish swim, tags ping, hydrophones and modems hear, once the vehicles have moved."""
    clock = worlds.clock[b]
    stream = stream_of(clock)
    before = (clock.step - 1) * p.time_step
    for t in range(worlds.fish.shape[1]):
        target = worlds.targets[b, t]
        swim_fish(target, worlds.fish[b, t], stream, t, p, tracks, clock.step, scratch)
        target.pinged = ping_within(target, stream, t, p.tag, before, p.time_step)
    hear_tags(b, p, worlds, stream, before + p.time_step)
    if p.modem.calls:
        call_out(worlds.mail[b], worlds.packets[b], worlds.navigation[b], stream, p.modem)


@inner
def steer_vehicles(b, p, actions, worlds, stream):
    """Vehicles that take part hold their courses for a step; the others stay where they left."""
    shared = worlds.beliefs.shape[1] == 1
    for v in range(worlds.vehicles.shape[1]):
        vehicle, navigation = worlds.vehicles[b, v], worlds.navigation[b, v]
        vehicle.gone = not navigation.active
        if vehicle.gone:
            continue
        action = actions[b, v]
        belief = worlds.beliefs[b, 0 if shared else v, choose_tag(action, worlds.beliefs.shape[2], p.speed_control, p.frame)]
        course, speed = decode_action(action, navigation, belief, p.vehicle.max_speed, p.speed_control, p.frame)
        course, speed = turn_back(navigation, course, speed, p.vehicle)
        hold_course(vehicle, navigation, course, speed, stream, v, p.vehicle, p.time_step)
        draw_power(vehicle, navigation, p.vehicle, p.time_step)


@inner
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


@inner
def hear_tags(b, p, worlds, stream, time):
    """Every vehicle that takes part listens for every tag."""
    for t in range(worlds.targets.shape[1]):
        target = worlds.targets[b, t]
        x, y = np.float64(worlds.fish[b, t, 0, 0]), np.float64(worlds.fish[b, t, 1, 0])
        for v in range(worlds.vehicles.shape[1]):
            vehicle, navigation = worlds.vehicles[b, v], worlds.navigation[b, v]
            if not navigation.active:
                worlds.encounters[b, v, t].heard = False
                worlds.measurements[b, v, t].status = Status.ABSENT
                continue
            destroyed = False
            if p.tag.burst > 0.0 and target.pinged:
                destroyed = is_destroyed(vehicle, worlds.targets[b], worlds.fish[b], v, t, stream, p)
            listen(
                worlds.encounters[b, v, t], vehicle, navigation, target, x, y, destroyed,
                worlds.measurements[b, v, t], v, t, stream, p, time,
            )  # fmt: skip
