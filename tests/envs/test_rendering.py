"""The picture shows what the docstring promises, leaves the world alone, and says what to install where pygame is missing."""

import sys
import time

import gymnasium as gym
import numpy as np
import pytest

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.legend import BELIEF, FISH, VEHICLE
from tagtrack.envs.rendering import FRAMES_PER_SECOND, Picture
from tagtrack.envs.scenario import SCENARIOS, Scenario
from tagtrack.envs.sim.modem import NoModem
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv

pytest.importorskip("pygame")
ACTION = np.array([0.6, 0.8, 1.0], np.float32)


def sailed(env_id: str = "TagTrack/LeopardShark-v0", steps: int = 40, **arguments) -> TagTrackEnv:
    env = TagTrackEnv(env_id, **{"particles": 300, "render_mode": "rgb_array", **arguments})
    env.reset(seed=3)
    for _ in range(steps):
        env.step(ACTION[: env.action_space.shape[0]])
    return env


def pixels_near(frame: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Number of pixels of the map, without the legend, within a hair of a colour."""
    return int((np.abs(frame[:, :640].astype(int) - colour).max(axis=-1) <= 12).sum())


@pytest.mark.parametrize("env_id", list(SCENARIOS))
def test_frame_is_an_image_with_vehicle_fish_and_belief_in_it(env_id: str) -> None:
    frame = sailed(env_id).render()
    assert frame.dtype == np.uint8 and frame.ndim == 3 and frame.shape[2] == 3
    for colour in (VEHICLE, FISH, BELIEF):
        assert pixels_near(frame, colour) > 30


def test_tracks_grow_with_the_episode_and_begin_anew_with_the_next() -> None:
    env = sailed(steps=5, overrides={"belief.half_width": 20.0})
    short = pixels_near(env.render(), VEHICLE)
    for _ in range(60):
        env.step(ACTION[:2])
    assert pixels_near(env.render(), VEHICLE) > short + 50
    env.reset()
    assert pixels_near(env.render(), VEHICLE) <= short


def test_particles_are_drawn() -> None:
    """Many cover much of the map with blue, two hardly any of it (beside the ellipse)."""
    few, many = sailed(particles=2, steps=0).render(), sailed(particles=4000, steps=0).render()
    blue = [(frame[:, :640, 2].astype(int) - frame[:, :640, 0] > 30).mean() for frame in (few, many)]
    assert blue[0] < 0.02 and blue[1] > 0.05


def tinted(env: TagTrackEnv) -> int:
    """Pixels of the map with amber over the water tint: more red than the water has green."""
    frame = env.render()[:, :640].astype(int)
    return int(((frame[..., 0] > frame[..., 2] + 10) & (frame[..., 1] > 180)).sum())


def test_bearing_fan_opens_on_both_sides_after_a_detection() -> None:
    deaf = sailed(overrides={"water.clear_hearing": 0.0, "water.noisy_hearing": 0.0})
    hearing = sailed(overrides={"water.clear_hearing": 1.0, "water.noisy_share": 0.0})
    assert tinted(hearing) > 20 * max(tinted(deaf), 50)


@pytest.mark.parametrize("env_id", ["TagTrack/TimeOfFlight-v0", "TagTrack/RangeOnly-v0"])
def test_range_is_a_ring_about_the_place_where_it_was_heard(env_id: str) -> None:
    """Its circumference times its width, 8 pixels of the fine canvas, is 4 of the map; the fan is made too narrow to see.

    Particles and shapes hide up to half of it. A ring beyond the map would be cut, so that the particles reach farther.
    """
    narrow = {"belief.receiver.bearing_sigma": 1e-3} if env_id == "TagTrack/TimeOfFlight-v0" else {}
    overrides = {**narrow, "water.clear_hearing": 1.0, "water.noisy_share": 0.0, "belief.half_width": 600.0}
    env = sailed(env_id, steps=3, overrides=overrides)
    simulation = env.unwrapped.simulation
    told = simulation.worlds.measurements[0, 0, 0]
    slant_range = told["readings"][simulation.scenario.receiver.readings.index("slant_range")]
    radius = np.sqrt(slant_range**2 - told["depth"] ** 2)
    span = 1.12 * 1200.0  # [m] across the map
    ring = 4.0 * 2.0 * np.pi * radius * 640.0 / span
    assert 0.5 * ring < tinted(env) < 1.3 * ring


def test_perimeter_is_drawn_where_there_is_one() -> None:
    without = sailed("TagTrack/LeopardSharkStandoff-v0", overrides={"reward.perimeter": 0.0}).render()
    frame = sailed("TagTrack/LeopardSharkStandoff-v0").render()
    assert (frame[:, :640] != without[:, :640]).any()


def test_error_is_written() -> None:
    env = sailed()
    before = env.render()[40:80, 650:]
    for _ in range(30):
        env.step(ACTION[:2])
    assert (before != env.render()[40:80, 650:]).any()


def test_rendering_changes_nothing_in_the_world() -> None:
    drawn, blind = sailed(), sailed(render_mode=None)
    for _ in range(10):
        drawn.render()
        seen, expected = drawn.step(ACTION[:2]), blind.step(ACTION[:2])
        np.testing.assert_array_equal(seen[0], expected[0])
        assert seen[1] == expected[1]


def test_frames_are_not_written_over() -> None:
    env = sailed()
    frame = env.render()
    copy = frame.copy()
    env.step(ACTION[:2])
    env.render()
    np.testing.assert_array_equal(frame, copy)


def test_human_mode_keeps_the_frame_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert TagTrackEnv.metadata["render_fps"] == FRAMES_PER_SECOND
    env = sailed(steps=1, render_mode="human")
    start = time.perf_counter()
    for _ in range(10):
        env.step(ACTION[:2])
    assert time.perf_counter() - start >= 9 / FRAMES_PER_SECOND
    assert env.render() is None
    env.close()
    env.close()


def test_render_without_a_mode_warns_and_returns_nothing() -> None:
    env = sailed(steps=1, render_mode=None)
    with pytest.warns(UserWarning, match="render_mode="):
        assert env.render() is None


def test_gymnasium_records_a_video_of_frames() -> None:
    env = gym.make("TagTrack/LeopardShark-v0", particles=50, render_mode="rgb_array_list")
    env.reset(seed=0)
    env.step(ACTION[:2])
    assert len(env.render()) == 2


def test_fleet_is_drawn_too() -> None:
    simulation = Simulation(Scenario(vehicles=3, targets=2, modem=NoModem()), 2)
    simulation.reset(seed=0)
    picture = Picture(simulation, world=1)
    picture.follow()
    for _ in range(20):
        simulation.step(np.broadcast_to(ACTION[:2], (2, 3, 2)))
        picture.follow()
    assert pixels_near(picture.paint(), VEHICLE) > 90


def test_missing_pygame_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=r'pip install "tagtrack\[render\]"'):
        TagTrackEnv(particles=10, render_mode="rgb_array")


def test_unknown_mode_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="'rgb_array' or 'human', got 'ansi'"):
        TagTrackEnv(particles=10, render_mode="ansi")
