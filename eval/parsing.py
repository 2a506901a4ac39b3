"""Options dataclasses as command lines: lists that name something, numbers as people write them, help that fits the terminal."""

from __future__ import annotations

import importlib
import re
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, get_args, get_type_hints

import tyro

from tagtrack.eval.command_line import require_words
from tagtrack.eval.whole_number import NUMBERS

TYRO = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff)


def parse_options(kind: Any, arguments: Sequence[str], *, prog: str, default: Any = None) -> Any:
    """The options that a command line asks for, over their defaults or those of an object.

    Raises:
        ValueError: for a list that is named and left empty. SystemExit: where tyro has shown the help or what is wrong.
    """
    require_words(kind, arguments)
    with NUMBERS, flowing_help(kind, arguments):
        if default is None:
            return tyro.cli(kind, args=arguments, prog=prog, config=TYRO)
        return tyro.cli(kind, args=arguments, prog=prog, config=TYRO, default=default)


@contextmanager
def flowing_help(kind: Any, arguments: Sequence[str] = ()) -> Iterator[None]:
    """tyro breaks the text of an option where our sources break it, and the description of a command nowhere.

    Both pass one function of its own; a tyro without that shows its help as it will.
    """
    name = "remove_single_line_breaks"
    try:
        strings: Any = importlib.import_module("tyro._strings")
        usual = getattr(strings, name)
    except (ImportError, AttributeError):
        yield
        return
    width = max(shutil.get_terminal_size().columns, 30)
    shown = [kind, *(each for each in _subcommands(kind) if each.__name__.lower() in arguments)]
    descriptions = {" ".join((each.__doc__ or "").split()) for each in shown}

    def flow(text: str) -> str:
        paragraphs = [" ".join(each.split()) for each in re.split(r"\n\s*\n", text.strip())]
        if " ".join(paragraphs) in descriptions:
            paragraphs = [textwrap.fill(each, width) for each in paragraphs]
        return "\n\n".join(paragraphs)

    setattr(strings, name, flow)
    try:
        yield
    finally:
        setattr(strings, name, usual)


def _subcommands(kind: Any) -> Iterator[Any]:
    """The dataclasses among which a field of another lets choose."""
    for hint in get_type_hints(kind).values():
        for choice in get_args(hint):
            if hasattr(choice, "__dataclass_fields__"):
                yield choice
