"""Scenarios, actions and seeds without sense."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tagtrack.envs.overrides import parameter_names
from tagtrack.envs.parallel import TagTrackParallelEnv
from tagtrack.envs.scenario import SCENARIOS
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv
from tagtrack.envs.spaces import observation_space
from tagtrack.envs.task import build_task
from tagtrack.envs.vector import TagTrackVectorEnv
from tagtrack.train.vec_env import TagTrackVecEnv

PARTICLES, STEPS = 32, 4
NAMES = {env_id: parameter_names(scenario) for env_id, scenario in SCENARIOS.items()}
MODELS = (
    "momentum",
    "brownian",
    "levy",
    "boat",
    "acceleration",
    "legs",
    "stereo",
    "range",
    "presence",
    "tdma",
    "none",
    "aott",
)

sizes = st.tuples(st.floats(-1, 10), st.integers(-330, 308)).map(lambda pair: pair[0] * 10.0 ** max(pair[1], -300))
usual = st.floats(0, 100) | st.integers(-2, 20) | st.booleans()
odd: st.SearchStrategy[Any] = st.one_of(
    st.floats(), st.integers(), st.sampled_from([10**401, -(10**30), "1" * 401, "", "nan", "1e999", None, 1j, b"x", [], {}]),
    st.sampled_from(MODELS), st.text(max_size=8), st.lists(st.floats(), max_size=3),
)  # fmt: skip
values = usual | usual | sizes | odd


@st.composite
def scenarios(draw: Any) -> tuple[str, dict[str, Any], dict[str, Any]]:
    env_id = draw(st.sampled_from(list(SCENARIOS)))
    names = draw(
        st.lists(st.sampled_from(NAMES[env_id]) | st.sampled_from(["fish", "belief", "modem"]), max_size=3, unique=True)
    )
    overrides = {name: draw(values) for name in names}
    # Small, or the time goes into particles and steps.
    options = {"particles": PARTICLES, "vehicles": draw(st.sampled_from([None, None, 2, values])), "tags": None}
    if not isinstance(options["vehicles"], (int, type(None))):
        options["vehicles"] = draw(values)
    options["modem"] = draw(st.sampled_from([None, "none", "instant", "tdma"])) if options["vehicles"] == 2 else None
    overrides.pop("belief.particles", None)
    return env_id, overrides, options


def try_scenario(asked: tuple[str, dict[str, Any], dict[str, Any]]) -> None:
    env_id, overrides, options = asked
    try:
        task = build_task(env_id, overrides=overrides, **options)
        simulation = Simulation(task.scenario, tracks=task.tracks)
    except ValueError as error:
        assert "\n" not in str(error)
        return
    space = observation_space(task.scenario)
    simulation.reset(3)
    generator = np.random.default_rng(0)
    for _ in range(STEPS):
        simulation.step(generator.uniform(-1, 1, simulation._actions.shape).astype(np.float32))
        assert np.isfinite(simulation.reward).all(), simulation.reward
        for row in simulation.observation.reshape(-1, simulation.observation.shape[-1]):
            assert space.contains(row), row
        assert np.isfinite(simulation.error).all() and np.isfinite(simulation.mean).all()
        assert np.isfinite(simulation.covariance).all()


@cache
def shells() -> dict[str, Any]:
    made: dict[str, Any] = {
        "single": TagTrackEnv(particles=PARTICLES),
        "team": TagTrackEnv(particles=PARTICLES, vehicles=2),
        "vector": TagTrackVectorEnv(num_envs=2, particles=PARTICLES),
        "sb3": TagTrackVecEnv(num_envs=2, particles=PARTICLES),
        "parallel": TagTrackParallelEnv(particles=PARTICLES, vehicles=2),
    }
    return made


numbers = st.one_of(
    st.floats(), st.integers(), st.floats(-1, 1), st.booleans(), st.none(), st.complex_numbers(), st.text(max_size=3)
)
nested: st.SearchStrategy[Any] = st.recursive(
    numbers, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner), max_leaves=6
)
kinds = st.sampled_from(["f4", "f8", "f2", "i8", "u1", "c16", "?", "O", "M8[s]", "U3"])
arrays = st.tuples(kinds, st.lists(st.integers(0, 3), max_size=3)).map(
    lambda given: np.ones(given[1], "i8").astype(given[0])
)
fitting = st.sampled_from([(2,), (1, 2), (2, 2), (2, 1, 2)]).flatmap(
    lambda shape: st.lists(
        st.floats(width=32) | st.floats(-1, 1), min_size=int(np.prod(shape)), max_size=int(np.prod(shape))
    ).map(lambda flat: np.array(flat).reshape(shape))
)
actions = st.tuples(
    st.sampled_from(["single", "team", "vector", "sb3", "parallel"]),
    fitting | arrays | nested,
    nested | st.integers(0, 9) | st.none(),
)


def try_actions(asked: tuple[str, Any, Any]) -> None:
    from gymnasium.error import Error

    name, action, seed = asked
    shell = shells()[name]
    try:
        if name == "sb3":
            shell.seed(seed)
            shell.reset()
        else:
            shell.reset(seed=seed)
    except (ValueError, Error) as error:
        assert "\n" not in str(error)
    if name == "sb3":
        shell.seed(1), shell.reset()
    else:
        shell.reset(seed=1)
    try:
        if name == "parallel" and not isinstance(action, dict):
            action = {"auv_0": np.zeros(2, np.float32), "auv_1": action}
        observed = shell.step(action)
    except ValueError as error:
        assert "\n" not in str(error)
        return
    parts = [*observed[0].values(), *observed[1].values()] if name == "parallel" else observed[:2]
    assert all(np.isfinite(part).all() for part in parts)


WORLDS = {"overrides": (try_scenario, scenarios()), "actions": (try_actions, actions)}
