"""How fish move: random walks, which also move the particles of a belief, and paths, which fish alone follow."""

from tagtrack.envs.motions.acceleration import WhiteAcceleration
from tagtrack.envs.motions.boat import StraightAndIdle
from tagtrack.envs.motions.brownian import BrownianWalk
from tagtrack.envs.motions.legs import StraightLegs
from tagtrack.envs.motions.levy import LevyFlight
from tagtrack.envs.motions.momentum import MomentumRandomWalk
from tagtrack.envs.motions.motion import Motion, Path
from tagtrack.envs.motions.replay import Replay

WALKS: dict[str, type[Motion]] = {
    "momentum": MomentumRandomWalk,
    "brownian": BrownianWalk,
    "levy": LevyFlight,
    "boat": StraightAndIdle,
    "acceleration": WhiteAcceleration,
}
PATHS: dict[str, type[Path]] = {"legs": StraightLegs}  # a replay needs its tracks: tracks=FILE

__all__ = [
    "PATHS",
    "WALKS",
    "BrownianWalk",
    "LevyFlight",
    "MomentumRandomWalk",
    "Motion",
    "Path",
    "Replay",
    "StraightAndIdle",
    "StraightLegs",
    "WhiteAcceleration",
]
