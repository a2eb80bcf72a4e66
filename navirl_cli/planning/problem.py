"""What to plan: a scene, with exact start and goal, from a map, a demonstration or a recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid, grid_from_occupancy
from navirl_cli.demos.people import people_during
from navirl_cli.errors import SceneError
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.logs.recording import Occupancy, Recording

#: The frame of a map without a name, as Nav2's map server names it.
MAP_FRAME: Final = "map"
NS_PER_S: Final = 1_000_000_000

Point = tuple[float, float]
#: On maps with more free cells than this only those are kept that lie on paths at most this much longer than the
#: shortest one, m. Longer paths have no probability: an additional metre divides it by e^33 under the published reward,
#: and by more than e^4 wherever the partition function is not nearly infinite.
LARGE, LONGER_M = 60_000, 4.0


@dataclass(frozen=True, eq=False)
class Problem:
    """A planning problem."""

    scene: Scene
    #: (x, y) m, map frame; inside the cells of the scene's start and goal.
    start_m: Point
    goal_m: Point
    #: (k, 2) m, map frame: the line that the robot would drive without people.
    nominal_m: FloatArray
    robot_radius_m: float
    #: Where the robot looks at the start, rad; None where unknown.
    start_yaw_rad: float | None = None
    #: Name of the map's frame.
    frame: str = MAP_FRAME
    #: When the scene was seen, ns on the clock of its log; 0 for a map.
    t_ns: int = 0

    @property
    def nominal_states(self) -> IntArray:
        """(k,) states of the nominal path: the shortest path that keeps nearest to the straight line."""
        return self.scene.hugging_path()


def grid_for(occupancy: Occupancy, robot_radius_m: float, resolution_m: float) -> Grid:
    """The cells that a robot's centre may enter, as an extraction makes them of a map."""
    grid = grid_from_occupancy(occupancy.data, occupancy.resolution_m, occupancy.origin_m, robot_radius_m)
    return grid.resampled(resolution_m)


def problem_on(
    grid: Grid,
    start_m: Point,
    goal_m: Point,
    people_m: Sequence[Point] | FloatArray,
    robot_radius_m: float,
    *,
    start_yaw_rad: float | None = None,
) -> Problem:
    """A problem on a map.

    Args:
        grid: Cells that the robot's centre may enter, on the reward's resolution.
        start_m: (x, y) m, map frame.
        goal_m: (x, y) m, map frame.
        people_m: (p, 2) m, map frame.
        robot_radius_m: Radius of the robot, m.
        start_yaw_rad: Where the robot looks at the start, rad.

    Raises:
        SceneError: Start or goal is off the map, in an obstacle or within the robot's radius of one; a person stands
            within the robot's radius of one of them; or no path connects them.
    """
    people = np.asarray(people_m, dtype=float).reshape(-1, 2)
    for name, point in (("start", start_m), ("goal", goal_m)):
        _check_end(grid, name, point)
        _check_apart(name, point, people, robot_radius_m)
    start, goal = grid.cells_of(start_m), grid.cells_of(goal_m)
    lattice = Lattice.around(grid, start)
    if lattice.states_of(goal[None])[0] < 0:
        raise SceneError(_walled_in(grid, lattice, start_m, goal_m))
    if lattice.size > LARGE:
        lattice = Lattice.around(_within_reach(lattice, start, goal), start)
        grid = lattice.grid
    scene = Scene.on(grid, start, goal, people, lattice)
    return Problem(scene, start_m, goal_m, scene.nominal_line_m(), robot_radius_m, start_yaw_rad)


def problem_of(demonstration: Demonstration) -> Problem:
    """The problem that the robot had in a demonstration.

    Raises:
        SceneError: As in :func:`navirl_cli.irl.scene.scenes_of`.
    """
    scene = scenes_of([demonstration])[0]
    nominal = scene.nominal_line_m() if demonstration.nominal_m is None else demonstration.nominal_m
    (x0, y0), (x1, y1) = demonstration.xy_m[[0, -1]].tolist()
    return Problem(
        scene,
        (x0, y0),
        (x1, y1),
        nominal,
        demonstration.robot_radius_m,
        float(demonstration.yaw_rad[0]),
        t_ns=demonstration.start_ns,
    )


@dataclass(frozen=True)
class Seen:
    """Where everybody is at one instant of a recording."""

    pose_m: Point
    yaw_rad: float
    people_m: tuple[Point, ...]
    #: The latest goal that was announced until then; None without one.
    goal_m: Point | None
    #: The instant, ns on the log's clock.
    t_ns: int


