"""A policy as two files: `policy.safetensors` holds the weights, `policy.json` says what they are.

Neither can carry code: safetensors is raw numbers behind a JSON header, so a stranger's policy is safe to load, and
loading needs numpy and safetensors alone. Two SHA-256 sums guard against damage; they are no signature, since whoever
rewrites both files can rewrite the sums.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import re
import secrets
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as weights_from_bytes
from safetensors.numpy import save as weights_to_bytes

from tagtrack.policies.entities import EntityPolicy
from tagtrack.policies.network import SQUASHES, NetworkPolicy

FORMAT_VERSION = 1
WEIGHTS_FILE = "policy.safetensors"
DESCRIPTION_FILE = "policy.json"

# The keys that say what the policy is; the file adds sums over them and over the weights.
_DESCRIPTION_TYPES: dict[str, type] = {
    "format_version": int,
    "algorithm": str,
    "env_id": str,
    "observation_features": list,
    "action_names": list,
    "hidden": list,
    "activation": str,
    "squash": str,
}
# Those of a policy for fleets, which ``network`` tells apart.
ENTITIES = "entities"
_ENTITY_TYPES: dict[str, type] = {
    "format_version": int,
    "network": str,
    "algorithm": str,
    "env_id": str,
    "observation_features": list,
    "action_names": list,
    "own_names": list,
    "tag_names": list,
    "mate_names": list,
    "width": int,
    "hold": int,
}
_SUM_KEYS = ("description_sha256", "weights_sha256", "previous_weights_sha256")
_AGAIN = "copy the policy's folder again, or train again"
_PARTIAL_NAME = re.compile(r"\..+\.[0-9a-f]{16}(\.[a-z]+)?")


@contextlib.contextmanager
def replace_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Replace a file whole or not at all: the block writes the path it is given, which then takes the file's place.

    The given path lies beside the file, is hidden, ends in the same suffix (some writers go by it) and does not exist
    yet. A reader, or a run that continues after a kill, sees the old file or the new one and nothing between.

    Raises:
        FileNotFoundError: if the folder is missing, or the block wrote nothing.
        OSError: if the disk is full, naming the file; the old one stays.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write {target}: make the folder {target.parent} first")
    partial = target.with_name(f".{target.stem}.{secrets.token_hex(8)}{target.suffix}")
    try:
        yield partial
        # Without this a power cut can leave the new name with the old file gone and the new one empty.
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, target)
    except BaseException as error:  # Ctrl-C too must leave nothing behind
        with contextlib.suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise OSError(error.errno, "no space left to write, free some and try again", str(target)) from error
        raise


def remove_leftovers(folder: str | os.PathLike[str]) -> None:
    """Remove what a kill in the middle of `replace_file` left in a folder; nobody may be writing there."""
    for path in Path(folder).iterdir():
        if is_leftover(path):
            path.unlink(missing_ok=True)


def is_leftover(path: Path) -> bool:
    """Whether a file is what a kill in the middle of `replace_file` leaves."""
    return is_leftover_name(path.name) and path.is_file()


def is_leftover_name(name: str) -> bool:
    """Whether a name is one of those that something has until it is whole."""
    return _PARTIAL_NAME.fullmatch(name) is not None


def save_policy(folder: str | os.PathLike[str], policy: NetworkPolicy | EntityPolicy) -> None:
    """Write a policy into a folder, which is made if missing; a policy already there is replaced.

    A kill at any moment leaves the folder with the old policy or the new one, as long as both have the same
    description (the checkpoints of one run). Otherwise a kill between the two renames leaves files that do not fit
    each other, which `load_policy` refuses.

    Raises:
        OSError: if the folder cannot be made or written, or the disk is full.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    weights = weights_to_bytes(dict(policy.weights))
    description = _describe(policy)
    sums = {
        "description_sha256": _sum_of_description(description),
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
        # Two files cannot be renamed at once. The description goes first and accepts the old weights as well.
        "previous_weights_sha256": _sum_of_replaceable_weights(folder, description),
    }
    with replace_file(folder / WEIGHTS_FILE) as new_weights, replace_file(folder / DESCRIPTION_FILE) as new_description:
        new_weights.write_bytes(weights)
        new_description.write_text(json.dumps(description | sums, indent=2) + "\n", encoding="utf-8")


