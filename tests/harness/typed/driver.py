"""What a stranger does first, with no torch needed: one environment, a batch, a fleet, a comparison; tells what it ran on."""

from __future__ import annotations

import sys

import gymnasium
import numba
import numpy as np
import pettingzoo
from gymnasium.utils.env_checker import check_env

import tagtrack
from tagtrack.envs.parallel import parallel_env
from tagtrack.eval import compare

env = gymnasium.make("tagtrack:TagTrack/LeopardShark-v0", particles=50)
env.reset(seed=1)
for _ in range(3):
    env.step(env.action_space.sample())
check_env(env.unwrapped, skip_render_check=True)
env.close()

batch = gymnasium.make_vec("TagTrack/RangeOnly-v0", num_envs=3, particles=50, autoreset_mode="SameStep")
batch.reset(seed=1)
batch.step(batch.action_space.sample())
batch.close()

if hasattr(pettingzoo, "make"):  # from 1.27 on
    fleet = pettingzoo.make("parallel", "tagtrack/range_only_v0", vehicles=3, tags=2, modem="tdma", particles=50)
else:
    fleet = parallel_env("TagTrack/RangeOnly-v0", vehicles=3, tags=2, modem="tdma", particles=50)
fleet.reset(seed=1)
fleet.step({agent: fleet.action_space(agent).sample() for agent in fleet.agents})
fleet.close()

compare("LeopardShark-v0", ["three_step", "pursuit"], episodes=2, particles=50)
assert "torch" not in sys.modules
python = ".".join(map(str, sys.version_info[:3]))
print(f"        Python {python}, gymnasium {gymnasium.__version__}, pettingzoo {pettingzoo.__version__},", end=" ")
print(f"numba {numba.__version__}, numpy {np.__version__}, tagtrack {tagtrack.__version__}")
