"""A trust-region Newton method within bounds, for few variables and exact second derivatives.

Variables on a bound stay there only while the gradient pushes outward, so that a bound is let go as soon as the
objective gains by it; the trust-region step is exact (one small eigenvalue problem), hence directions of negative
curvature are followed and not stuck at.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray

MAX_ITERATIONS = 200
#: The Newton step promises less than this gain, in nats: the optimum is reached for every purpose.
GAIN_TOLERANCE = 1e-9
#: Of a first search, and of others, which are to learn soon whether they are bound for the same.
FIRST_RADIUS, AGAIN_RADIUS = 1.0, 4.0
MAX_RADIUS = 16.0
#: Nats below a known maximum within which it is asked whether the search is bound for it; how far from it, in every
#: variable or in nats, and how many nats from its value it may seem to land.
NEAR, PLACE, ALIKE, SAME = 50.0, 1.0, 0.02, 0.5
#: Share of the radius by which a step to the region's edge may miss it.
EDGE = 1e-10
#: A region this small (in units of the variables) means that the objective contradicts its derivatives.
MIN_RADIUS = 1e-12


@dataclass(frozen=True, eq=False)
class Point:
    """The objective at one place; value -inf where it does not exist."""

    x: FloatArray
    value: float
    gradient: FloatArray
    hessian: FloatArray


@dataclass(frozen=True, eq=False)
class Maximum:
    """Where a search ended."""

    best: Point
    #: True where the promised gain fell below the tolerance.
    converged: bool
    #: True where the last place that was tried does not exist.
    blocked: bool
    #: (i, k) accepted places and (i,) values there, the start first.
    path: FloatArray
    path_value: FloatArray


def maximise(
    objective: Callable[[FloatArray], Point],
    start: Point,
    bounds: tuple[FloatArray, FloatArray],
    free: NDArray[np.bool_],
    progress: Callable[[float], None] | None = None,
    known: Sequence[Point] = (),
) -> Maximum:
    """Climb to a local maximum.

    Args:
        objective: Value, gradient and Hessian at (k,) variables; value -inf where it does not exist.
        start: Within the bounds; the objective must exist there.
        bounds: (k,) lower and upper ones.
        free: (k,) variables that may move.
        progress: Called with every accepted value.
        known: Maxima found before; the search ends, short of convergence, where it is bound for one of them.

    Returns:
        The maximum and the path to it.
    """
    lower, upper = bounds
    here, path, radius = start, [start], AGAIN_RADIUS if known else FIRST_RADIUS
    converged = blocked = False
    while len(path) <= MAX_ITERATIONS and radius > MIN_RADIUS:
        if any(_bound_for(here, top, bounds, free) for top in known):
            break
        step = _step(here, lower, upper, free, radius)
        promised = _promise(here, step)
        # A step that the region holds back promises little because it is short, not because the top is near.
        if promised < GAIN_TOLERANCE and np.linalg.norm(step) < 0.9 * radius:
            converged = True
            break
        # A variable that meets its bound stands on it, not a rounding beside it.
        onto = np.where(step == lower - here.x, lower, np.where(step == upper - here.x, upper, here.x + step))
        there = objective(onto)
        gained, blocked = there.value - here.value, there.value == -np.inf
        if not gained > 0.25 * promised:
            radius = 0.25 * float(np.linalg.norm(step))
        elif gained > 0.75 * promised and np.linalg.norm(step) > 0.8 * radius:
            radius = min(2 * radius, MAX_RADIUS)
        # Below the rounding of the sum a gain cannot be distinguished from noise, and a Newton step is trusted.
        noise = 1e-12 * abs(here.value)
        if gained > 0.05 * promised or (promised < noise and gained > -noise):
            here = there
            path.append(here)
            if progress is not None:
                progress(here.value)
    history = np.array([point.x for point in path]), np.array([point.value for point in path])
    return Maximum(here, converged, blocked, *history)


def _bound_for(here: Point, top: Point, bounds: tuple[FloatArray, FloatArray], free: NDArray[np.bool_]) -> bool:
    """Whether a full step from here lands on a known maximum, by place and by value."""
    if here.value < top.value - NEAR:
        return False
    step = _step(here, *bounds, free, MAX_RADIUS)
    away = here.x + step - top.x
    apart = -0.5 * float(away @ top.hessian @ away)
    # In units or in nats: where the top is flat, places that are far apart may be the same for every purpose.
    near = bool(np.abs(away).max() < PLACE) or 0 <= apart < ALIKE
    return near and abs(here.value + _promise(here, step) - top.value) < SAME


def _step(here: Point, lower: FloatArray, upper: FloatArray, free: NDArray[np.bool_], radius: float) -> FloatArray:
    """A step that raises the quadratic model within region and bounds.

    It heads for the model's best place in the region and stops at the first bound, where it heads for the best place
    along the bound, and so on; the best place along it is taken, so that a bound never costs the ascent.
    """
    outward = ((here.x <= lower) & (here.gradient < 0)) | ((here.x >= upper) & (here.gradient > 0))
    moving = free & ~outward
    low, high = lower - here.x, upper - here.x
    step = best = np.zeros_like(here.x)
    while moving.any():
        gradient = here.gradient[moving] + here.hessian[np.ix_(moving, ~moving)] @ step[~moving]
        left = np.sqrt(max(radius**2 - float(step[~moving] @ step[~moving]), 0.0))
        direction = np.zeros_like(step)
        direction[moving] = _region_step(gradient, here.hessian[np.ix_(moving, moving)], left) - step[moving]
        room = np.full_like(step, np.inf)
        room[direction > 0] = (high - step)[direction > 0] / direction[direction > 0]
        room[direction < 0] = (low - step)[direction < 0] / direction[direction < 0]
        met = room <= min(float(room.min()), 1.0)
        step = np.where(met, np.where(direction > 0, high, low), step + min(float(room.min()), 1.0) * direction)
        if _promise(here, step) > _promise(here, best):
            best = step
        if not met.any():
            break
        moving &= ~met
    return best


def _promise(here: Point, step: FloatArray) -> float:
    """Gain of the quadratic model."""
    return float(here.gradient @ step + 0.5 * step @ here.hessian @ step)


def _region_step(gradient: FloatArray, hessian: FloatArray, radius: float) -> FloatArray:
    """argmax of g.p + p.H.p/2 over |p| <= radius (Nocedal and Wright, Numerical Optimization, Sec. 4.3)."""
    if radius <= 0:
        return np.zeros_like(gradient)
    curvature, basis = np.linalg.eigh(hessian)
    slope = basis.T @ gradient
    steepest = float(curvature[-1])
    if steepest < 0:
        step = -slope / curvature
        if float(step @ step) <= radius**2:
            full: FloatArray = basis @ step
            return full
    # |p(shift)| falls from infinity to 0 as the shift grows above the largest curvature; 1/|p| is all but linear in it.
    floor = max(steepest, 0.0)
    low, high = floor * (1 + 1e-15) + 1e-14, floor + float(np.linalg.norm(slope)) / max(radius, 1e-100) + 1e-12
    shift = high
    for _ in range(80):
        step = slope / (shift - curvature)
        length = float(np.sqrt(step @ step))
        low, high = (shift, high) if length > radius else (low, shift)
        if abs(length - radius) < EDGE * radius:
            high = shift
            break
        if length > 0:  # a saddle has no slope
            shift += (length / radius - 1) * length**2 / float(step @ (step / (shift - curvature)))
        if not low < shift < high:
            shift = floor + np.sqrt((low - floor) * (high - floor)) if low > floor else 0.5 * (low + high)
    step = slope / (high - curvature)
    rest = radius**2 - float(step @ step)
    if steepest >= 0 and rest > 0 and abs(slope[-1]) < 1e-12:
        step[-1] = np.sqrt(rest)  # the hard case: a saddle is left along its steepest direction
    edge: FloatArray = basis @ step
    return edge
