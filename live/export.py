"""`tagtrack live export`: a learned policy as an ONNX graph."""

from __future__ import annotations

import argparse
from pathlib import Path

from tagtrack.envs.task import full_id
from tagtrack.policies.box import LEARNED, boxed_policy
from tagtrack.policies.files import load_policy
from tagtrack.policies.onnx_export import save_onnx


def run(options: argparse.Namespace) -> None:
    """The command."""
    folder = boxed_policy(full_id(options.env)) if options.policy == LEARNED else Path(options.policy)
    policy = load_policy(folder)
    difference = save_onnx(policy, Path(options.out))
    print(f"written: {options.out}, for {policy.env_id}; actions differ from numpy's by at most {difference:.1g}")
