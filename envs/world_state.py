"""The whole state of B worlds and what a step gives back, as arrays; and which of them hold the truth.

Axes come in one order: B worlds, V vehicles, T tags (one fish each), O belief owners, N particles. ``Simulation`` holds the
arrays; the loops of ``world.py`` own nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tagtrack.envs.belief.assumptions import Belief
from tagtrack.envs.belief.row import BELIEF
from tagtrack.envs.measurement import LISTENER, MEASUREMENT, NAVIGATION
from tagtrack.envs.message import MATE, PACKET, RADIO
from tagtrack.envs.observation import OUTLOOK
from tagtrack.envs.sensors.sensor import ENCOUNTER
from tagtrack.envs.sim.modem import ModemRule
from tagtrack.envs.sim.tags import TARGET
from tagtrack.envs.sim.vehicle import VEHICLE

# A world's own numbers: its seed, the episode and the step it is in. They key every random draw.
WORLD = np.dtype([("seed", np.uint64), ("episode", np.uint64), ("step", np.int64)])


class Worlds(NamedTuple):
    """The truth, what passes the wall, and the belief's side. What talking needs has no size where nobody talks."""

    clock: np.ndarray  # (B,) WORLD
    vehicles: np.ndarray  # (B, V) VEHICLE
    targets: np.ndarray  # (B, T) TARGET
    fish: np.ndarray  # (B, T, 4, 1) float32: x, y [m], heading [rad], speed [m/s]; a row of one particle
    encounters: np.ndarray  # (B, V, T) ENCOUNTER
    arrivals: np.ndarray  # (B, V, D, V) when the packets of a sender, D at once, come to each vehicle [s]; infinite: never
    navigation: np.ndarray  # (B, V) NAVIGATION
    measurements: np.ndarray  # (B, V, T) MEASUREMENT
    beliefs: np.ndarray  # (B, O, T) BELIEF
    particles: np.ndarray  # (B, O, T, 4 or 5, N) float32, as fish; the fifth row is an estimated number of the sensor
    carried: np.ndarray  # (B, O, T, N or 0) float32: weights that the particles carry; none where every correction resamples
    listeners: np.ndarray  # (B, O, T, V) LISTENER: what each belief remembers of the vehicles that tell it something
    outlooks: np.ndarray  # (B, V, T) OUTLOOK
    mates: np.ndarray  # (B, V, V) MATE: what each vehicle knows of each
    radios: np.ndarray  # (B, V) RADIO
    outbox: np.ndarray  # (B, V, M) MEASUREMENT that wait to be sent, the newest first
    packets: np.ndarray  # (B, V, D) PACKET
    letters: np.ndarray  # (B, V, D, M) MEASUREMENT
    mail: np.ndarray  # (B, V, V) which packet of the second has just come to the first: 1 + its place, 0: none
    since: np.ndarray  # (B, O, T) int64: the step from which on each belief goes through this one
    past_particles: np.ndarray  # (B, O, T, K, 4 or 5, N): see ``belief.hindsight.Past``, as the next five
    past_carried: np.ndarray  # (B, O, T, K, N or 0)
    past_beliefs: np.ndarray  # (B, O, T, K)
    past_listeners: np.ndarray  # (B, O, T, K, V)
    past_measurements: np.ndarray  # (B, O, T, K, V); at least this step's
    past_poses: np.ndarray  # (B, O, T, K), as well


class Outputs(NamedTuple):
    """What a step gives back; written over by the next."""

    observation: np.ndarray  # (B, V, D) float32
    terms: np.ndarray  # (B, V, K) float64: the weighted terms of the reward
    error: np.ndarray  # (B, O, T) from estimate to fish [m]
    outcomes: np.ndarray  # (B, V) OUTCOME


TRUTH = ("vehicles", "targets", "fish", "encounters", "arrivals")  # what the belief's half of a step must not read


def make_worlds(b: int, v: int, t: int, o: int, belief: Belief, modem: ModemRule) -> Worlds:
    """The state of ``b`` worlds, all zero."""
    d, m, k = modem.flights, modem.letters, modem.remembered
    return Worlds(
        clock=np.zeros(b, WORLD),
        vehicles=np.zeros((b, v), VEHICLE),
        targets=np.zeros((b, t), TARGET),
        fish=np.zeros((b, t, 4, 1), np.float32),
        encounters=np.zeros((b, v, t), ENCOUNTER),
        arrivals=np.zeros((b, v, d, v)),
        navigation=np.zeros((b, v), NAVIGATION),
        measurements=np.zeros((b, v, t), MEASUREMENT),
        beliefs=np.zeros((b, o, t), BELIEF),
        particles=np.zeros((b, o, t, belief.rows, belief.particles), np.float32),
        carried=np.ones((b, o, t, belief.carried), np.float32),
        listeners=np.zeros((b, o, t, v), LISTENER),
        outlooks=np.zeros((b, v, t), OUTLOOK),
        mates=np.zeros((b, v, v), MATE),
        radios=np.zeros((b, v), RADIO),
        outbox=np.zeros((b, v, m), MEASUREMENT),
        packets=np.zeros((b, v, d), PACKET),
        letters=np.zeros((b, v, d, m), MEASUREMENT),
        mail=np.zeros((b, v, v), np.int64),
        since=np.zeros((b, o, t), np.int64),
        past_particles=np.zeros((b, o, t, k, belief.rows, belief.particles), np.float32),
        past_carried=np.zeros((b, o, t, k, belief.carried), np.float32),
        past_beliefs=np.zeros((b, o, t, k), BELIEF),
        past_listeners=np.zeros((b, o, t, k, v), LISTENER),
        past_measurements=np.zeros((b, o, t, max(k, 1), v), MEASUREMENT),
        past_poses=np.zeros((b, o, t, max(k, 1)), NAVIGATION),
    )
