"""What Gymnasium's specification of an environment holds: plain values, which survive JSON, and how long an episode lasts."""

from __future__ import annotations

import dataclasses
import enum
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.envs import registration
from gymnasium.envs.registration import EnvSpec

from tagtrack.envs.overrides import describe_scenario


def plain_spec(spec: EnvSpec | None) -> EnvSpec | None:
    """The same specification, with scenarios, models, paths and enumerations among its options as plain values.

    ``spec.to_json()`` makes bare dictionaries of dataclasses, from which nobody could tell a motion's kind. ``build_task`` reads
    these plain values as it reads the objects.
    """
    return None if spec is None else dataclasses.replace(spec, kwargs=_plain(spec.kwargs))


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain(describe_scenario(value))
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, enum.Enum):
        return value.value
    return value.item() if isinstance(value, np.generic) else value


def limit_asked_of_make() -> int | None:
    """The ``max_episode_steps`` of the call of ``gymnasium.make`` that gives an environment its specification; None without one.

    Gymnasium keeps that number for its ``TimeLimit`` and hands it on to nobody, and the environment would end its episodes
    before. It is called from the setter of ``spec``, and reads it off the stack.
    """
    frame = sys._getframe(2)
    if frame.f_code is not registration.make.__code__:
        return None
    asked, spec = frame.f_locals.get("max_episode_steps"), frame.f_locals.get("env_spec")
    if asked is None and spec is not None:
        asked = spec.max_episode_steps
    return None if asked in (None, -1) else asked
