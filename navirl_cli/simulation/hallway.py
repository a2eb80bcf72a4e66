"""The hallway of the passing task: walls, niches and a pillar, and where the robot and the person are."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import Grid

RESOLUTION_M = 0.1
SIZE_M = (10.0, 5.0)
ORIGIN_M = (-5.0, -2.5)
ROBOT_RADIUS_M = 0.3
#: Radius of a standing person as an obstacle, m.
PERSON_RADIUS_M = 0.25
#: y of the nominal path, at the centre of a row of cells; x of the start and the goal.
LANE_Y_M = 0.05
START_X_M, GOAL_X_M = -3.15, 3.15
#: The first cycle starts this far to the left and to the right of the nominal path (Sec. IV-C).
OFFSET_M = 0.4


@dataclass(frozen=True, eq=False)
class Hallway:
    """One participant's hallway."""

    #: Walls as they are, for the log.
    walls: Grid
    #: Cells for the robot's centre.
    free: Grid
    #: (2,) m, map frame.
    person_m: FloatArray

    @staticmethod
    def with_person(rng: np.random.Generator) -> "Hallway":
        """The hallway with a person near the middle of the nominal path."""
        walls = Grid(_walls(), RESOLUTION_M, ORIGIN_M)
        person = np.array([rng.normal(0.1, 0.1), rng.normal(LANE_Y_M, 0.04)])
        return Hallway(walls, walls.inflated(ROBOT_RADIUS_M), person)


def _walls() -> np.ndarray:
    """(50, 100) occupied cells."""
    columns, rows = (round(side / RESOLUTION_M) for side in SIZE_M)
    occupied = np.zeros((rows, columns), dtype=bool)
    occupied[:4] = occupied[-4:] = True
    occupied[:, 0] = occupied[:, -1] = True
    # niches: a door on each side, and a bay with a bench
    occupied[1:4, 22:32] = False
    occupied[-4:-1, 58:70] = False
    occupied[-4:-2, 12:20] = False
    # a pillar beside the path, and a bin near the end
    occupied[8:12, 74:78] = True
    occupied[40:43, 34:37] = True
    return occupied
