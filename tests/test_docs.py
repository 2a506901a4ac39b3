"""The pages in docs/ run: their Python, and every option of the command lines that they show."""

from __future__ import annotations

import contextlib
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from tagtrack.eval.cli import parse
from tagtrack.live.cli import make_parser

REPOSITORY = Path(__file__).resolve().parents[1]
PAGES = sorted((REPOSITORY / "docs").glob("*.md"))
PYTHON = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"python -m (live|eval) ([^`\n]*)")


def blocks() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        for number, code in enumerate(PYTHON.findall(page.read_text(encoding="utf-8"))):
            yield f"{page.stem}-{number}", code


def commands() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        for module, line in COMMAND.findall(page.read_text(encoding="utf-8").replace("\\\n", " ")):
            if "--" in line and " | " not in line:
                yield module, line.strip()


@pytest.mark.parametrize(("name", "code"), list(blocks()))
def test_python_in_the_pages_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, code: str) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(code, name, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize(("module", "line"), list(commands()))
def test_command_lines_in_the_pages_are_understood(module: str, line: str) -> None:
    words = shlex.split(line.rstrip(",."))
    if module == "live":
        with contextlib.suppress(SystemExit):
            options = make_parser().parse_args(words)
            assert options.module
            return
        pytest.fail(f"python -m live {line} is not understood")
    assert parse(words)
