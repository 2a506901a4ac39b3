"""`report.html`: one file that holds everything, asks nobody for anything, and lets no name become markup."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess

import pytest

from tagtrack.eval.cli import parse
from tagtrack.eval.command_line import command_line
from tagtrack.eval.comparison import compare
from tagtrack.eval.html_report import Illustration, html_report
from tests.eval.conftest import SHORT

EVIL = '<img src=x onerror="alert(1)">'
BROWSER = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)


def page_of(task, **more) -> str:
    comparison = compare(task, {EVIL: "pursuit", "a & b": {f"run {EVIL}": "circle:8", "run 2": "circle:9"}}, episodes=6)
    settings = {"tracks": f"{EVIL}.csv", "policies": {EVIL: EVIL}}
    picture = Illustration(title=EVIL, data=b"GIF89a", kind="gif", words=EVIL)
    document = comparison.document({"tagtrack": EVIL})
    return html_report(document, comparison, settings=settings, command=f"tagtrack {EVIL}", pictures=[picture], **more)


def test_names_of_policies_runs_files_and_versions_are_words_and_never_markup(task):
    page = page_of(task)
    assert EVIL not in page and "&lt;img src=x onerror=" in page
    images = re.findall(r"<img\b[^>]*>", page)
    assert len(images) == 1 and images[0].endswith('src="data:image/gif;base64,R0lGODlh">')
    assert "<script" not in page and "a &amp; b" in page


def test_page_holds_each_episode_each_run_and_what_repeats_it(task):
    page = page_of(task)
    assert page.count("<circle ") == 6  # of the second policy, against the first
    assert "seed 5: " in page and "run 2" in page and "95 % intervals" in page
    assert "default-src 'none'; img-src data:" in page


def test_benchmark_writes_a_report_below_three_megabytes_with_a_film(evaluate, tmp_path):
    command = ("benchmark", *SHORT, "--policies", "three_step", "circle:8.4", "--out", tmp_path / "out")
    assert evaluate(*command)[0] == 0
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert len(page) < 3e6 and "data:image/gif" in page and page.count("data:image/png") >= 2
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    asked = re.search(r"<pre>(.*?)</pre>", page, re.DOTALL)[1]
    assert "--policies three_step circle:8.4" in asked and "--set episode_steps=40" in asked
    assert evaluate(*command, "--no-film")[0] == 0
    assert "data:image/gif" not in (tmp_path / "out/report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "words",
    [
        "--env RangeOnly-v0 --set a=1 b=2 --policies 'a b' c --trust --episodes 8 --out '/tmp/x y'",
        "--env GliderPair-v0 --no-film --particles 100 --tags 2 --modem tdma --metrics a:b --from-step 3 --time-scale 0.5",
    ],
)
def test_command_of_a_report_asks_for_the_same(words):
    asked = parse(["benchmark", *shlex.split(words)])
    assert parse(shlex.split(command_line("benchmark", asked))[2:]) == asked


@pytest.mark.skipif(BROWSER is None, reason="no browser")
@pytest.mark.parametrize("width", [400, 1200])
def test_browser_shows_the_report_without_a_complaint(task, tmp_path, width):
    page, picture = tmp_path / "report.html", tmp_path / "shot.png"
    page.write_text(page_of(task), encoding="utf-8")
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", f"--window-size={width},900"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--host-resolver-rules=MAP * ~NOTFOUND", f"--screenshot={picture}"]
    done = subprocess.run([*command, page.as_uri()], capture_output=True, text=True, timeout=120, env=dict(os.environ))
    assert picture.is_file(), done.stderr[-2000:]
    assert "CONSOLE" not in done.stderr
    from PIL import Image

    with Image.open(picture) as shot:
        assert shot.width == width and len(shot.convert("RGB").getcolors(1_000_000)) > 20
