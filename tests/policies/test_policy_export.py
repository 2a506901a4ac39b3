"""The exported policy acts as the Stable-Baselines3 model it was taken from."""

import math

import gymnasium
import numpy as np
import pytest

from tagtrack.policies.export import from_stable_baselines3
from tagtrack.policies.files import load_policy, save_policy

torch = pytest.importorskip("torch")
sb3 = pytest.importorskip("stable_baselines3")
torch.set_num_threads(1)

NAMES = {"env_id": "TagTrack/Pond-v0", "observation_features": ("a", "b", "c"), "action_names": ("course", "speed")}


class Pond(gymnasium.Env):
    """Random observations, reward for acting as the first two of them; ends after 20 steps."""

    def __init__(self, *, low=-1.0, shape=(3,)):
        self.observation_space = gymnasium.spaces.Box(-5, 5, shape, np.float32)
        self.action_space = gymnasium.spaces.Box(low, 1, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self._observe(), {}

    def step(self, action):
        self.steps += 1
        reward = -float(np.square(action - self.observation.flat[:2]).sum())
        return self._observe(), reward, False, self.steps == 20, {}

    def _observe(self):
        self.observation = self.np_random.uniform(-2, 2, self.observation_space.shape).astype(np.float32)
        return self.observation


def make_model(algorithm, *, env=None, scale=0.4, **policy_kwargs):
    """An untrained model with weights large enough to bend the activations and reach the bounds."""
    kind = {"ppo": sb3.PPO, "sac": sb3.SAC}[algorithm]
    model = kind("MlpPolicy", env or Pond(), device="cpu", seed=0, policy_kwargs=policy_kwargs)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=generator) * scale)
    return model


def observations(count=200):
    return np.random.default_rng(0).uniform(-3, 3, (count, 3)).astype(np.float32)


def assert_acts_alike(policy, model):
    expected, _ = model.predict(observations(), deterministic=True)
    action, _ = policy.predict(observations(), deterministic=True)
    np.testing.assert_allclose(action, expected, atol=1e-5)
    one, _ = policy.predict(observations()[0], deterministic=True)
    np.testing.assert_allclose(one, model.predict(observations()[0], deterministic=True)[0], atol=1e-5)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
@pytest.mark.parametrize("activation", ["Tanh", "ReLU", "LeakyReLU", "ELU", "SiLU"])
@pytest.mark.parametrize("net_arch", [[], [16], [32, 8, 16]])
def test_deterministic_action_equals_the_model_s(algorithm, activation, net_arch):
    model = make_model(algorithm, net_arch=net_arch, activation_fn=getattr(torch.nn, activation))
    assert_acts_alike(from_stable_baselines3(model, **NAMES), model)


def test_actor_s_own_layers_are_taken_not_the_critic_s():
    model = make_model("ppo", net_arch={"pi": [8], "vf": [16, 16]})
    policy = from_stable_baselines3(model, **NAMES)
    assert policy.hidden == (8,)
    assert_acts_alike(policy, model)


def test_trained_policy_survives_a_round_trip_and_stays_when_the_model_trains_on(tmp_path):
    model = sb3.PPO("MlpPolicy", Pond(), device="cpu", seed=0, n_steps=64, batch_size=64, n_epochs=2)
    model.learn(128)
    policy = from_stable_baselines3(model, **NAMES)
    save_policy(tmp_path, policy)
    assert_acts_alike(load_policy(tmp_path, NAMES["observation_features"]), model)
    before, _ = policy.predict(observations(), deterministic=True)
    model.learn(128)
    after, _ = policy.predict(observations(), deterministic=True)
    np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_draws_have_the_model_s_distribution(algorithm):
    n = 20_000
    model = make_model(algorithm, scale=0.3, net_arch=[8])
    policy = from_stable_baselines3(model, seed=1, **NAMES)
    observation = np.tile(np.array([0.5, -0.2, 0.3], np.float32), (n, 1))
    expected, _ = model.predict(observation)
    action, _ = policy.predict(observation)
    # Five standard errors of the difference of two means and of two standard deviations. Clipping and squashing
    # shorten the tails, so that the Gaussian's standard error of a standard deviation, std/sqrt(2n), is an upper limit.
    deviation = expected.std(axis=0)
    assert np.all(np.abs(action.mean(axis=0) - expected.mean(axis=0)) < 5 * deviation * math.sqrt(2 / n))
    assert np.all(np.abs(action.std(axis=0) - deviation) < 5 * deviation / math.sqrt(n))
    # The share at a bound shows a clip apart from a squash: 5 standard errors of a difference of shares.
    assert abs((np.abs(action) == 1).mean() - (np.abs(expected) == 1).mean()) < 5 * math.sqrt(2 * 0.25 / (2 * n))


