"""Hyper-parameters: whose go before whose, which are refused, and what few steps make of them."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import pytest

from tagtrack.envs.presets import PRESETS
from tagtrack.envs.task import build_task
from tagtrack.train.config import TrainConfig
from tagtrack.train.learning import LinearDecay
from tagtrack.train.settings import LIMITS, SETTINGS, PPOSettings, SACSettings, find_settings, fit_to_steps

ALL = [PPOSettings(), SACSettings(), *SETTINGS.values()]


def test_a_preset_has_hyper_parameters_of_its_own_and_the_command_line_goes_before_them():
    named = TrainConfig(env="RangeOnly-v0", preset="masmitja2023")
    assert find_settings(named) == SETTINGS["masmitja2023", "ppo"] != find_settings(TrainConfig(env="RangeOnly-v0"))
    changed = find_settings(replace(named, hyper=(("gamma=0.9",), ("epochs=1e1",)), steps=7))
    assert changed == replace(find_settings(named), gamma=0.9, epochs=10, steps=7)
    assert {preset for presets in PRESETS.values() for preset in presets} - {"surf_zone"} <= {name for name, _ in SETTINGS}


@pytest.mark.parametrize("settings", ALL)
def test_our_own_settings_are_within_their_limits_and_their_steps_leave_them_as_they_are(settings):
    assert all(LIMITS[name].hold(value) for name, value in dataclasses.asdict(settings).items())
    assert fit_to_steps(settings, keep_worlds=False) == fit_to_steps(settings, keep_worlds=True) == settings


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["gamma=2"], "--hyper gamma must be above 0 and at most 1, got 2.0"),
        (["gamma=0"], "--hyper gamma must be above 0 and at most 1, got 0.0"),
        (["gamma=nan"], "got nan"),
        (["clip_range=inf"], "--hyper clip_range must be above 0, got inf"),
        (["learning_rate=0"], "--hyper learning_rate must be above 0 and at most 1, got 0.0"),
        (["learning_rate=true"], "--hyper learning_rate must be a number, got 'true'"),
        (["batch_size=2.5"], "--hyper batch_size must be a whole number, got '2.5'"),
        (["batch_size=1"], "--hyper batch_size must be at least 2, got 1"),
        (["epochs=0"], "--hyper epochs must be at least 1, got 0"),
        (["width=4097"], "--hyper width must be at least 1 and at most 4096, got 4097"),
        (["log_std=-inf"], "--hyper log_std must be at least -10 and at most 2, got -inf"),
        (["gamma"], "a hyper-parameter is set by NAME=VALUE, for instance gamma=0.99; got 'gamma'"),
        (["gamma="], "got 'gamma='"),
        (["gamma=0.9", "gamma=0.99"], "--hyper gamma is set twice, to 0.9 and to 0.99; drop one"),
        (["steps=3"], "unknown hyper-parameter 'steps' of ppo"),
        (["buffer=1000"], "unknown hyper-parameter 'buffer' of ppo"),
    ],
)
def test_a_wrong_hyper_parameter_is_named_with_its_range(texts, words):
    for given in (tuple(texts),), tuple((text,) for text in texts):  # behind one --hyper or behind several
        with pytest.raises(ValueError) as refused:
            find_settings(TrainConfig(hyper=given))
        assert words in str(refused.value)


@pytest.mark.parametrize("steps", [16, 100, 999, 1000, 10_000, 54_321, 500_000])
@pytest.mark.parametrize("worlds", [None, 1, 7, 16])
def test_a_short_run_learns_eight_times_and_ends_soon_after_its_last_step(steps, worlds):
    settings = replace(PPOSettings(), steps=steps, **({} if worlds is None else {"num_envs": worlds}))
    fitted = fit_to_steps(settings, keep_worlds=worlds is not None)
    assert fitted.rollout % fitted.num_envs == 0 and fitted.rollout <= 8192 + 256
    assert worlds in (None, fitted.num_envs)
    updates = -(-steps // fitted.rollout)
    # Eight, but where whole steps of all worlds are coarse.
    assert updates >= 8 or fitted.rollout < steps / 8 + fitted.num_envs
    assert updates * fitted.rollout - steps < fitted.rollout <= steps / 8 + fitted.num_envs
    assert 2 <= fitted.batch_size <= min(2048, fitted.rollout)


def test_sac_begins_to_learn_after_a_tenth_of_its_steps():
    fitted = fit_to_steps(replace(SACSettings(), steps=1000), keep_worlds=False)
    assert isinstance(fitted, SACSettings) and fitted.learning_starts == 100


def test_the_learning_rate_falls_to_its_last_value_and_no_further():
    decay = LinearDecay(1.0, 0.1)
    assert [decay(remaining) for remaining in (1.0, 0.5, 0.0, -7.2)] == pytest.approx([1.0, 0.55, 0.1, 0.1])


def test_a_copy_of_a_baseline_decides_at_every_step_and_learns_gently() -> None:
    task = build_task("LeopardShark-v0", vehicles=2, tags=4)
    alone, copy = (find_settings(TrainConfig(vehicles=2, tags=4, start=start), task.scenario) for start in (None, "information"))
    assert alone.hold == 6 and copy.hold == 1
    assert copy.learning_rate < alone.learning_rate
