"""Measure the time of one plan in process, from grid to smooth line: in the study's hallway, and on a million cells.

python benchmarks/plan.py [--json]. Times are medians of several plans after a first one.
"""

import argparse
import sys

from rows import Row, median_seconds, report
from scenes import PUBLISHED, hallway, open_hall

from navirl_cli.irl.scene import Scene
from navirl_cli.planning.paths import Mode, Planner
from navirl_cli.planning.problem import problem_on
from navirl_cli.planning.smooth import Limits, smoothed

#: Bars, s.
HALLWAY_S, LARGE_S = 0.3, 5.0
RADIUS_M = 0.3


def plan(scene: Scene, mode: Mode) -> None:
    """Plan from the scene's grid, start, goal and people, as the command does."""
    lattice = scene.lattice
    (x0, y0), (x1, y1) = lattice.xy_m[[scene.start, scene.goal]].tolist()
    problem = problem_on(lattice.grid, (x0, y0), (x1, y1), scene.people_m, RADIUS_M)
    (path,) = Planner(problem, PUBLISHED).plan(mode)
    smoothed(problem, path.line_m, lattice.grid.resolution_m, Limits())


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    small, large = hallway(), open_hall(1_000_000)
    rows = [
        Row.at_most(f"{where}, {mode.value}", median_seconds(lambda s=scene, m=mode: plan(s, m), runs), "s", bar)
        for where, scene, bar, runs in (("hallway", small, HALLWAY_S, 5), ("1000 x 1000 cells", large, LARGE_S, 2))
        for mode in (Mode.LIKELY, Mode.EXPECTED)
    ]
    return report(rows, as_json=given.json)


if __name__ == "__main__":
    sys.exit(main())
