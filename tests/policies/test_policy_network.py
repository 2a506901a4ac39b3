"""The network alone: its arithmetic by hand, its draws, and what it refuses."""

import copy
import math
import pickle

import numpy as np
import pytest

from tagtrack.policies.network import ACTIVATIONS, NetworkPolicy


def one_neuron(*, algorithm="ppo", activation="relu", log_std=-20.0, seed=0):
    """Two features, one hidden neuron 2 a - b + 0.5, one action 0.25 h - 0.125."""
    weights = {
        "hidden.0.weight": [[2.0], [-1.0]],
        "hidden.0.bias": [0.5],
        "mean.weight": [[0.25]],
        "mean.bias": [-0.125],
    }
    if algorithm == "ppo":
        weights["log_std"] = [log_std]
    else:
        weights |= {"log_std.weight": [[0.0]], "log_std.bias": [log_std]}
    return NetworkPolicy(
        algorithm=algorithm,
        env_id="TagTrack/Pond-v0",
        observation_features=("a", "b"),
        action_names=("course",),
        hidden=(1,),
        activation=activation,
        weights={name: np.array(value, np.float32) for name, value in weights.items()},
        seed=seed,
    )


def test_deterministic_action_of_ppo_is_the_clipped_mean_worked_by_hand():
    # h = 2*1 - 0.5 + 0.5 = 2 -> 0.375;  h = relu(-3.5) = 0 -> -0.125;  h = 20.5 -> 5 -> 1
    observation = np.array([[1, 0.5], [-1, 2], [10, 0]], np.float32)
    action, state = one_neuron().predict(observation, deterministic=True)
    np.testing.assert_array_equal(action, np.array([[0.375], [-0.125], [1]], np.float32))
    assert action.dtype == np.float32
    assert state is None


def test_deterministic_action_of_sac_is_the_tanh_of_the_mean():
    action, _ = one_neuron(algorithm="sac").predict(np.array([1, 0.5], np.float32), deterministic=True)
    assert action == pytest.approx([math.tanh(0.375)], abs=1e-7)


@pytest.mark.parametrize(
    ("name", "at_minus_two", "at_three"),
    [
        ("tanh", math.tanh(-2), math.tanh(3)),
        ("relu", 0, 3),
        ("leaky_relu", -0.02, 3),
        ("elu", math.exp(-2) - 1, 3),
        ("silu", -2 / (1 + math.exp(2)), 3 / (1 + math.exp(-3))),
    ],
)
def test_activation_is_its_formula_and_stays_float32(name, at_minus_two, at_three):
    values = ACTIVATIONS[name](np.array([-2, 3], np.float32))
    assert values == pytest.approx([at_minus_two, at_three], abs=1e-6)
    assert values.dtype == np.float32


@pytest.mark.parametrize("name", ACTIVATIONS)
def test_activation_does_not_overflow(name):
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(ACTIVATIONS[name](np.array([-1e30, 1e30], np.float32))).all()


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("hidden", [(), (7,), (5, 4, 3)])
def test_one_world_alone_acts_as_its_row_of_a_batch(make_policy, algorithm, hidden):
    policy = make_policy(algorithm=algorithm, hidden=hidden)
    observation = np.random.default_rng(1).normal(size=(6, 3)).astype(np.float32)
    batch, _ = policy.predict(observation, deterministic=True)
    assert batch.shape == (6, 2)
    for row, expected in zip(observation, batch, strict=True):
        action, _ = policy.predict(row, deterministic=True)
        assert action.shape == (2,)
        np.testing.assert_allclose(action, expected, atol=1e-6)  # float32 sums may be ordered by the batch's size


def test_no_worlds_get_no_actions(make_policy):
    assert make_policy().predict(np.empty((0, 3), np.float32))[0].shape == (0, 2)


def test_a_call_as_evaluate_policy_makes_it_is_answered(make_policy):
    action, state = make_policy().predict(
        np.zeros((4, 3), np.float32), state=None, episode_start=np.ones(4, bool), deterministic=True
    )
    assert action.shape == (4, 2)
    assert state is None


def test_samples_of_ppo_have_the_mean_and_deviation_asked_for():
    n = 40_000
    policy = one_neuron(log_std=math.log(0.1))
    action, _ = policy.predict(np.tile(np.array([1, 0.5], np.float32), (n, 1)))
    # Five standard errors: of a mean 0.1/sqrt(n), of a standard deviation 0.1/sqrt(2n). The bounds are 6 sigma away.
    assert action.mean() == pytest.approx(0.375, abs=5 * 0.1 / math.sqrt(n))
    assert action.std() == pytest.approx(0.1, abs=5 * 0.1 / math.sqrt(2 * n))


