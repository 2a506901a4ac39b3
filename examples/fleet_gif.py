"""A film of a fleet: three vehicles range two fish and tell one another in packets that take turns.

    pip install "tagtrack[render]" && python fleet_gif.py [FILE.gif]
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from tagtrack.baselines.registry import make_baseline
from tagtrack.envs.parallel import parallel_env

path = Path(sys.argv[1] if len(sys.argv) > 1 else "fleet.gif")
env = parallel_env("RangeOnly-v0", vehicles=3, tags=2, modem="tdma", render_mode="rgb_array", max_cycles=180)
policy, state = make_baseline("assignment", env.simulation), None
observations, _ = env.reset(seed=3)
frames = []
while env.agents:
    rows, agents = np.stack(list(observations.values())), list(env.agents)
    actions, state = policy.predict(rows, state, np.full(len(rows), not frames))
    observations, *_ = env.step(dict(zip(agents, actions, strict=True)))
    frames.append(Image.fromarray(env.render()))
small = [frame.resize((frame.width * 2 // 3, frame.height * 2 // 3)).quantize(64) for frame in frames[::3]]
small[0].save(path, save_all=True, append_images=small[1:], duration=160, loop=0, optimize=True)
print(f"written: {path}, {len(small)} frames")
env.close()
