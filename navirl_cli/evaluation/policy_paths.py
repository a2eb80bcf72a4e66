"""Paths of a policy: drawn ones measured all at once, expected values from visits, distances to a demonstrated path."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.demos.grid import MOVES, TURN_RAD, moves_along
from navirl_cli.evaluation.lines import Lines
from navirl_cli.evaluation.segments import Segments
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.paths import SampledPaths
from navirl_cli.irl.values import Policy


@dataclass(frozen=True, eq=False)
class Steps:
    """What every step of a lattice adds to the properties of a path."""

    lattice: Lattice
    #: (p, 2) m.
    people_m: FloatArray
    #: Subtracted from distances, m.
    robot_radius_m: float

    @cached_property
    def segments(self) -> Segments:
        """Arrays of shape (n, 8); those of impossible steps hold no meaning."""
        start = np.broadcast_to(self.lattice.xy_m[:, None], (self.lattice.size, 8, 2))
        end = start + MOVES * self.lattice.grid.resolution_m
        return Segments(start, end, self.people_m, self.robot_radius_m)


@dataclass(frozen=True, eq=False)
class PolicyLines(Lines):
    """Paths drawn from a policy, through the centres of cells: their steps are looked up, not measured again."""

    steps: Steps
    paths: SampledPaths

    @staticmethod
    def of(steps: Steps, paths: SampledPaths, nominal_m: FloatArray) -> "PolicyLines":
        """Drawn paths as lines.

        Args:
            steps: Of the lattice on which the paths were drawn.
            paths: The paths.
            nominal_m: (k, 2) m.
        """
        lines = steps.lattice.xy_m[paths.states]
        return PolicyLines(lines, nominal_m, steps.people_m, steps.robot_radius_m, steps, paths)

    @cached_property
    def length_m(self) -> FloatArray:
        """(m,) path length, m."""
        length: FloatArray = np.where(self._driven, self.steps.lattice.step_m[self._moves], 0.0).sum(axis=1)
        return length

    @cached_property
    def min_distance_m(self) -> FloatArray:
        """(m,) smallest distance between the robot's shell and a person's centre, m; needs people."""
        least = self.steps.segments.least_m[self._here, self._moves]
        smallest: FloatArray = np.where(self._driven, least, np.inf).min(axis=1)
        return smallest

    @cached_property
    def zones_m(self) -> FloatArray:
        """(m, 4) path length in each of ZONES, m; needs people."""
        zones = np.moveaxis(self.steps.segments.zones_m, -1, 0)
        return np.stack([self._total(one) for one in zones], axis=1)

    @cached_property
    def mean_distance_m(self) -> FloatArray:
        """(m,) mean along the path of the distance between shell and nearest person, m; needs people."""
        return self._total(self.steps.segments.distance_m2) / self.length_m

    @cached_property
    def heading_rad(self) -> FloatArray:
        """(m,) sum of the absolute changes of direction from move to move, rad."""
        both = self._driven[:, 1:] & self._driven[:, :-1]
        turned: FloatArray = np.where(both, TURN_RAD[self._moves[:, :-1], self._moves[:, 1:]], 0.0).sum(axis=1)
        return turned

    @cached_property
    def _moves(self) -> IntArray:
        """(m, n - 1) numbers of the moves; -1 where a path stays in the goal."""
        return moves_along(self.steps.lattice.cells[self.paths.states])

    @property
    def _driven(self) -> BoolArray:
        """(m, n - 1) whether a path moves."""
        return self._moves >= 0

    @property
    def _here(self) -> IntArray:
        """(m, n - 1) states from which a path moves."""
        return self.paths.states[:, :-1]

    def _total(self, values: FloatArray) -> FloatArray:
        """(m,) sums along the paths of (n, 8) values of steps."""
        summed: FloatArray = np.where(self._driven, values[self._here, self._moves], 0.0).sum(axis=1)
        return summed


@dataclass(frozen=True, eq=False)
class Visits:
    """Exact expected values of what adds up along the paths of a policy, from its visits."""

    steps: Steps
    #: On the same lattice.
    policy: Policy
    #: Cell of the lattice in which paths start.
    start: int

    @property
    def length_m(self) -> float:
        """Expected path length, m."""
        return float((self._flow * self.steps.lattice.step_m).sum())

    @property
    def zones_m(self) -> FloatArray:
        """(4,) expected path length in each of ZONES, m; needs people."""
        zones: FloatArray = np.einsum("sm,smz->z", self._flow, self.steps.segments.zones_m)
        return zones

    @property
    def heading_rad(self) -> float:
        """Expected sum of the absolute changes of direction, rad."""
        # The next move is drawn in the state where this one ends; the goal has no next move.
        policy = self.policy
        turns = policy.probability @ TURN_RAD.T
        flow = policy.visits_from(self.start)[:, None] * policy.probability
        after = np.where(flow > 0, policy.graph.neighbours, 0)
        return float((flow * turns[after, np.arange(8)]).sum())

    @cached_property
    def _flow(self) -> FloatArray:
        """(n, 8) expected number of times that each step is taken."""
        return self.policy.flow_by_cell(self.start)


@dataclass(frozen=True, eq=False)
class Nearness:
    """How far a demonstrated path and drawn ones are from each other, all through the centres of cells.

    Distances are from the centres of a path's cells to the other path's segments.
    """

    #: (k, 2) m, centres of the demonstrated path's cells.
    demonstrated_m: FloatArray
    lattice: Lattice
    paths: SampledPaths

    @cached_property
    def to_learnt_m(self) -> FloatArray:
        """(m,) mean over the demonstrated cells of the distance to each drawn path, m."""
        from shapely import distance, linestrings, points

        lines = linestrings(self.lattice.xy_m[self.paths.states])
        mean: FloatArray = distance(points(self.demonstrated_m)[None, :], lines[:, None]).mean(axis=1)
        return mean

    @cached_property
    def from_learnt_m(self) -> FloatArray:
        """(m,) mean over the cells of each drawn path of the distance to the demonstrated one, m."""
        from shapely import LineString, distance, points

        # Drawn paths share cells: the distance of each cell is measured once.
        seen = np.unique(self.paths.states)
        away = np.zeros(self.lattice.size)
        away[seen] = distance(points(self.lattice.xy_m[seen]), LineString(self.demonstrated_m))
        on_path = np.arange(self.paths.states.shape[1]) < self.paths.lengths[:, None]
        mean: FloatArray = np.where(on_path, away[self.paths.states], 0.0).sum(axis=1) / self.paths.lengths
        return mean
