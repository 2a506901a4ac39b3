"""Puts a run's policy into the box that comes with the package: ``python -m tagtrack.train.boxing RUN NAME``.

Beside the policy's two files it writes ``run.json``: the command that trained it, seed, versions, and its table.
"""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Any

from tagtrack.policies.box import BOX
from tagtrack.policies.files import DESCRIPTION_FILE, WEIGHTS_FILE, load_policy, replace_file

LARGEST = 130_000  # bytes of weights
NAMED = (  # settings that a command line names
    "env", "algo", "steps", "seed", "num_envs", "preset", "particles", "motion", "vehicles", "tags", "modem", "start",
)  # fmt: skip


def box_run(run: Path, name: str) -> Path:
    """Copy a run's policy to ``policies/box/NAME``. Raises ValueError for weights that are too large."""
    load_policy(run)
    size = (run / WEIGHTS_FILE).stat().st_size
    if size > LARGEST:
        raise ValueError(f"{run / WEIGHTS_FILE} has {size:,} bytes, at most {LARGEST:,} may go in; train a narrower network")
    config = json.loads((run / "config.json").read_text(encoding="utf-8"))
    told = {
        "command": command_of(config),
        "seed": config["seed"],
        "versions": json.loads((run / "versions.json").read_text(encoding="utf-8")),
        "table": (run / "table.md").read_text(encoding="utf-8").splitlines(),
    }
    folder = BOX / name
    folder.mkdir(parents=True, exist_ok=True)
    for file in (WEIGHTS_FILE, DESCRIPTION_FILE):
        with replace_file(folder / file) as partial:
            partial.write_bytes((run / file).read_bytes())
    with replace_file(folder / "run.json") as partial:
        partial.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return folder


def command_of(config: dict[str, Any]) -> str:
    """The command line that a run's config.json came from."""
    words = ["tagtrack", "train"]
    for name in NAMED:
        if config.get(name) is not None:
            words += [f"--{name.replace('_', '-')}", str(config[name])]
    for name in ("set", "hyper"):
        given = [text for group in config.get(name, []) for text in (group if isinstance(group, list) else [group])]
        words += [f"--{name}", *given] if given else []
    return shlex.join(words)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not sys.argv[2].replace("-", "").isalnum():
        sys.exit("usage: python -m tagtrack.train.boxing RUN NAME   (NAME of letters, digits and hyphens)")
    try:
        print(box_run(Path(sys.argv[1]), sys.argv[2]))
    except (ValueError, OSError, KeyError) as error:
        sys.exit(f"error: {error}")
