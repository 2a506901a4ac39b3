"""One time step of a belief: predict, weigh what was heard or surely missed, resample, recover."""

from __future__ import annotations

from tagtrack.envs.belief.filter import correct, draw_by_weight, predict
from tagtrack.envs.belief.recovery import follow_likelihood, scatter_share, wants_second_resampling
from tagtrack.envs.belief.renewal import is_refuted, renew, scatter_on_ring
from tagtrack.envs.belief.weighing import begin_weights, is_valid, weigh
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.kernels.random import RESAMPLE, uniform_pair
from tagtrack.envs.sim.receivers import ReceiverKind


@compiled
def update_belief(particles, belief, vehicles, contacts, stream, row, rule, time_step, scratch):
    """Prediction, and correction with the ``contacts`` (V,) of the ``vehicles`` (V,) that share the belief."""
    predict(particles, belief, stream, row, rule, time_step, scratch)
    told = 0
    heard = 0
    last = 0  # vehicle that heard something, or else that was told by silence
    for v in range(contacts.shape[0]):
        if is_told(contacts[v], rule):
            told += 1
            heard += contacts[v].detected
            if contacts[v].detected or heard == 0:
                last = v
    if told == 0:
        return
    renew(particles, belief, stream, row, rule)
    weigh_all(particles, vehicles, contacts, rule, scratch)
    ranged = rule.receiver.kind == ReceiverKind.RANGE and heard > 0
    if ranged and (belief.corrections == 0 or is_refuted(scratch.weight, heard, rule)):
        scatter_on_ring(particles, vehicles[last], contacts[last], stream, row, rule, scratch)
        begin_weights(scratch)
        weigh(particles, vehicles[last], contacts[last], rule, scratch)
    share = follow_likelihood(belief, scratch.weight, told, rule.recovery) if rule.recovery.fast_rate > 0.0 else 0.0
    correct(particles, belief, stream, row, rule, scratch)
    if rule.recovery.fast_rate > 0.0:
        recover(particles, belief, vehicles, contacts, last, share, stream, row, rule, scratch)


@compiled
def is_told(contact, rule):
    """Whether a vehicle has heard something that the filter uses, or surely missed a ping."""
    if contact.detected:
        return is_valid(contact, rule)
    return contact.missed and rule.receiver.max_range > 0.0


@compiled
def weigh_all(particles, vehicles, contacts, rule, scratch):
    """The weights by the readings of all vehicles."""
    begin_weights(scratch)
    for v in range(contacts.shape[0]):
        if is_told(contacts[v], rule):
            weigh(particles, vehicles[v], contacts[v], rule, scratch)


@compiled
def recover(particles, belief, vehicles, contacts, last, share, stream, row, rule, scratch):
    """Random particles, and the second resampling that judges them (Lin et al. 2013, Alg. 2)."""
    scatter_share(particles, share, vehicles[last], stream, row, rule.half_width)
    if wants_second_resampling(share, rule.recovery):
        weigh_all(particles, vehicles, contacts, rule, scratch)
        _, offset = uniform_pair(stream, RESAMPLE, row)
        draw_by_weight(particles, belief, offset, rule, scratch)
