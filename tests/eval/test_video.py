"""`tagtrack eval video` and `watch`: films of one episode, the same fish in every panel."""

from __future__ import annotations

import numpy as np
import pytest

from tagtrack.envs.legend import FISH, VEHICLE
from tagtrack.eval.contestants import find_makers
from tagtrack.eval.film import GAP, HEADER, film, play
from tagtrack.eval.rollout import trace
from tests.eval.conftest import PARTICLES, STEPS

pytest.importorskip("pygame", reason="films need pygame-ce")
from PIL import Image  # noqa: E402

SHORT = ("--set", f"episode_steps={STEPS}", "--particles", str(PARTICLES))


@pytest.fixture(autouse=True)
def no_window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def test_video_is_a_small_moving_picture_with_a_panel_for_each_policy(evaluate, tmp_path):
    path = tmp_path / "a film.gif"
    command = ("video", *SHORT, "--policies", "three_step", "circle:8.4", "--frames", "12", "--side", "160", "--out", path)
    status, out, _ = evaluate(*command)
    assert status == 0 and "a film.gif (12 pictures" in out
    with Image.open(path) as film_read:
        assert film_read.n_frames == 12 and film_read.size == (2 * 160 + GAP, 160 + HEADER)
        film_read.seek(11)
        colours = {colour for _, colour in film_read.convert("RGB").getcolors(100_000)}
        assert colours >= {VEHICLE, FISH} and any(blue > red + 60 for red, _, blue in colours)  # the belief's shades
    assert path.stat().st_size < 100_000


def test_episode_played_is_the_benchmarks_to_the_last_bit(task):
    makers = find_makers({"circle": "circle:8.4"}, task, "here")
    places = np.array([
        (s.vehicle_position[0, 0].copy(), s.fish_position[0, 0].copy()) for s in play(task, makers["circle"], seed=7)
    ])  # fmt: skip
    traced = trace(task, makers["circle"], episodes=1, seed=7)
    np.testing.assert_array_equal(places[1:, 0], traced.vehicle[0])
    np.testing.assert_array_equal(places[1:, 1], traced.fish[0])


def test_first_and_last_picture_are_start_and_end_of_the_episode(task):
    frames = film(task, find_makers({"pursuit": "pursuit"}, task, "here"), seed=0, frames=3, side=120)
    assert len(frames) == 3 and len({frame.tobytes() for frame in frames}) == 3


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--out", "film.mp4"), "--out must end in .gif or .webp, got film.mp4"),
        (("--frames", "1"), "--frames must be from 2 to 2000, got 1"),
        (("--policies", "static_array"), "static_array steers no vehicle"),
        (("--policies", "pursuit", *(f"circle:{r}" for r in range(1, 5))), "--policies has room for 4, got 5"),
    ],
)
def test_video_names_what_cannot_be(evaluate, words, complaint):
    status, _, errors = evaluate("video", *SHORT, *words)
    assert status == 2 and complaint in errors and errors.count("\n") == 1


def test_watch_ends_when_its_window_is_closed(evaluate, monkeypatch):
    import pygame

    asked = []
    monkeypatch.setattr(pygame.event, "get", lambda *_: asked.append(1) or [None] * (len(asked) == 3))
    assert evaluate("watch", *SHORT, "--policy", "pursuit")[0] == 0
    assert len(asked) == 3


def test_watch_without_a_screen_is_a_line_with_the_way_out(evaluate, monkeypatch):
    import pygame

    monkeypatch.delenv("SDL_VIDEODRIVER")
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")  # SDL's way out, which nobody sees
    monkeypatch.setattr(pygame.display, "set_mode", lambda *_: None)
    status, _, errors = evaluate("watch", *SHORT, "--policy", "pursuit")
    assert status == 2 and "there is no screen for a window; `tagtrack eval video` makes a file" in errors
