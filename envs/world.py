"""One step of every world, as the papers' loop reads: steer, swim, hear | predict, correct, summarize, observe | judge.

The wall runs between hearing and predicting: what the belief and the observation are given of a world are its vehicles'
navigation and their measurements. Only the referee, at the end, sets estimates beside the truth. The three parts are in
``sensing.py``, ``believing.py`` and ``referee.py``, the state they share in ``world_state.py``; fleets that talk do so between
two steps, in ``exchange.py``.
"""

from __future__ import annotations

from tagtrack.envs.believing import begin_beliefs, condense, look_first, meet_mates, note_told, observe_all, update_beliefs
from tagtrack.envs.kernels.compiling import compiled
from tagtrack.envs.observation import choose_tag, decode_action
from tagtrack.envs.referee import judge
from tagtrack.envs.sensing import begin_truth, sail, sense
from tagtrack.envs.sim.vehicle import turn_back


@compiled
def reset_worlds(first, last, chosen, parameters, tracks, places, worlds, outputs, scratch):
    """Begin an episode in the chosen worlds among first..last-1; vehicles begin at ``places`` (V, 2)."""
    p = parameters[0]
    for b in range(first, last):
        if chosen[b]:
            worlds.clock[b].step = 0
            begin_truth(b, p, tracks, places, worlds, scratch)
            begin_beliefs(b, p, worlds, scratch)
            condense(b, p, worlds)
            observe_all(b, p, worlds, outputs)
            judge(b, p, worlds, outputs)


@compiled
def step_worlds(first, last, parameters, tracks, actions, worlds, outputs, scratch):
    """Advance worlds first..last-1 by one time step under ``actions`` (B, V, A)."""
    p = parameters[0]
    for b in range(first, last):
        sense(b, p, tracks, actions, worlds, scratch)
        note_told(b, p, worlds)
        update_beliefs(b, worlds.clock[b].step, p, worlds, scratch)
        meet_mates(b, p, worlds)
        observe_all(b, p, worlds, outputs)
        judge(b, p, worlds, outputs)


@compiled
def sense_worlds(first, last, parameters, tracks, actions, worlds, outputs, scratch):
    """The first half of ``step_worlds``, up to the wall."""
    for b in range(first, last):
        p = parameters[0]
        sense(b, p, tracks, actions, worlds, scratch)


@compiled
def sail_worlds(first, last, parameters, tracks, orders, worlds, outputs, scratch):
    """A step of the truth alone, under courses and speeds ``orders`` (B, V, 2) that somebody else has given."""
    for b in range(first, last):
        p = parameters[0]
        sail(b, p, tracks, orders[b], worlds, scratch)


@compiled
def believe_worlds(first, last, parameters, worlds, outputs, scratch):
    """The second half of ``step_worlds`` but for the referee."""
    for b in range(first, last):
        p = parameters[0]
        note_told(b, p, worlds)
        update_beliefs(b, worlds.clock[b].step, p, worlds, scratch)
        meet_mates(b, p, worlds)
        observe_all(b, p, worlds, outputs)


@compiled
def observe_worlds(first, last, parameters, worlds, outputs, scratch):
    """What vehicles see of beliefs that were brought up to date elsewhere (``tagtrack.live``)."""
    for b in range(first, last):
        p = parameters[0]
        if worlds.clock[b].step == 0:
            look_first(b, worlds)
        condense(b, p, worlds)
        observe_all(b, p, worlds, outputs)


@compiled
def order_worlds(first, last, parameters, actions, worlds, orders, scratch):
    """Course [rad] and speed [m/s] that each vehicle would hold under its action: ``orders`` (B, V, 2)."""
    for b in range(first, last):
        p = parameters[0]
        owners = worlds.beliefs.shape[1]
        for v in range(worlds.navigation.shape[1]):
            navigation, action = worlds.navigation[b, v], actions[b, v]
            tag = choose_tag(action, worlds.beliefs.shape[2], p.speed_control, p.frame)
            belief = worlds.beliefs[b, 0 if owners == 1 else v, tag]
            course, speed = decode_action(action, navigation, belief, p.vehicle.max_speed, p.speed_control, p.frame)
            course, speed = turn_back(navigation, course, speed, p.vehicle)
            orders[b, v, 0] = course
            orders[b, v, 1] = speed