def seen_at(recording: Recording, at_s: float | None) -> Seen:
    """Robot, people and goal of a recording at an instant.

    Args:
        recording: The recording.
        at_s: Time after the first pose, s; None for the first goal's time, or the start without goals.

    Raises:
        SceneError: The recording has no pose at that time.
    """
    first, last = int(recording.t_ns[0]), int(recording.t_ns[-1])
    if at_s is None:
        goals = recording.goal_t_ns[(recording.goal_t_ns >= first) & (recording.goal_t_ns <= last)]
        t_ns = int(goals[0]) if len(goals) else first
    else:
        t_ns = first + round(at_s * NS_PER_S)
    if not first <= t_ns <= last:
        raise SceneError(
            f"{recording.log}: `at`: expected a time within its poses, 0 to {(last - first) / NS_PER_S:.1f} s after "
            f"the first, found {at_s:g}"
        )
    row = min(int(np.searchsorted(recording.t_ns, t_ns)), len(recording.t_ns) - 1)
    announced = np.flatnonzero(recording.goal_t_ns <= t_ns)
    goal = recording.goal_m[announced[-1]].tolist() if len(announced) else None
    people = people_during(recording, t_ns - NS_PER_S, t_ns).people_m.tolist()
    return Seen(
        pose_m=(float(recording.xy_m[row, 0]), float(recording.xy_m[row, 1])),
        yaw_rad=float(recording.yaw_rad[row]),
        people_m=tuple((x, y) for x, y in people),
        goal_m=None if goal is None else (goal[0], goal[1]),
        t_ns=t_ns,
    )


def _check_end(grid: Grid, name: str, point_m: Point) -> None:
    """Refuse a start or goal where the robot cannot stand."""
    x, y = point_m
    cell = grid.cells_of(point_m)
    if not grid.contains(cell):
        x0, x1, y0, y1 = grid.extent_m
        raise SceneError(
            f"`{name}`: expected a place on the map, which spans x {x0:.2f} to {x1:.2f} m and y {y0:.2f} to "
            f"{y1:.2f} m, found x {x:.2f} m, y {y:.2f} m"
        )
    if grid.is_occupied(cell):
        free = np.argwhere(~grid.occupied)[:, ::-1]
        near = ""
        if len(free):
            nearest = grid.centres_of(free[np.hypot(*(free - cell).T).argmin()])
            near = f"; the nearest place that is free is x {nearest[0]:.2f} m, y {nearest[1]:.2f} m"
        raise SceneError(
            f"`{name}`: x {x:.2f} m, y {y:.2f} m is occupied: it lies in an obstacle, in unknown space, or within the "
            f"robot's radius of one{near}"
        )


def _check_apart(name: str, point_m: Point, people_m: FloatArray, robot_radius_m: float) -> None:
    """Refuse a start or goal at which the robot would stand in a person."""
    away = np.hypot(*(people_m - point_m).T)
    if away.size and away.min() < robot_radius_m:
        x, y = people_m[away.argmin()]
        raise SceneError(
            f"`{name}`: the person at x {x:.2f} m, y {y:.2f} m stands {away.min():.2f} m from it, within the robot's "
            f"radius of {robot_radius_m:g} m"
        )


def _within_reach(lattice: Lattice, start: IntArray, goal: IntArray) -> Grid:
    """The map without the cells that only paths much longer than the shortest one reach."""
    first, last = lattice.states_of(np.stack([start, goal]))
    to_goal = lattice.costs_to(int(last), lattice.step_m)
    from_start = np.hypot(*(lattice.xy_m - lattice.xy_m[first]).T)  # no path is shorter
    near = lattice.cells[from_start + to_goal <= to_goal[first] + LONGER_M]
    occupied = np.ones(lattice.grid.shape, dtype=bool)
    occupied[near[:, 1], near[:, 0]] = False
    return Grid(occupied, lattice.grid.resolution_m, lattice.grid.origin_m)


def _walled_in(grid: Grid, lattice: Lattice, start_m: Point, goal_m: Point) -> str:
    """Which of start and goal is walled in, and how much room it has."""
    around_goal = int(grid.connected_to(grid.cells_of(goal_m)).sum())
    name, point, cells = (
        ("goal", goal_m, around_goal) if around_goal < lattice.size else ("start", start_m, lattice.size)
    )
    area = cells * grid.resolution_m**2
    return (
        f"no free path on the map: the {name} at x {point[0]:.2f} m, y {point[1]:.2f} m is walled in, with {area:.1f} "
        "m2 of free space around it; check the map and the robot's radius"
    )
