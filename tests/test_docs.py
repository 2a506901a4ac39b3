"""The pages in docs/: their Python runs, the command lines that they show are understood, and the site holds together."""

from __future__ import annotations

import contextlib
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tagtrack.eval.cli import parse
from tagtrack.live.cli import make_parser
from tagtrack.train.cli import parse as parse_training

REPOSITORY = Path(__file__).resolve().parents[1]
DOCS = REPOSITORY / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if not {"environments", "html"} & {*path.relative_to(DOCS).parts})
PYTHON = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:^ {4}|`)tagtrack (live|eval|train) ([^`\n]*)", re.MULTILINE)
SPAN = re.compile(r"`[^`\n]+\n[^`\n]+`")  # of code, over two lines
OUTSIDE = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)=[\"']?(?:https?:)?//[^>]*>")
PICTURE = re.compile(r"<img\b[^>]*>")
UNFINISHED = ("...", " --env ID", "--policies RIVAL", "=W", " NAME", " RUN", "DIR", "--seed N", "=X")  # gaps to be filled


def commands() -> Iterator[tuple[str, str, str]]:
    for page in PAGES:
        text = SPAN.sub(lambda found: found[0].replace("\n", " "), page.read_text(encoding="utf-8").replace("\\\n", " "))
        for group, line in COMMAND.findall(text):
            words = line.partition("  #")[0].strip().rstrip(",.")
            if "--" in words and " | " not in words and not any(gap in f" {words}" for gap in UNFINISHED):
                yield page.stem, group, words


@pytest.mark.parametrize("page", [page for page in PAGES if "```python" in page.read_text("utf-8")], ids=lambda page: page.stem)
def test_python_of_a_page_runs_from_its_first_block_to_its_last(tmp_path: Path, monkeypatch, page: Path) -> None:
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    monkeypatch.setitem(sys.modules, "page", type(sys)("page"))  # where dataclasses look their module up
    for number, code in enumerate(PYTHON.findall(page.read_text(encoding="utf-8"))):
        exec(compile(code, f"{page.stem}-{number}", "exec"), names)


@pytest.mark.parametrize(("page", "group", "line"), list(commands()))
def test_command_lines_in_the_pages_are_understood(page: str, group: str, line: str) -> None:
    words = shlex.split(line)
    with contextlib.suppress(SystemExit):
        if group == "live":
            assert make_parser().parse_args(words).module
        else:
            assert parse(words) if group == "eval" else parse_training(words)
        return
    pytest.fail(f"tagtrack {group} {line} is not understood")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("furo")
    html = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", str(html / "trees"), str(DOCS)]
    done = subprocess.run([*command, str(html)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-4000:]
    return html


def test_site_is_built_without_a_warning_and_asks_no_other_host_for_anything(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        assert not (found := OUTSIDE.search(page.read_text(encoding="utf-8"))), f"{page.name}: {found[0]}"
    for style in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(https?:)?//|@import [\"']http", style.read_text(encoding="utf-8")), style.name


def test_every_picture_of_the_site_has_words_and_a_file_and_every_link_a_page(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        for picture in PICTURE.findall(text):
            assert re.search(r'alt="[^"]{8,}"', picture), f"{page.name}: {picture}"
        for link in re.findall(r'(?:href|src)="(?!\w+:)([^"#?]+)', text):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_every_environment_has_a_page_with_a_film_and_its_tables(site: Path) -> None:
    import tagtrack

    for env_id in tagtrack._TASKS:
        text = (site / "environments" / f"{env_id.rpartition('/')[2]}.html").read_text(encoding="utf-8")
        assert ".gif" in text and "log_spread_along" in text and "Version history" in text, env_id
