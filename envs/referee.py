"""The referee: how far the estimates are from the truth, what else a step came to, and what that is worth."""

from __future__ import annotations

import math

import numpy as np

from tagtrack.envs.kernels.calling import ROW
from tagtrack.envs.kernels.compiling import compiled, inner
from tagtrack.envs.rewards.term import judge_at
from tagtrack.envs.sim.vehicle import separation_of

LONE = 14  # numbers that ``gather_lone`` tells before the terms of the reward


@inner
def judge(b, p, worlds, outputs):
    """Errors, outcomes and terms of the reward of one world."""
    owners, tags = worlds.beliefs.shape[1], worlds.beliefs.shape[2]
    for o in range(owners):
        for t in range(tags):
            miss_x = worlds.beliefs[b, o, t].estimate_x - np.float64(worlds.fish[b, t, 0, 0])
            miss_y = worlds.beliefs[b, o, t].estimate_y - np.float64(worlds.fish[b, t, 1, 0])
            outputs.error[b, o, t] = math.sqrt(miss_x * miss_x + miss_y * miss_y)
    for v in range(worlds.vehicles.shape[1]):
        outcome = outputs.outcomes[b, v]
        sum_up(b, v, p, worlds, outputs.error[b], outcome)
        for k in range(outputs.terms.shape[2]):
            outputs.terms[b, v, k] = 0.0
            if not worlds.vehicles[b, v].gone:
                outputs.terms[b, v, k] = judge_at(p.judges[k])(outcome, p.terms[k * ROW : (k + 1) * ROW])
    if p.shared_reward:
        share(worlds.vehicles[b], outputs.terms[b])


@inner
def sum_up(b, v, p, worlds, error, outcome):
    """What the step came to for one vehicle."""
    owners, tags = error.shape
    o = 0 if owners == 1 else v
    outcome.time = worlds.clock[b].step * p.time_step
    outcome.error = 0.0
    outcome.worst_error = 0.0
    outcome.spread = 0.0
    outcome.range = np.inf
    outcome.heard = 0.0
    outcome.tags = tags
    outcome.speed = worlds.vehicles[b, v].speed
    for t in range(tags):
        belief = worlds.beliefs[b, o, t]
        outcome.error += error[o, t] / tags
        outcome.worst_error = max(outcome.worst_error, error[o, t])
        outcome.spread += math.sqrt(belief.xx + belief.yy) / tags
        outcome.range = min(outcome.range, worlds.encounters[b, v, t].range)
        outcome.heard += worlds.encounters[b, v, t].heard
    was_close = worlds.clock[b].step > 0 and outcome.separation < p.least_separation
    outcome.separation = np.inf
    if worlds.vehicles.shape[1] > 1 and worlds.navigation[b, v].active:
        outcome.separation = separation_of(worlds.vehicles[b], worlds.navigation[b], v)
    if worlds.clock[b].step == 0:
        outcome.encroachments = 0.0
    if outcome.separation < p.least_separation and not was_close:
        outcome.encroachments += 1.0
    outcome.messages = worlds.radios[b, v].sent_now


@inner
def share(vehicles, terms):
    """Give every vehicle that takes part the mean over all of them."""
    for k in range(terms.shape[1]):
        total, count = 0.0, 0
        for v in range(vehicles.shape[0]):
            if not vehicles[v].gone:
                total += terms[v, k]
                count += 1
        for v in range(vehicles.shape[0]):
            if not vehicles[v].gone:
                terms[v, k] = total / count


@compiled
def gather_lone(encounters, vehicles, fish, beliefs, navigation, error, terms, told):
    """Put side by side what is told of the one vehicle and the one tag of one world: ``told`` (14 + K,).

    Error, range, mean (2), covariance (4), where the vehicle believes it is (2), where it is (2), where the fish is (2), terms.
    """
    belief, known, true = beliefs[0, 0, 0], navigation[0, 0], vehicles[0, 0]
    told[0], told[1] = error[0, 0, 0], encounters[0, 0, 0].range
    told[2], told[3] = belief.mean_x, belief.mean_y
    told[4], told[5], told[6], told[7] = belief.xx, belief.xy, belief.xy, belief.yy
    told[8], told[9] = known.x, known.y
    told[10], told[11] = true.x, true.y
    told[12], told[13] = fish[0, 0, 0, 0], fish[0, 0, 1, 0]
    for k in range(terms.shape[2]):
        told[LONE + k] = terms[0, 0, k]
