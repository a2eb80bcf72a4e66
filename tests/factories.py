"""Scenes and demonstrations, made to measure."""

from dataclasses import replace

import numpy as np
import oracles
from numpy.typing import ArrayLike, NDArray

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene

RESOLUTION_M = 0.1
NOBODY: NDArray[np.float64] = np.zeros((0, 2))


def grid_of(drawing: str, resolution_m: float = RESOLUTION_M, origin_m: tuple[float, float] = (0.0, 0.0)) -> Grid:
    """A grid from a drawing seen from above, x to the right and y up: # is occupied, anything else free."""
    lines = [line.strip() for line in drawing.strip().splitlines()]
    return Grid(np.array([[mark == "#" for mark in line] for line in lines[::-1]]), resolution_m, origin_m)


def open_grid(columns: int, rows: int, origin_m: tuple[float, float] = (0.0, 0.0)) -> Grid:
    return Grid(np.zeros((rows, columns), dtype=bool), RESOLUTION_M, origin_m)


def scene_on(grid: Grid, start: ArrayLike, goal: ArrayLike, people_m: ArrayLike = NOBODY) -> Scene:
    return Scene.on(grid, np.array(start), np.array(goal), np.reshape(np.asarray(people_m, dtype=float), (-1, 2)))


def random_scene(rng: np.random.Generator, columns: int, rows: int, density: float, people: int = 1) -> Scene:
    """A map with random obstacles, and two far apart cells in its largest connected part."""
    while True:
        grid = Grid(rng.random((rows, columns)) < density, RESOLUTION_M, (-0.35, 0.8))
        cell = rng.integers(0, [columns, rows])
        if grid.is_occupied(cell):
            continue
        lattice = Lattice.around(grid, cell)
        if lattice.size < 0.5 * columns * rows:
            continue
        start, goal = lattice.cells[[0, -1]]
        people_m = np.asarray(grid.origin_m) + rng.random((people, 2)) * (columns * 0.1, rows * 0.1)
        return scene_on(grid, start, goal, people_m)


def demonstration(
    grid: Grid,
    cells: ArrayLike,
    people_m: ArrayLike = NOBODY,
    number: int = 1,
    participant: str = "p1",
    **fields: object,
) -> Demonstration:
    """A trial that was driven from centre to centre, a cell in 0.25 s."""
    path = np.asarray(cells, dtype=np.int64)
    xy_m = grid.centres_of(path)
    goal_x, goal_y = xy_m[-1]
    made = Demonstration(
        id=f"{participant}/{number}",
        participant=participant,
        condition=Condition.FORCE,
        corrected=True,
        cycle=None,
        start_ns=0,
        t_s=np.arange(len(path)) * 0.25,
        xy_m=xy_m,
        yaw_rad=np.zeros(len(path)),
        force_n=None,
        contacts=(),
        goal_m=(float(goal_x), float(goal_y)),
        people_m=np.reshape(np.asarray(people_m, dtype=float), (-1, 2)),
        robot_radius_m=0.25,
        grid=grid,
        cells=path,
    )
    return replace(made, **fields)


def drawn(scene: Scene, reward: Reward, count: int, seed: int) -> list[Demonstration]:
    """Demonstrations sampled from the policy of a reward: their truth is known."""
    paths = sample_paths(policy_of(reward, scene), scene.start, count, np.random.default_rng(seed))
    return [
        demonstration(scene.lattice.grid, scene.lattice.cells[paths.path(k)], scene.people_m, number=k + 1)
        for k in range(count)
    ]


def by_cell(scene: Scene, by_state: NDArray[np.float64], empty: float) -> NDArray[np.float64]:
    """An array by state, (n, ...), spread over the map, (rows, columns, ...)."""
    spread = np.full((*scene.lattice.grid.shape, *by_state.shape[1:]), empty)
    columns, rows = scene.lattice.cells.T
    spread[rows, columns] = by_state
    return spread


def by_participants(scene: Scene, reward: Reward, participants: int, each: int, seed: int) -> list[Demonstration]:
    """Demonstrations sampled from one reward, so many of each participant p01, p02, ..., one after the other."""
    names = [f"p{number + 1:02d}" for number in range(participants) for _ in range(each)]
    paths = drawn(scene, reward, len(names), seed)
    return [
        replace(one, participant=name, id=f"{name}/{k + 1}")
        for k, (one, name) in enumerate(zip(paths, names, strict=True))
    ]


def slow_values(scene: Scene, reward: Reward) -> NDArray[np.float64]:
    """(n,) soft values by value iteration in the log domain."""
    goal_column, goal_row = scene.lattice.cells[scene.goal].tolist()
    found = oracles.soft_values(by_cell(scene, reward.on(scene).value, -np.inf), (goal_column, goal_row))
    columns, rows = scene.lattice.cells.T
    return found[rows, columns]


def dense(scene: Scene, reward: Reward) -> NDArray[np.float64]:
    """(n, n) matrix M(s, s') = exp(r(s, a)) of the steps, written out."""
    matrix = np.zeros((scene.lattice.size, scene.lattice.size))
    source, move, target = scene.lattice.edges
    matrix[source, target] = np.exp(reward.on(scene).value[source, move])
    return matrix


def smooth_curve(seed: int, poses: int = 120) -> NDArray[np.float64]:
    """A curve about 4 m long whose heading wanders, with uneven distances between the poses."""
    rng = np.random.default_rng(seed)
    heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.07, poses))
    stride = rng.uniform(0.005, 0.06, poses)
    return rng.uniform(-1, 1, 2) + np.cumsum(stride[:, None] * np.stack([np.cos(heading), np.sin(heading)], 1), axis=0)


def shaken(seed: int) -> NDArray[np.float64]:
    """A curve seen by poses with 1 cm of noise: now and then backwards, and to and fro over borders of cells."""
    line = smooth_curve(seed)
    return line + np.random.default_rng(seed).normal(0, 0.01, line.shape)