def test_samples_of_sac_are_gaussian_before_the_squash():
    n = 40_000
    policy = one_neuron(algorithm="sac", log_std=math.log(0.1))
    action, _ = policy.predict(np.tile(np.array([1, 0.5], np.float32), (n, 1)))
    before = np.arctanh(action.astype(np.float64))
    assert before.mean() == pytest.approx(0.375, abs=5 * 0.1 / math.sqrt(n))
    assert before.std() == pytest.approx(0.1, abs=5 * 0.1 / math.sqrt(2 * n))


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_samples_never_leave_the_bounds(algorithm):
    policy = one_neuron(algorithm=algorithm, log_std=2.0)
    action, _ = policy.predict(np.zeros((1000, 2), np.float32))
    assert action.dtype == np.float32
    assert np.abs(action).max() <= 1


def test_sac_caps_its_deviation_as_in_training():
    # exp(50) would send every draw to a bound; capped at exp(2) = 7.4 about a tenth stay within atanh(0.7) = 0.87.
    action, _ = one_neuron(algorithm="sac", log_std=50.0).predict(np.zeros((1000, 2), np.float32))
    assert (np.abs(action) < 0.7).mean() > 0.05


def test_draws_follow_the_seed(make_policy):
    observation = np.zeros((8, 3), np.float32)
    first, again, other = (make_policy(seed=seed).predict(observation)[0] for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_deterministic_calls_use_up_no_randomness(make_policy):
    observation = np.zeros((8, 3), np.float32)
    policy, fresh = make_policy(), make_policy()
    policy.predict(observation, deterministic=True)
    np.testing.assert_array_equal(policy.predict(observation)[0], fresh.predict(observation)[0])


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda policy: pickle.loads(pickle.dumps(policy))])
def test_policy_can_be_sent_to_another_process(make_policy, duplicate):
    policy, observation = make_policy(), np.ones((2, 3), np.float32)
    np.testing.assert_array_equal(
        duplicate(policy).predict(observation, deterministic=True)[0],
        policy.predict(observation, deterministic=True)[0],
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_observation_that_is_not_finite_is_refused_by_the_feature_s_name(make_policy, value):
    observation = np.zeros((3, 3), np.float32)
    observation[2, 1] = value
    with pytest.raises(ValueError, match=rf"feature 1 \('bearing'\) of world 2 is {value}"):
        make_policy().predict(observation)
    with pytest.raises(ValueError, match=r"feature 1 \('bearing'\) of world 0"):
        make_policy().predict(observation[2])


@pytest.mark.parametrize("shape", [(), (4,), (2, 4), (1, 1, 3)])
def test_observation_of_another_shape_is_refused(make_policy, shape):
    with pytest.raises(ValueError, match=r"observation has shape .*takes \(B, 3\) or \(3,\)"):
        make_policy().predict(np.zeros(shape, np.float32))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"algorithm": "dqn"}, "unknown algorithm 'dqn': choose one of ppo, sac"),
        ({"activation": "sine"}, "unknown activation 'sine': choose one of tanh, relu"),
        ({"env_id": ""}, "env_id must be the id"),
        ({"env_id": "two\nlines"}, "env_id must be the id"),
        ({"observation_features": ()}, "observation_features must be a tuple"),
        ({"observation_features": ("a", "a", "b")}, "got 'a' twice"),
        ({"action_names": ("course", "")}, "action_names must be a tuple"),
        ({"hidden": (5, 0)}, "hidden must be a tuple of positive layer widths"),
        ({"hidden": (5, 4.0)}, "hidden must be a tuple of positive layer widths"),
        ({"hidden": (5,)}, "is not part of this network"),
        ({"hidden": (5, 4, 3)}, "weight 'hidden.2.weight' is missing"),
        ({"hidden": (5, 3)}, r"weight 'hidden.1.weight' must have shape \(5, 3\), got \(5, 4\)"),
    ],
)
def test_field_that_does_not_fit_is_refused(make_policy, change, message):
    good = make_policy()
    fields = {
        name: getattr(good, name)
        for name in ("algorithm", "env_id", "observation_features", "action_names", "hidden", "activation", "weights")
    }
    with pytest.raises(ValueError, match=message):
        NetworkPolicy(**(fields | change))


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_weights_are_copied_and_cannot_be_written(make_policy, algorithm):
    policy = make_policy(algorithm=algorithm)
    with pytest.raises(ValueError, match="read-only"):
        policy.weights["mean.bias"][0] = 1.0