def test_evaluate_policy_of_sb3_takes_an_exported_policy():
    from stable_baselines3.common.evaluation import evaluate_policy

    model = make_model("ppo")
    policy = from_stable_baselines3(model, **NAMES)
    ours, theirs = (
        evaluate_policy(each, sb3.common.env_util.make_vec_env(Pond, 2, seed=0), n_eval_episodes=4, warn=False)
        for each in (policy, model)
    )
    assert ours == pytest.approx(theirs, rel=1e-4)


def test_other_algorithm_is_refused():
    with pytest.raises(ValueError, match="cannot export a model of TD3: PPO and SAC can be exported"):
        from_stable_baselines3(sb3.TD3("MlpPolicy", Pond(), device="cpu", buffer_size=10), **NAMES)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_unknown_activation_is_refused(algorithm):
    with pytest.raises(ValueError, match=r"cannot export activation Softplus.*: use one of Tanh\(\), ReLU\(\)"):
        from_stable_baselines3(make_model(algorithm, activation_fn=torch.nn.Softplus), **NAMES)


def test_activation_with_another_parameter_is_refused():
    with pytest.raises(ValueError, match=r"cannot export activation ELU\(alpha=2.0\)"):
        from_stable_baselines3(make_model("ppo", activation_fn=lambda: torch.nn.ELU(alpha=2.0)), **NAMES)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_gsde_is_refused(algorithm):
    kind = {"ppo": sb3.PPO, "sac": sb3.SAC}[algorithm]
    with pytest.raises(ValueError, match="explores by gSDE: train with use_sde=False"):
        from_stable_baselines3(kind("MlpPolicy", Pond(), use_sde=True, device="cpu"), **NAMES)


def test_actions_on_another_scale_are_refused():
    with pytest.raises(ValueError, match=r"only a Box of shape \(A,\) in \[-1, 1\]"):
        from_stable_baselines3(make_model("sac", env=Pond(low=-2.0)), **NAMES)


def test_observations_of_two_dimensions_are_refused():
    with pytest.raises(ValueError, match=r"only a Box of shape \(D,\)"):
        from_stable_baselines3(make_model("ppo", env=Pond(shape=(2, 3))), **NAMES)


def test_normalized_observations_are_refused():
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    model = sb3.PPO("MlpPolicy", VecNormalize(DummyVecEnv([Pond])), device="cpu")
    with pytest.raises(ValueError, match="train without VecNormalize"):
        from_stable_baselines3(model, **NAMES)


def test_names_that_do_not_fit_the_spaces_are_refused():
    with pytest.raises(ValueError, match=r"must have shape \(2, 64\), got \(3, 64\)"):
        from_stable_baselines3(make_model("ppo"), **(NAMES | {"observation_features": ("a", "b")}))


def test_model_that_diverged_to_nan_is_refused():
    model = make_model("ppo")
    with torch.no_grad():
        model.policy.action_net.bias[0] = torch.nan
    with pytest.raises(ValueError, match="weight 'mean.bias' must be finite, got nan"):
        from_stable_baselines3(model, **NAMES)


def test_policy_class_that_computes_more_than_its_layers_is_refused():
    from stable_baselines3.common.policies import ActorCriticPolicy

    class Doubled(ActorCriticPolicy):
        def _predict(self, observation, deterministic=False):
            return 2 * super()._predict(observation, deterministic)

    model = sb3.PPO(Doubled, Pond(), device="cpu", seed=0)
    with pytest.raises(ValueError, match="cannot export policy class Doubled"):
        from_stable_baselines3(model, **NAMES)
