"""A smooth line beside a path on cells, and the speeds with which a robot can drive it.

The line minimises its bending, the sum of squared second differences, while every point stays within a tolerance of the
path, out of occupied cells, and no nearer to any person than the path comes. The minimum is found by the alternating
direction method of multipliers (S. Boyd et al., Foundations and Trends in Machine Learning 3, 2011): a linear system
with five diagonals for the bending, a projection of each point onto its own set.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.demos.lines import divided
from navirl_cli.evaluation.segments import Segments
from navirl_cli.planning.problem import Problem

#: Distance of the points of a smooth line, m, as a share of a cell.
_PIECE: Final = 0.5
#: Iterations of a search, and searches with tighter sets where the last line broke a rule.
_ITERATIONS, _SEARCHES = 150, 12
#: Weight of the bending against the distance from the sets.
_BENDING: Final = 3000.0
#: Weight of the two ends, which stay where they are.
_FIXED: Final = 1e6
#: Of the tolerance and of the distance from people a search keeps this much in reserve, m.
_RESERVE_M: Final = 2e-3
#: A diagonal move passes the corner between two occupied cells; rounding may put it inside by this much, m.
_CORNER_M: Final = 1e-3


@dataclass(frozen=True, eq=False)
class Limits:
    """What a robot can do."""

    speed_m_s: float = 0.5
    #: Forward, backward and sideways, m/s^2.
    acceleration_m_s2: float = 0.5


@dataclass(frozen=True, eq=False)
class SmoothLine:
    """A line with its curvature and the times at which it can be driven."""

    #: (n, 2) m, map frame.
    xy_m: FloatArray
    #: (n,) direction of travel, rad.
    yaw_rad: FloatArray
    #: (n,) 1/m, positive to the left.
    curvature_1_m: FloatArray
    #: (n,) m/s.
    speed_m_s: FloatArray
    #: (n,) s since the start.
    t_s: FloatArray
    #: Largest distance from the path on cells, m.
    deviation_m: float


def smoothed(problem: Problem, line_m: FloatArray, tolerance_m: float, limits: Limits) -> SmoothLine:
    """Smooth a path.

    Args:
        problem: Whose obstacles and people count.
        line_m: (k, 2) m, a path through the centres of free cells.
        tolerance_m: Largest distance of the result from the path, m.
        limits: Of the robot.

    Returns:
        The line with the least bending that was found. Where obstacles leave no room it is the path itself.
    """
    grid = problem.scene.lattice.grid
    rough, _ = divided(line_m, np.arange(float(len(line_m))), _PIECE * grid.resolution_m)
    keep = _least_distances_m(line_m, problem.scene.people_m)
    room = np.full(len(rough), max(tolerance_m - _RESERVE_M, 0.0))
    room[[0, -1]] = 0.0
    for _ in range(_SEARCHES):
        for fine in _band(rough, room, problem.scene.people_m, keep, grid):
            wrong = _wrong(fine, rough, room, problem, keep)
            if not wrong.any():
                return _timed(fine, float(np.hypot(*(fine - rough).T).max()), limits)
        # tighter where a rule is broken and around it
        around = np.convolve(wrong, np.ones(5), mode="same") > 0
        room = np.where(around, room / 4, room)
    return _timed(rough, 0.0, limits)


def _least_distances_m(line_m: FloatArray, people_m: FloatArray) -> FloatArray:
    """(p,) smallest distance of a line from each person's centre, m."""
    return np.array([Segments(line_m[:-1], line_m[1:], one[None], 0.0).least_m.min() for one in people_m])


def _band(
    rough: FloatArray, room: FloatArray, people_m: FloatArray, keep: FloatArray, grid: Grid
) -> tuple[FloatArray, FloatArray]:
    """(n, 2) the line with the least bending whose points are in their sets, smooth and nearly so, or exactly so."""
    from scipy.linalg import cho_solve_banded, cholesky_banded

    weight = np.ones((len(rough), 1))
    weight[[0, -1]] = _FIXED
    factor = cholesky_banded(_bending_bands(len(rough)))
    allowed, dual = rough.copy(), np.zeros_like(rough)
    for _ in range(_ITERATIONS):
        line = cho_solve_banded((factor, False), (allowed - dual) * weight)
        allowed = _projected(line + dual, rough, room, people_m, keep, grid)
        dual += line - allowed
    tight = room <= _RESERVE_M
    line[tight] = allowed[tight] = rough[tight]
    return line, allowed


