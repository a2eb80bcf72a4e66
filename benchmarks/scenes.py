"""Scenes to measure on: the study's hallway, an open hall and an office floor of any size, and paths through them."""

import sys
from math import sqrt
from pathlib import Path

import numpy as np

from navirl_cli.arrays import BoolArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from factories import demonstration

RESOLUTION_M = 0.1
#: The parameters that the study published for all its participants (Sec. IV-D), SI units: c0, a_g, a_p, sigma_p.
PUBLISHED = Reward((-54.12586, -0.873514, -4.907188, 1.679499))

#: An office: repeated corridors between two rows of rooms; sizes in cells.
ROOM, CORRIDOR, WALL, DOOR = 40, 16, 4, 6


def hallway() -> Scene:
    """A hallway of the study's size, 100 x 52 cells and 6 m to drive, with a person beside the nominal path."""
    occupied = np.ones((52, 100), dtype=bool)
    occupied[12:41, 1:-1] = False
    occupied[9:12, 20:31] = False  # a door's niche on either side, and a pillar
    occupied[41:44, 58:70] = False
    occupied[16:20, 76:80] = True
    grid = Grid(occupied, RESOLUTION_M, (0.0, 0.0))
    return Scene.on(grid, np.array([20, 26]), np.array([80, 26]), np.array([[5.12, 2.84]]))


def open_hall(cells: int) -> Scene:
    """A square hall without obstacles. The path crosses it diagonally, and a person stands beside its middle."""
    side = round(sqrt(cells))
    return _across(np.zeros((side, side), dtype=bool))


def office(cells: int, seed: int = 1) -> Scene:
    """A square floor of rooms along corridors, with one random door in each room and cross corridors at the ends.

    Args:
        cells: Approximate number of free cells.
        seed: Seed of the positions of the doors.
    """
    rng = np.random.default_rng(seed)
    period = CORRIDOR + 2 * (ROOM + WALL) + WALL
    side = round(sqrt(cells / 0.83))  # the share that is free
    row, column = np.indices((side, side))
    along, across = row % period, (column - CORRIDOR) % (ROOM + WALL)
    # From the corridor's lower wall upward: corridor, wall, room, wall, room, wall.
    walls = (along >= CORRIDOR) & ((along - CORRIDOR) % (ROOM + WALL) < WALL) | (across < WALL)
    walls &= (along >= CORRIDOR) & (column >= CORRIDOR) & (column < side - CORRIDOR)
    for low in range(0, side, period):
        for left in range(CORRIDOR + WALL, side - CORRIDOR, ROOM + WALL):
            for wall in (low + CORRIDOR, low + period - WALL):
                door = left + int(rng.integers(0, ROOM - DOOR))
                walls[wall : wall + WALL, door : door + DOOR] = False
    return _across(walls)


def _across(occupied: BoolArray) -> Scene:
    """A scene from the lower left to the upper right of a square map."""
    grid = Grid(occupied, RESOLUTION_M, (0.0, 0.0))
    side = len(occupied)
    free = np.argwhere(~occupied)[:, ::-1]
    start, goal = (free[np.abs(free - np.array(at) * side).sum(axis=1).argmin()] for at in ((0.1, 0.2), (0.9, 0.75)))
    person = grid.centres_of((start + goal) // 2) + np.array([0.1, 0.4])
    return Scene.on(grid, start, goal, person[None])


def shown(scene: Scene) -> Demonstration:
    """A demonstration of the shortest path that keeps nearest to the straight line."""
    cells = scene.lattice.cells[scene.hugging_path()]
    return demonstration(scene.lattice.grid, cells, scene.people_m)
