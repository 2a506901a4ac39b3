"""Films for the pages of the environments: the best heuristic and the policy of the package, episode 0, not a chosen one.

    python docs/films.py [NAME ...]
"""

import sys
from pathlib import Path

from tagtrack.envs.task import build_task
from tagtrack.eval.options import TaskOptions
from tagtrack.eval.rivals import rivals_of
from tagtrack.eval.video import Video
from tagtrack.policies.box import LEARNED

FOLDER = Path(__file__).parent / "films"
IDS = (
    "LeopardShark-v0", "LeopardSharkStandoff-v0", "Glider-v0", "GliderPair-v0", "TimeOfFlight-v0", "RangeOnly-v0", "AreaOnly-v0",
    "AreaOnlyUnknownRange-v0",
)  # fmt: skip
LONG = {"AreaOnly-v0": 240, "AreaOnlyUnknownRange-v0": 240, "RangeOnly-v0": 180}  # steps that are filmed of long episodes


def film(name: str) -> None:
    heuristic = rivals_of(build_task(name))[-1]
    steps = ((f"episode_steps={LONG[name]}",),) if name in LONG else ()
    task = TaskOptions(env=name, overrides=steps)
    Video(task=task, policies=(heuristic, LEARNED), frames=36, side=240, out=FOLDER / f"{name}.gif").run()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or IDS:
        film(name)
