"""The vehicle: an Iver2-like unicycle that steers its heading by P control and navigates by GPS, compass and dead reckoning.

Clark et al. 2013, sections 3 and 4.2. Left out: depth, pitch and roll.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.kernels.geometry import wrap_angle
from tagtrack.envs.kernels.random import NAVIGATING, START, STEERING, normal_pair, uniform_pair
from tagtrack.envs.validation import FASTEST, require, settle_numbers


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """Limits, control and navigation of one vehicle."""

    max_speed: float = 1.3  # through the water [m/s]: an Iver2 with a hydrophone frame
    acceleration: float = 0.3  # largest change of speed [m/s^2]
    max_turn_rate: float = 0.15  # [rad/s]: with the high-drag frame a circle of some 9 m at full speed
    heading_gain: float = 0.25  # P control of the heading (4.2) [1/s]
    control_interval: float = 1.0  # of the heading controller (4.2) [s]; a step is cut into so many, evenly
    compass_sigma: float = 0.03  # of each reading, anew [rad]; what it does to dead reckoning is within drift_sigma
    compass_bias: float = 0.0  # standard deviation of an error that lasts the episode, and bends dead reckoning [rad]
    fix_interval: float = 60.0  # time from one GPS fix at the surface to the next [s]; 0: always at the surface
    fix_sigma: float = 0.5  # of a GPS fix, each axis [m]
    drift_sigma: float = 0.05  # growth of the dead-reckoning error, each axis [m per sqrt(s)]
    current_speed: float = 0.0  # of the uniform current that carries the vehicle [m/s]
    current_heading: float = 0.0  # direction it flows to [rad]
    random_current: float = 0.0  # largest speed of a further current, drawn with its direction for each episode [m/s]
    speed_sigma: float = 0.0  # of the speed made good about the one through the water, at each control interval [m/s]
    heading_sigma: float = 0.0  # of the heading about the one steered, at each control interval [rad]
    battery: float = 0.0  # energy at the start [Wh], some 600 in an Iver2; 0: without end
    battery_spread: float = 0.0  # by which share of it, at most, vehicles and episodes have more or less
    hotel_power: float = 20.0  # drawn by all but the propeller [W]
    drive_power: float = 40.0  # drawn by the propeller at max_speed [W]; it goes with the cube of the speed
    arena: float = 0.0  # radius about the origin beyond which the vehicle turns back of itself, as it believes [m]; 0: none

    def __post_init__(self) -> None:
        speeds = ("max_speed", "drift_sigma", "current_speed", "random_current", "speed_sigma")
        settle_numbers(self, **dict.fromkeys(speeds, FASTEST))
        for name in ("max_speed", "acceleration", "max_turn_rate", "heading_gain", "control_interval"):
            require(getattr(self, name) > 0, self, name, "positive")
        for name in ("compass_sigma", "compass_bias", "fix_interval", "fix_sigma", "drift_sigma", "current_speed"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        for name in ("random_current", "speed_sigma", "heading_sigma", "battery", "hotel_power", "drive_power", "arena"):
            require(getattr(self, name) >= 0, self, name, "at least 0")
        require(0 <= self.battery_spread < 1, self, "battery_spread", "at least 0 and below 1")
        require(
            self.heading_gain * self.control_interval < 2,
            self,
            "heading_gain",
            f"below 2 / control_interval ({2 / self.control_interval:g}), or the heading swings ever wider",
        )


# The truth about one vehicle: place [m], heading [rad], speed through the water [m/s], the course it is told to hold, the time
# since its last fix [s], the episode's random current [m/s] and the bias of its compass [rad]; the energy that is left and that
# it began with [J], and whether it had left before this step.
VEHICLE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "x", "y", "heading", "speed", "since_fix", "course", "current_x", "current_y", "compass_bias", "energy", "charge",
        )
    ]
    + [("gone", np.bool_)]
)  # fmt: skip


@inner
def launch(vehicle, navigation, x, y, stream, index, parameters):
    """Put a vehicle at rest at a place [m] of its world, on a random heading, with a fresh GPS fix."""
    error_x, error_y = normal_pair(stream, START, 16 * index)
    turn, compass_error = normal_pair(stream, START, 16 * index + 1)
    vehicle.x = x
    vehicle.y = y
    vehicle.speed = 0.0
    vehicle.heading = wrap_angle(turn * 10.0 * math.pi)  # so wide a normal is uniform on the circle
    vehicle.compass_bias = 0.0
    if parameters.compass_bias > 0.0:
        bias, _ = normal_pair(stream, START, 16 * index + 9)
        vehicle.compass_bias = parameters.compass_bias * bias
    navigation.heading = wrap_angle(vehicle.heading + vehicle.compass_bias + parameters.compass_sigma * compass_error)
    navigation.x = x + parameters.fix_sigma * error_x
    navigation.y = y + parameters.fix_sigma * error_y
    navigation.speed = 0.0
    vehicle.since_fix = 0.0
    vehicle.course = vehicle.heading
    speed, direction = uniform_pair(stream, STEERING, 0)  # one current for all vehicles; step 0 steers none
    speed *= parameters.random_current
    vehicle.current_x = speed * math.cos(2.0 * math.pi * direction)
    vehicle.current_y = speed * math.sin(2.0 * math.pi * direction)
    more, _ = uniform_pair(stream, START, 16 * index + 10)
    vehicle.charge = 3600.0 * parameters.battery * (1.0 + parameters.battery_spread * (2.0 * more - 1.0))
    vehicle.energy = vehicle.charge
    vehicle.gone = False
    navigation.battery = 1.0
    navigation.active = True


@inner
def turn_back(navigation, course, speed, parameters):
    """Course and speed to hold: those asked for, or, where the vehicle believes to have left its arena, back to the origin."""
    if parameters.arena > 0.0 and math.hypot(navigation.x, navigation.y) > parameters.arena:
        return math.atan2(-navigation.y, -navigation.x), parameters.max_speed
    return course, speed


@inner
def draw_power(vehicle, navigation, parameters, time_step):
    """Use up the battery; without any the vehicle's part ends."""
    if parameters.battery > 0.0:
        share = vehicle.speed / parameters.max_speed
        vehicle.energy -= (parameters.hotel_power + parameters.drive_power * share * share * share) * time_step
        navigation.battery = max(vehicle.energy, 0.0) / vehicle.charge
        navigation.active = vehicle.energy > 0.0


