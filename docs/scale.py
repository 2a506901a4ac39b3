"""How long a suite takes on more cores, from the times of its parts: `python docs/scale.py suite.json`.

Parts go, the longest first, to whichever core is free; each core first takes START seconds to import and load.
"""

import heapq
import json
import sys
from pathlib import Path

CORES = (1, 2, 16, 64, 256, 1000)
START = 4.0  # [s] of a process whose compiled code lies on the disk


def makespan(parts: list[float], cores: int) -> float:
    """Seconds until all are done."""
    free = [START] * min(cores, len(parts))
    for seconds in sorted(parts, reverse=True):
        heapq.heappush(free, heapq.heappop(free) + seconds)
    return max(free)


def main(path: str) -> None:
    parts = [seconds for each in json.loads(Path(path).read_text())["core_seconds"].values() for seconds in each]
    print(f"{len(parts)} parts, {sum(parts) / 3600:.2f} core hours, the longest {max(parts):.0f} s\n")
    print("| cores | time [s] | cores at work [%] |\n| --: | --: | --: |")
    for cores in CORES:
        time = makespan(parts, cores)
        print(f"| {cores} | {time:.0f} | {100 * sum(parts) / (time * cores):.0f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