def _bending_bands(count: int) -> FloatArray:
    """(3, count) upper diagonals of I + w D^T D, with D the second differences; the ends hardly move."""
    inner = np.zeros((3, count))
    inner[2, :-2] += 1
    inner[2, 1:-1] += 4
    inner[2, 2:] += 1
    inner[1, 1:-1] += -2
    inner[1, 2:] += -2
    inner[0, 2:] += 1
    bands = _BENDING * inner
    bands[2] += 1
    bands[2, [0, -1]] += _FIXED - 1
    return bands


def _projected(
    points: FloatArray, rough: FloatArray, room: FloatArray, people_m: FloatArray, keep: FloatArray, grid: Grid
) -> FloatArray:
    """(n, 2) points moved into their sets: near the path, away from people, out of occupied cells."""
    for person, least in zip(people_m, keep, strict=True):
        away = points - person
        distance = np.maximum(np.hypot(*away.T), 1e-9)
        points = person + away * np.maximum(1.0, (least + _RESERVE_M) / distance)[:, None]
    moved = points - rough
    size = np.hypot(*moved.T)
    moved = moved * np.minimum(1.0, room / np.maximum(size, 1e-12))[:, None]
    blocked = grid.is_occupied(grid.cells_of(rough + moved))
    for share in (0.5, 0.25, 0.0):
        if not blocked.any():
            break
        moved[blocked] = (moved * share)[blocked]
        blocked = grid.is_occupied(grid.cells_of(rough + moved)) & (share > 0)
    inside: FloatArray = rough + moved
    return inside


def _wrong(fine: FloatArray, rough: FloatArray, room: FloatArray, problem: Problem, keep: FloatArray) -> BoolArray:
    """(n,) whether a line breaks a rule at a point or up to the next one."""
    grid, people = problem.scene.lattice.grid, problem.scene.people_m
    wrong: BoolArray = np.hypot(*(fine - rough).T) > room + _RESERVE_M
    starts, ends = fine[:-1], fine[1:]
    for person, least in zip(people, keep, strict=True):
        near = Segments(starts, ends, person[None], 0.0).least_m < least - 1e-9
        wrong[:-1] |= near
        wrong[1:] |= near
    for share in np.linspace(0, 1, 21):
        on = starts + share * (ends - starts)
        away = on - (rough[:-1] + share * np.diff(rough, axis=0))
        blocked = grid.is_occupied(grid.cells_of(on)) & (np.hypot(*away.T) > _CORNER_M)
        wrong[:-1] |= blocked
        wrong[1:] |= blocked
    # the path itself may be tangent to its own least distance
    wrong &= room > _RESERVE_M / 10
    return wrong


def _timed(line_m: FloatArray, deviation_m: float, limits: Limits) -> SmoothLine:
    """A line with curvature, and the highest speeds within the limits, from rest to rest."""
    steps = np.diff(line_m, axis=0)
    length = np.hypot(*steps.T)
    yaw = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    between = np.zeros(len(line_m))
    between[1:-1] = np.diff(yaw) / ((length[1:] + length[:-1]) / 2)
    curved = np.sqrt(limits.acceleration_m_s2 / np.maximum(np.abs(between), 1e-9))
    speed = np.minimum(curved, limits.speed_m_s)
    speed[[0, -1]] = 0.0
    for order in (range(len(length)), range(len(length) - 1, -1, -1)):
        forward = order.step > 0
        for i in order:
            here, there = (i, i + 1) if forward else (i + 1, i)
            reached = np.sqrt(speed[here] ** 2 + 2 * limits.acceleration_m_s2 * length[i])
            speed[there] = min(speed[there], reached)
    t_s = np.concatenate([[0.0], np.cumsum(2 * length / np.maximum(speed[1:] + speed[:-1], 1e-9))])
    heading = np.concatenate([yaw[:1], (yaw[1:] + yaw[:-1]) / 2, yaw[-1:]])
    return SmoothLine(line_m, heading, between, speed, t_s, deviation_m)
