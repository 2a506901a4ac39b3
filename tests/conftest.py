"""What all tests share: the field data, where there is any, and a fresh interpreter for claims about imports."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]


def pytest_configure() -> None:
    """Programs that tests interrupt heed Ctrl-C, though these tests may run in the background of a shell that ignores it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first: begun last, one would run on beside idle cores."""
    longest = ("train/test_several", "eval/test_own_ids", "eval/test_papers", "eval/test_commands", "tests/test_examples")
    items.sort(key=lambda item: not item.path.with_suffix("").as_posix().endswith(longest))


def pytest_runtest_setup() -> None:
    """One torch thread: on a busy machine two are slower than one by two orders of magnitude."""
    torch = sys.modules.get("torch")
    if torch is not None and torch.get_num_threads() != 1:
        torch.set_num_threads(1)


@pytest.fixture(autouse=True, scope="session")
def own_key(tmp_path_factory) -> Iterator[Path]:
    """Folders of the tests' own for configuration and results that are kept: the user's stay as they are."""
    folder = tmp_path_factory.mktemp("config")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        yield folder / "tagtrack" / "key"


@pytest.fixture(scope="session")
def repository() -> Path:
    """The folder that holds pyproject.toml."""
    return REPOSITORY


@pytest.fixture(scope="session")
def tagtrack_data() -> Path:
    """The field data: the folder that TAGTRACK_DATA names, else shared/data beside the repository."""
    named = os.environ.get("TAGTRACK_DATA")
    folder = Path(named) if named else REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no field data in {folder}: name their folder in the environment variable TAGTRACK_DATA")
    return folder


@pytest.fixture(scope="session")
def run_python() -> Callable[..., str]:
    """Run code in a fresh interpreter and return what it prints; an error there fails the test with its traceback."""

    def run(code: str, *arguments: str, cwd: Path = REPOSITORY, executable: str | Path = sys.executable) -> str:
        done = subprocess.run([str(executable), "-c", code, *arguments], cwd=cwd, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
