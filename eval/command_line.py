"""The command line that asks for what an options object holds: for reports, from which a result must be repeated."""

from __future__ import annotations

import dataclasses
import shlex
from typing import Any, get_type_hints


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
