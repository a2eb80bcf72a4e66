"""Where the pooled reward leads: in the study's scene (Fig. 8), and in scenes without demonstrations (Fig. 9)."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.errors import SceneError
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.irl.solved import SolvedScene, solved
from navirl_cli.study.pipeline import Study

#: Two people stand at these shares of the nominal path, this far to its left and to its right, m.
SHARES, ASIDE_M = (0.35, 0.65), 0.4
#: A large obstacle reaches this far along the nominal path, and from so far to its left on to the left, m.
LONG_M, WIDE_M, OFF_M = 1.5, 1.0, 0.8
#: The person beside it stands this far to the right of the nominal path, m.
BESIDE_M = 0.5


@dataclass(frozen=True, eq=False)
class PooledPolicy:
    """Where the reward of all second cycles leads, scene by scene with their titles; empty without such a reward."""

    seen: tuple[tuple[str, SolvedScene], ...]
    unseen: tuple[tuple[str, SolvedScene], ...]
    #: For which unseen scenes the study's hallway has no room, and why.
    notes: tuple[str, ...]


def pooled_policy(study: Study) -> PooledPolicy:
    """Solve the scene of the first second-cycle trial, and scenes made from it, under the pooled reward.

    Raises:
        InfinitePartitionError: The reward has no policy in one of them.
    """
    if study.pooled.second is None:
        return PooledPolicy((), (), ())
    reward, one = study.pooled.second.fit.reward, study.seconds[0]
    scene, unseen, notes = scenes_of([one])[0], [], []
    for title, make in (
        ("two people", two_people),
        ("person beside a large obstacle", partial(beside_obstacle, robot_radius_m=one.robot_radius_m)),
    ):
        try:
            unseen.append((title, solved(reward, make(scene))))
        except SceneError as error:
            notes.append(f"no unseen scene with {title}: {error}")
    return PooledPolicy((("scene of the study", solved(reward, scene)),), tuple(unseen), tuple(notes))


def two_people(scene: Scene) -> Scene:
    """Two people in the scene's hallway, one on each side of the path.

    Raises:
        SceneError: No path is left.
    """
    places = [_beside(scene, share, side * ASIDE_M) for share, side in zip(SHARES, (1, -1), strict=True)]
    return _scene(scene, scene.lattice.grid, np.array(places))


def beside_obstacle(scene: Scene, robot_radius_m: float) -> Scene:
    """A person on one side of the path and a large obstacle on the other.

    Args:
        scene: Gives the hallway.
        robot_radius_m: The obstacle is grown by it, m.

    Raises:
        SceneError: No path is left.
    """
    grid = scene.lattice.grid
    along, across = _axes(scene)
    rows, columns = np.indices(grid.shape)
    away = grid.centres_of(np.stack([columns, rows], axis=2)) - _beside(scene, 0.5, 0.0)
    forward, left = np.abs(away @ along), away @ across
    block = (forward <= LONG_M / 2) & (left >= OFF_M) & (left <= OFF_M + WIDE_M)
    grown = Grid(block, grid.resolution_m, grid.origin_m).inflated(robot_radius_m)
    blocked = Grid(grid.occupied | grown.occupied, grid.resolution_m, grid.origin_m)
    return _scene(scene, blocked, _beside(scene, 0.5, -BESIDE_M)[None])


def _axes(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Unit vectors from start to goal, and to the left of it."""
    ahead = scene.lattice.xy_m[scene.goal] - scene.lattice.xy_m[scene.start]
    along: FloatArray = ahead / np.hypot(*ahead)
    return along, np.array([-along[1], along[0]])


def _beside(scene: Scene, share: float, left_m: float) -> FloatArray:
    """(2,) m: a place beside the straight line from start to goal."""
    start, goal = scene.lattice.xy_m[[scene.start, scene.goal]]
    place: FloatArray = start + share * (goal - start) + left_m * _axes(scene)[1]
    return place


def _scene(scene: Scene, grid: Grid, people_m: FloatArray) -> Scene:
    """The same start and goal among other people and obstacles."""
    start, goal = scene.lattice.cells[[scene.start, scene.goal]]
    return Scene.on(grid, start, goal, people_m)