@inner
def separation_of(vehicles, navigation, v):
    """Distance from a vehicle to the nearest other one that takes part [m]; infinite where there is none."""
    least = np.inf
    for other in range(vehicles.shape[0]):
        if other != v and navigation[other].active:
            dx = vehicles[v].x - vehicles[other].x
            dy = vehicles[v].y - vehicles[other].y
            least = min(least, math.sqrt(dx * dx + dy * dy))
    return least


@compiled
def hold_course(vehicle, navigation, course, speed, stream, index, parameters, time_step):
    """Hold a course [rad] and a speed [m/s] for one time step, correcting at the control interval."""
    ticks = max(1, int(round(time_step / parameters.control_interval)))
    for tick in range(ticks):
        steer(vehicle, navigation, course, speed, stream, index * ticks + tick, parameters, time_step / ticks)


@compiled
def steer(vehicle, navigation, course, speed, stream, index, parameters, time_step):
    """One correction by P control towards a course [rad] and a speed [m/s]: the compass is what the controller sees."""
    vehicle.course = course
    turn_rate = parameters.heading_gain * wrap_angle(course - navigation.heading)
    turn_rate = min(max(turn_rate, -parameters.max_turn_rate), parameters.max_turn_rate)
    change = parameters.acceleration * time_step
    vehicle.speed += min(max(speed - vehicle.speed, -change), change)
    turn = turn_rate * time_step
    made_good = vehicle.speed
    if parameters.heading_sigma > 0.0 or parameters.speed_sigma > 0.0:
        swerve, slip = normal_pair(stream, STEERING, index)
        turn += parameters.heading_sigma * swerve
        made_good = max(made_good + parameters.speed_sigma * slip, 0.0)
    chord = made_good * time_step
    if abs(turn) > 1e-6:
        chord *= math.sin(0.5 * turn) / (0.5 * turn)  # an arc, not a straight step
    middle = vehicle.heading + 0.5 * turn
    drift_x = parameters.current_speed * math.cos(parameters.current_heading) * time_step + vehicle.current_x * time_step
    drift_y = parameters.current_speed * math.sin(parameters.current_heading) * time_step + vehicle.current_y * time_step
    vehicle.x += chord * math.cos(middle) + drift_x
    vehicle.y += chord * math.sin(middle) + drift_y
    vehicle.heading = wrap_angle(vehicle.heading + turn)
    moved_x, moved_y = chord * math.cos(middle), chord * math.sin(middle)
    if vehicle.compass_bias != 0.0:  # the way through the water, as the compass has it
        reckoned = middle + vehicle.compass_bias
        moved_x, moved_y = chord * math.cos(reckoned), chord * math.sin(reckoned)
    navigate(vehicle, navigation, moved_x, moved_y, stream, index, parameters, time_step)


@inner
def navigate(vehicle, navigation, moved_x, moved_y, stream, index, parameters, time_step):
    """What the vehicle believes: a GPS fix when it is due, dead reckoning through the water (blind to the current) between."""
    noise_x, noise_y = normal_pair(stream, NAVIGATING, 2 * index)
    vehicle.since_fix += time_step
    if vehicle.since_fix >= parameters.fix_interval:
        vehicle.since_fix = 0.0
        navigation.x = vehicle.x + parameters.fix_sigma * noise_x
        navigation.y = vehicle.y + parameters.fix_sigma * noise_y
    else:
        growth = parameters.drift_sigma * math.sqrt(time_step)
        navigation.x += moved_x + growth * noise_x
        navigation.y += moved_y + growth * noise_y
    compass_noise, _ = normal_pair(stream, NAVIGATING, 2 * index + 1)
    navigation.heading = wrap_angle(vehicle.heading + vehicle.compass_bias + parameters.compass_sigma * compass_noise)
    navigation.speed = vehicle.speed
