"""Films for the pages of the environments: episode 0, not a chosen one, under the best heuristic and the policy of the package.

    python docs/films.py [NAME ...]
"""

import sys
from pathlib import Path

import tagtrack
from tagtrack.envs.task import build_task
from tagtrack.eval.options import TaskOptions
from tagtrack.eval.rivals import best_of, rivals_of
from tagtrack.eval.video import Video
from tagtrack.policies.box import LEARNED, boxed_policy

FOLDER = Path(__file__).parent / "films"
# Steps that are filmed of long episodes.
LONG = {"AreaOnly-v0": 240, "AreaOnlyUnknownRange-v0": 240, "RangeOnly-v0": 180, "RangeOnlyGlider-v0": 180}


def panels(env_id: str) -> tuple[str, str]:
    """The best heuristic and the policy of the package; where there is none, the paper's controller and the best heuristic."""
    task = build_task(env_id)
    first, best = rivals_of(task)[0], best_of(task)
    try:
        boxed_policy(task.env_id, vehicles=task.scenario.vehicles, tags=task.scenario.targets)
    except ValueError:
        return first, best
    return best, LEARNED


def film(name: str) -> None:
    steps = ((f"episode_steps={LONG[name]}",),) if name in LONG else ()
    task = TaskOptions(env=name, overrides=steps)
    Video(task=task, policies=panels(name), frames=36, side=240, out=FOLDER / f"{name}.gif").run()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or [env_id.rpartition("/")[2] for env_id in tagtrack._TASKS]:
        film(name)
