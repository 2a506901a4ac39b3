"""rl_zoo3: ``python -m rl_zoo3.train --env TagTrack/LeopardShark-v0 --gym-packages tagtrack --conf-file ...``, from Python."""

import sys
import tempfile
from pathlib import Path

from rl_zoo3.train import train

folder = Path(tempfile.mkdtemp())
environment = "TagTrack/LeopardShark-v0"
hyper = "{n_timesteps: 1024, policy: MlpPolicy, n_envs: 4, n_steps: 64, batch_size: 64, n_epochs: 1}"
(folder / "ppo.yml").write_text(f"{environment}: {hyper}\n")
packages = ["--gym-packages", "tagtrack"]
options = ["--algo", "ppo", "--conf-file", str(folder / "ppo.yml"), "--log-folder", str(folder), "--eval-freq", "-1"]
sys.argv = ["train", "--env", environment, *packages, *options, "--device", "cpu"]
train()
