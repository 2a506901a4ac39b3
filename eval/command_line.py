"""Command lines and the options objects they stand for: what asks for an object's values, and what asks for nothing."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any, get_args, get_origin, get_type_hints


def command_line(command: str, asked: Any) -> str:
    """``tagtrack eval COMMAND`` with each option of a dataclass that is not at its default; nested ones are flattened."""
    return shlex.join(["tagtrack", "eval", command, *_words(asked, type(asked)())])


def _words(asked: Any, plain: Any) -> list[str]:
    words: list[str] = []
    hints = get_type_hints(type(asked), include_extras=True)
    for field in dataclasses.fields(asked):
        value, usual = getattr(asked, field.name), getattr(plain, field.name)
        if dataclasses.is_dataclass(value):
            words += _words(value, usual)
        elif value != usual or field.name == "env":
            words += _option(_name_of(field.name, hints[field.name]), value)
    return words


def _option(name: str, value: Any) -> list[str]:
    if isinstance(value, bool):
        return [f"--{name}"] if value else [f"--no-{name}"]
    if isinstance(value, tuple):
        flat = [text for each in value for text in (each if isinstance(each, tuple) else (each,))]
        return [f"--{name}", *map(str, flat)]
    return [f"--{name}", str(value)]


def _name_of(field: str, hint: Any) -> str:
    """The option's name, which an annotation may have changed."""
    for note in getattr(hint, "__metadata__", ()):
        if getattr(note, "name", None):
            return str(note.name)
    return field.replace("_", "-")


def require_words(kind: Any, arguments: Sequence[str]) -> None:
    """Refuse to take a list of nothing for "all" or "the best": ``--policies $MINE`` without that variable meant something else.

    Args:
        kind: the dataclass of the options.
    Raises:
        ValueError: naming the option.
    """
    lists = set(_lists(kind))
    if {"-h", "--help"} & set(arguments):
        return
    for word, following in zip_longest(arguments, arguments[1:], fillvalue="--"):
        name, given, value = word.partition("=")
        value = value if given else following
        if name.replace("_", "-") in lists and (not value or value.startswith("--")):
            raise ValueError(f"{name} names nothing; give it a value or leave it out")


def _lists(kind: Any) -> Iterator[str]:
    """The options of a dataclass, and of those within it, that take several values and are empty by default."""
    if not dataclasses.is_dataclass(kind):
        for part in get_args(kind):
            yield from _lists(part)
        return
    hints = get_type_hints(kind, include_extras=True)
    for field in dataclasses.fields(kind):
        plain = get_type_hints(kind)[field.name]
        if get_origin(plain) is tuple and field.default == ():
            yield f"--{_name_of(field.name, hints[field.name])}"
        elif get_origin(plain) is not tuple:
            yield from _lists(plain)
