"""What makes a shell complete ``tagtrack``: the parsers of all commands under one, written out by shtab."""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import shtab
import tyro

from tagtrack.command import COMMANDS as GROUPS
from tagtrack.command import COMPLETION, SHELLS
from tagtrack.eval.cli import COMMANDS, find_command
from tagtrack.eval.parsing import TYRO, flowing_help
from tagtrack.live.cli import make_parser
from tagtrack.train.config import TrainConfig


def completion_script(shell: str) -> str:
    """The script for one of ``SHELLS``."""
    return str(shtab.complete(whole_parser(), shell))


def whole_parser() -> argparse.ArgumentParser:
    """All commands in one tree."""
    top = argparse.ArgumentParser("tagtrack")
    top.add_argument("--version", action="store_true", help="print the version")
    groups = top.add_subparsers()
    evaluations = groups.add_parser("eval", help=GROUPS["eval"]).add_subparsers()
    for name, (_, text) in COMMANDS.items():
        _graft(evaluations, name, text, _options_of(find_command(name)))
    _graft(groups, "train", GROUPS["train"], _options_of(TrainConfig))
    _graft(groups, "live", GROUPS["live"], make_parser())
    groups.add_parser(COMPLETION, help="print what makes a shell complete these commands").add_argument("shell", choices=SHELLS)
    return top


def _graft(groups: Any, name: str, text: str, parser: argparse.ArgumentParser) -> None:
    groups.add_parser(name, help=text)
    groups.choices[name] = parser


def _options_of(command: Any) -> argparse.ArgumentParser:
    with warnings.catch_warnings(), flowing_help(command):
        warnings.simplefilter("ignore", DeprecationWarning)  # tyro will offer completion of its own, of one command
        return tyro.extras.get_parser(command, config=TYRO)  # type: ignore[return-value]  # its copy of argparse
