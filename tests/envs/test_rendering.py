"""The picture shows what the docstring promises, leaves the world alone, and says what to install where pygame is missing."""

import sys
import time
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import tagtrack  # noqa: F401  registers the ids
from tagtrack.envs.legend import BELIEF, FAINT, FISH, MESSAGE, PAPER, VEHICLE, Legend, shade
from tagtrack.envs.parallel import TagTrackParallelEnv, parallel_env
from tagtrack.envs.rendering import FRAMES_PER_SECOND, Picture
from tagtrack.envs.scenario import Scenario
from tagtrack.envs.sensors.sensor import Glimpse
from tagtrack.envs.sim.modem import NoModem
from tagtrack.envs.simulation import Simulation
from tagtrack.envs.single import TagTrackEnv
from tests.tasks import LONE

pygame = pytest.importorskip("pygame")
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


@pytest.mark.parametrize("env_id", LONE)
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


def test_environment_lives_without_pygame_until_a_picture_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stable-Baselines3's ``make_vec_env`` asks for ``rgb_array`` on behalf of people who never look."""
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = sailed(steps=3, render_mode="rgb_array")
    with pytest.raises(ImportError, match=r'pip install "tagtrack\[render\]"'):
        env.render()
    with pytest.raises(ImportError, match=r'pip install "tagtrack\[render\]"'):
        TagTrackEnv(render_mode="human").reset()


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


def fleet_under_way(steps: int = 20, **options: Any) -> TagTrackParallelEnv:
    fleet = parallel_env(**{"vehicles": 3, "tags": 2, "particles": 100, "render_mode": "rgb_array", **options})
    fleet.reset(seed=3)
    for _ in range(steps):
        fleet.step({agent: ACTION[: fleet.action_space(agent).shape[0]] for agent in fleet.agents})
    return fleet


def test_message_is_a_line_in_the_step_in_which_it_arrives() -> None:
    """One slot every 10 s of five steps: four pictures of five show none."""
    fleet = fleet_under_way(0, modem="tdma", overrides={"modem.loss": 0.0, "modem.loss_at_range": 0.0})
    drawn = []
    for _ in range(10):
        fleet.step({agent: ACTION[:2] for agent in fleet.agents})
        came = (fleet.simulation.worlds.mail > 0).any()
        drawn.append(pixels_near(fleet.render(), MESSAGE) > 10)
        assert drawn[-1] == came
    assert sum(drawn) == 2


def test_beliefs_of_different_vehicles_have_shades_of_their_own() -> None:
    """The lines of the ellipses: of a shared belief in the first shade, of three in all of them."""
    own, shared = fleet_under_way(modem="none").render(), fleet_under_way(modem="perfect").render()
    for o in range(3):
        assert pixels_near(own, shade(o, 3)) > 100
    assert shade(0, 3) == shade(0, 1) == BELIEF and pixels_near(shared, BELIEF) > 100
    assert pixels_near(shared, shade(2, 3)) < 20


def test_vehicle_that_has_left_is_hollow_and_its_belief_is_gone() -> None:
    """Without tracks, three amber bodies; with flat batteries none."""
    fleet = fleet_under_way(1, modem="none", overrides={"vehicle.battery": 0.05})
    swimming = fleet.render()
    while fleet.agents:
        fleet.step({agent: ACTION[:2] for agent in fleet.agents})
    left = fleet.render()
    assert fleet.simulation.worlds.navigation["active"].sum() == 0
    assert pixels_near(swimming, VEHICLE) - pixels_near(left, VEHICLE) > 200
    assert pixels_near(swimming, BELIEF) > 100 > 10 > pixels_near(left, BELIEF)


def test_arena_is_a_circle_where_there_is_one() -> None:
    """50 m among the 157 m of the first view are 204 pixels in radius, at most half hidden; lines are a pixel wide."""
    with_it = fleet_under_way(0, overrides={"vehicle.arena": 50.0}).render()
    grey = pixels_near(with_it, FAINT) - pixels_near(fleet_under_way(0).render(), FAINT)
    assert grey > 100


@pytest.mark.parametrize("env_id", LONE)
def test_no_line_of_the_legend_runs_out_of_the_panel(env_id: str) -> None:
    everything = {"vehicle.battery": 100.0, "vehicle.arena": 500.0, "reward.perimeter": 20.0}
    fleet = parallel_env(env_id, vehicles=3, tags=2, modem="tdma", particles=10, overrides=everything)
    fleet.reset(seed=0)
    legend = Legend(fleet.simulation, 0)
    example = Glimpse(radius=3.0)
    for words in ([], ["1234 m"] * 2, ["1234 m"] * 6, ["-10, 1234 m"] * 6, ["+9"] * 400, ["12345678 m"] * 7):
        panel = pygame.surfarray.array3d(legend.paint(640, words, example)).swapaxes(0, 1)
        assert (panel[:, -6:] == PAPER).all(), words
        assert (panel[234:240] == PAPER).all(), words  # numbers above, shapes below
        assert (panel[-10:] == PAPER).all()


def test_words_of_a_sensor_of_ones_own_are_cut_to_the_panel() -> None:
    legend = Legend(parallel_env(vehicles=1, particles=10).simulation, 0)
    assert legend._fit("last range", 180) == "last range"
    cut = legend._fit("what the array heard in its own band, and when", 180)
    assert cut.startswith("what the array") and cut.endswith("...") and legend._text.size(cut)[0] <= 180


def test_readings_that_find_no_room_are_counted() -> None:
    fleet = parallel_env(vehicles=3, particles=10)
    legend = Legend(fleet.simulation, 0)
    assert legend._wrap(["120 m"] * 6, 123) == ["120 m  120 m"] * 3
    lines = legend._wrap(["1234 m"] * 20, 123)
    assert len(lines) == 3 and sum(line.count("1234 m") for line in lines) + int(lines[-1].rpartition("+")[2]) == 20
    assert legend._wrap([], 123) == []


def test_unknown_mode_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="'rgb_array' or 'human', got 'ansi'"):
        TagTrackEnv(particles=10, render_mode="ansi")
