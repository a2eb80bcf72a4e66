"""A scene for planning: a map, a start, a goal, people, and the nominal path between start and goal."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.cells import distances_to
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.errors import SceneError
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.ordering import Ordering
from navirl_cli.irl.turns import TurnGraph


@dataclass(frozen=True, eq=False)
class Scene:
    """One planning problem of the decision process (Sec. III-B): states, start, goal and people."""

    lattice: Lattice
    #: Numbers of the states.
    start: int
    goal: int
    #: (p, 2) m, map frame.
    people_m: FloatArray

    def __post_init__(self) -> None:
        """Check that start and goal differ."""
        if self.start == self.goal:
            x, y = self.lattice.xy_m[self.start]
            raise SceneError(
                f"start and goal lie in the same cell at x {x:.2f} m, y {y:.2f} m: there is nothing to plan"
            )

    def __reduce__(self) -> tuple[Any, ...]:
        """Cross process borders without what is computed from it."""
        return Scene, (self.lattice, self.start, self.goal, self.people_m)

    @staticmethod
    def on(
        grid: Grid, start: IntArray, goal: IntArray, people_m: FloatArray, lattice: Lattice | None = None
    ) -> "Scene":
        """Build a scene from cells.

        Args:
            grid: Free cells for the robot's centre.
            start: (2,) column and row.
            goal: (2,) column and row.
            people_m: (p, 2) m, map frame.
            lattice: The lattice around the start, if it is already known.

        Raises:
            SceneError: Start or goal is not free, or no path connects them.
        """
        lattice = Lattice.around(grid, start) if lattice is None else lattice
        first, last = (int(state) for state in lattice.states_of(np.stack([start, goal])))
        if first < 0 or last < 0:
            (x0, y0), (x1, y1) = grid.centres_of(start), grid.centres_of(goal)
            raise SceneError(
                f"goal unreachable: no free path on the map from x {x0:.2f} m, y {y0:.2f} m to x {x1:.2f} m, "
                f"y {y1:.2f} m; check the map, the goal and the robot's radius"
            )
        return Scene(lattice, first, last, np.asarray(people_m, dtype=float).reshape(-1, 2))

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for scenes that have the same policy."""
        return self.lattice.grid.digest, self.start, self.goal, self.people_m.tobytes()

    @cached_property
    def ordering(self) -> Ordering:
        """The states by the length of their shortest 8-connected path to the goal, m."""
        return self.lattice.ordering_to(self.goal)

    @cached_property
    def turn_ordering(self) -> Ordering:
        """The cells by incoming move (:class:`~navirl_cli.irl.turns.TurnGraph`), in the order of the cells."""
        graph = TurnGraph.of(self.lattice, self.goal)
        cells = self.ordering
        return Ordering(
            graph, graph.beginning_in(self.goal), cells.distance[graph.cell], np.broadcast_to(cells.step[0], graph.size)
        )

    @cached_property
    def nominal(self) -> NDArray[np.bool_]:
        """(n,) cells on any shortest obstacle-free 8-connected path from start to goal."""
        from_start = self.lattice.costs_to(self.start, self.lattice.step_m)
        to_goal = self.ordering.distance
        shortest = to_goal[self.start]
        # Sums of the same steps in different orders differ in their last digits.
        on_path: NDArray[np.bool_] = from_start + to_goal <= shortest * (1 + 1e-9)
        return on_path

    @cached_property
    def deviation_m(self) -> FloatArray:
        """(n,) distance d(s) of every cell's centre to the nearest cell of the nominal path, m (Eq. 11)."""
        nominal = np.zeros(self.lattice.grid.shape, dtype=bool)
        columns, rows = self.lattice.cells.T
        nominal[rows, columns] = self.nominal
        deviation: FloatArray = distances_to(nominal)[rows, columns] * self.lattice.grid.resolution_m
        return deviation

    @cached_property
    def travel_past_people(self) -> FloatArray:
        """(p, 2) unit vectors along the nominal path (:meth:`nominal_line_m`) where it is nearest to each person."""
        line = self.nominal_line_m()
        begin, along = line[:-1], np.diff(line, axis=0)
        offset = self.people_m[:, None, :] - begin[None]
        share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        away = np.hypot(*np.moveaxis(offset - share[..., None] * along, 2, 0))
        nearest = along[away.argmin(axis=1)]
        directions: FloatArray = nearest / np.hypot(*nearest.T)[:, None]
        return directions

    def nominal_line_m(self) -> FloatArray:
        """The nominal path as a line: a shortest path, made straight where no obstacle lies between.

        Returns:
            (k, 2) m, map frame, from the start's centre to the goal's.
        """
        states = self.hugging_path()
        line, here = [0], 0
        while here < len(states) - 1:
            ahead = len(states) - 1
            while ahead > here + 1 and not self._sees(states[here], states[ahead]):
                ahead -= 1
            line.append(ahead)
            here = ahead
        corners: FloatArray = self.lattice.xy_m[states[line]]
        return corners

    def hugging_path(self) -> IntArray:
        """(k,) states of the shortest path that keeps nearest to the straight line from start to goal."""
        xy = self.lattice.xy_m - self.lattice.xy_m[self.start]
        ahead = self.lattice.xy_m[self.goal] - self.lattice.xy_m[self.start]
        right = (xy[:, 0] * ahead[1] - xy[:, 1] * ahead[0]) / np.hypot(*ahead)
        aside = np.abs(right) + 1e-3 * right  # of two mirrored paths the left one
        # Too small to make a longer path cheaper.
        tie_break = 1e-8 * aside[:, None] * self.lattice.grid.resolution_m
        return self.lattice.descend(self.start, self.goal, self.lattice.step_m + tie_break)

    def _sees(self, one: int, other: int) -> bool:
        """Whether the straight line between two states passes free cells only."""
        ends = self.lattice.xy_m[[one, other]]
        length = float(np.hypot(*(ends[1] - ends[0])))
        count = max(2, int(np.ceil(length / self.lattice.grid.resolution_m * 8)))
        points = ends[0] + np.linspace(0, 1, count)[:, None] * (ends[1] - ends[0])
        return not self.lattice.grid.is_occupied(self.lattice.grid.cells_of(points)).any()