def load_policy(
    folder: str | os.PathLike[str],
    observation_features: Sequence[str] | None = None,
    *,
    action_names: Sequence[str] | None = None,
    env_id: str | None = None,
    seed: int = 0,
) -> NetworkPolicy | EntityPolicy:
    """Read the policy that `save_policy` wrote; never executes anything from the files.

    Args:
        folder: where `policy.safetensors` and `policy.json` lie.
        observation_features: (D,) names the environment gives its observation, in order; None: any layout will do. A policy
            for fleets takes any number of tags and teammates that are described as those were on which it was trained.
        action_names: (A,) names of the environment's actions, in order; None: any.
        env_id: the environment's id, for error messages alone: a policy may run on any environment of its layout.
        seed: of the policy's draws when it is not deterministic.
    Raises:
        FileNotFoundError: if the folder or one of the two files is missing.
        ValueError: if a file is damaged, or describes another kind of policy, or the layouts differ.
    """
    folder = Path(folder)
    description, sums = _read_description(folder)
    entities = description.get("network") == ENTITIES
    if not entities:
        _require_layout(folder, description, "observation_features", "observation", observation_features, env_id)
    _require_layout(folder, description, "action_names", "action", action_names, env_id)
    weights = _read_weights(folder, sums)
    if entities:
        return _entity_policy(folder, description, weights, observation_features, seed)
    try:
        return NetworkPolicy(
            algorithm=description["algorithm"],
            env_id=description["env_id"],
            observation_features=tuple(description["observation_features"]),
            action_names=tuple(description["action_names"]),
            hidden=tuple(description["hidden"]),
            activation=description["activation"],
            weights=weights,
            seed=seed,
        )
    except ValueError as error:
        raise ValueError(f"{folder}: {DESCRIPTION_FILE} and {WEIGHTS_FILE} hold no policy: {error}") from error


def _entity_policy(
    folder: Path, description: dict[str, Any], weights: dict[str, np.ndarray], names: Sequence[str] | None, seed: int
) -> EntityPolicy:
    try:
        return EntityPolicy(
            env_id=description["env_id"],
            observation_features=tuple(names if names is not None else description["observation_features"]),
            action_names=tuple(description["action_names"]),
            own_names=tuple(description["own_names"]),
            tag_names=tuple(description["tag_names"]),
            mate_names=tuple(description["mate_names"]),
            width=description["width"],
            hold=description["hold"],
            weights=weights,
            seed=seed,
        )
    except ValueError as error:
        raise ValueError(f"the policy in {folder} cannot steer this fleet: {error}") from error


def _describe(policy: NetworkPolicy | EntityPolicy) -> dict[str, Any]:
    if isinstance(policy, EntityPolicy):
        return {
            "format_version": FORMAT_VERSION,
            "network": ENTITIES,
            "algorithm": "ppo",
            "env_id": policy.env_id,
            "observation_features": list(policy.observation_features),
            "action_names": list(policy.action_names),
            "own_names": list(policy.own_names),
            "tag_names": list(policy.tag_names),
            "mate_names": list(policy.mate_names),
            "width": policy.width,
            "hold": policy.hold,
        }
    return {
        "format_version": FORMAT_VERSION,
        "algorithm": policy.algorithm,
        "env_id": policy.env_id,
        "observation_features": list(policy.observation_features),
        "action_names": list(policy.action_names),
        "hidden": list(policy.hidden),
        "activation": policy.activation,
        "squash": policy.squash,
    }