def avoidance_line_m(scene: Scene, clearance_m: float) -> FloatArray:
    """The path of a planner that treats people as obstacles only.

    It follows the straight line as long as this does not lengthen the detour, like a local planner that reacts to an
    obstacle only when it is near.

    Args:
        scene: The scene.
        clearance_m: Distance that the robot's centre keeps from a person's, m.

    Returns:
        (k, 2) m, map frame.

    Raises:
        SceneError: With the people as obstacles, no path connects start and goal.
    """
    grid = scene.lattice.grid.inflated(clearance_m, scene.people_m)
    blocked = Scene.on(grid, scene.lattice.cells[scene.start], scene.lattice.cells[scene.goal], scene.people_m)
    line: FloatArray = blocked.lattice.xy_m[blocked.hugging_path()]
    return line


def scenes_of(demonstrations: Iterable[Demonstration], known: Iterable[Scene] = ()) -> list[Scene]:
    """The scene of every demonstration; equal scenes are one object.

    The goal of a scene is the cell in which the trial ended, as in the study: a demonstration is a path into its
    absorbing goal.

    Args:
        demonstrations: The demonstrations.
        known: Scenes to take where they are equal, with all that they keep.

    Raises:
        SceneError: As in :meth:`Scene.on`, naming the demonstration.
    """
    found = {scene.key: scene for scene in known}
    lattices: dict[str, list[Lattice]] = {}
    for lattice in dict.fromkeys(scene.lattice for scene in found.values()):
        lattices.setdefault(lattice.grid.digest, []).append(lattice)
    scenes = []
    for demonstration in demonstrations:
        first, last = demonstration.cells[0], demonstration.cells[-1]
        built = lattices.setdefault(demonstration.grid.digest, [])
        around = next((one for one in built if one.states_of(first[None])[0] >= 0), None)
        try:
            scene = Scene.on(demonstration.grid, first, last, demonstration.people_m, around)
        except SceneError as error:
            raise SceneError(f"demonstration {demonstration.id}: {error}") from error
        if around is None:
            built.append(scene.lattice)
        scenes.append(found.setdefault(scene.key, scene))
    return scenes