def _sum_of_description(description: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()


def _sum_of_replaceable_weights(folder: Path, description: dict[str, Any]) -> str | None:
    """The sum of the weights in the folder if they make a policy with the same description, else None."""
    try:
        present = load_policy(folder)
    except (ValueError, FileNotFoundError):
        return None
    if _describe(present) != description:
        return None
    return hashlib.sha256((folder / WEIGHTS_FILE).read_bytes()).hexdigest()


def _read_description(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the policy is, and the sums; the values' types are checked, their meaning is NetworkPolicy's to check."""
    file = _existing_file(folder, DESCRIPTION_FILE)
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # ValueError: not JSON, not UTF-8, or a number of thousands of digits
        raise ValueError(f"{file} is not readable as JSON ({_one_line(error)}): {_AGAIN}") from error
    if not isinstance(content, dict):
        raise ValueError(f"{file} must hold a JSON object, got {type(content).__name__}: {_AGAIN}")
    # First, because another version may have other keys.
    version = content.get("format_version")
    if version != FORMAT_VERSION and version is not None:
        raise ValueError(
            f"{file} has format version {version!r}, this program reads {FORMAT_VERSION}: "
            "use the version of tagtrack that wrote it, or train the policy again"
        )
    types = _ENTITY_TYPES if content.get("network") == ENTITIES else _DESCRIPTION_TYPES
    for key in (*types, *_SUM_KEYS):
        if key not in content:
            raise ValueError(f"{file} has no {key!r}: {_AGAIN}")
    for key in content:
        if key not in types and key not in _SUM_KEYS:
            raise ValueError(f"{file} has an unknown key {key!r}: remove it")
    for key, kind in types.items():
        if type(content[key]) is not kind:
            raise ValueError(f"{file}: {key!r} must be {kind.__name__}, got {type(content[key]).__name__}: {_AGAIN}")
    description = {key: content[key] for key in types}
    if content["description_sha256"] != _sum_of_description(description):
        raise ValueError(f"{file} was changed after it was saved (description_sha256 differs): {_AGAIN}")
    algorithm = description["algorithm"]
    if "squash" in types and algorithm in SQUASHES and description["squash"] != SQUASHES[algorithm]:
        raise ValueError(
            f"{file}: squash of {algorithm} must be {SQUASHES[algorithm]!r}, got {description['squash']!r}"
        )
    return description, {key: content[key] for key in _SUM_KEYS}


def _read_weights(folder: Path, sums: dict[str, Any]) -> dict[str, np.ndarray]:
    file = _existing_file(folder, WEIGHTS_FILE)
    content = file.read_bytes()
    if hashlib.sha256(content).hexdigest() not in (sums["weights_sha256"], sums["previous_weights_sha256"]):
        raise ValueError(f"{file} is not the file that {DESCRIPTION_FILE} describes (weights_sha256 differs): {_AGAIN}")
    try:
        return weights_from_bytes(content)
    except (SafetensorError, ValueError, KeyError) as error:  # KeyError: a number type that numpy lacks
        raise ValueError(f"{file} is not readable as safetensors ({_one_line(error)}): {_AGAIN}") from error


def _existing_file(folder: Path, name: str) -> Path:
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder} is not a folder: give the folder of a run, or train one into it")
    if not (folder / name).is_file():
        raise FileNotFoundError(f"{folder} holds no policy ({name} is missing): give the folder of a finished run")
    return folder / name


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _require_layout(
    folder: Path, description: dict[str, Any], key: str, noun: str, wanted: Sequence[str] | None, env_id: str | None
) -> None:
    """Raise if the policy's names are not the wanted ones, naming the first that differs."""
    if wanted is None or list(wanted) == description[key]:
        return
    had = [repr(name) for name in description[key]] + ["nothing"]
    want = [repr(name) for name in wanted] + ["nothing"]
    first = next(index for index, (a, b) in enumerate(zip(had, want, strict=False)) if a != b)
    env = env_id or "this environment"
    raise ValueError(
        f"the policy in {folder} was trained on {description['env_id']!r}, where {noun} {first} is {had[first]}; "
        f"{env} has {want[first]} there: use a policy trained on {env}, with the same vehicles, tags, modem and parameters, or "
        "give those that it was trained with (--set)"
    )
