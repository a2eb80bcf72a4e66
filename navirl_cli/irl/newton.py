"""A trust-region Newton method within bounds, for few variables and exact second derivatives.

A variable on a bound stays there only while the gradient points outward. It leaves the bound as soon as that raises the
objective. The trust-region step is exact (one small eigenvalue problem), so directions of negative curvature are
followed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray

MAX_ITERATIONS = 200
#: Where the Newton step predicts a smaller gain than this, in nats, the search has converged.
GAIN_TOLERANCE = 1e-9
#: Initial radius of the first search, and of the others, which soon test whether they converge to the same maximum.
FIRST_RADIUS, AGAIN_RADIUS = 1.0, 4.0
#: Largest radius: an ascent without end, as that of a_p with few data, reaches a bound in a few steps. A search is
#: tested against known maxima with a step of the other radius.
MAX_RADIUS, TEST_RADIUS = 1e4, 16.0
#: In a search for a value of interest: promise at which it ends, nats, and its share of what is missing.
#: Its initial radius, as a share of the length of its start.
COARSE, HOPE, WIDE = 1e-3, 3.0, 0.25
#: A search this many nats below a known maximum is tested for convergence to it. Its predicted end may differ from the
#: maximum by so much in place (every variable, or nats) and by so much in value (nats).
NEAR, PLACE, ALIKE, SAME = 50.0, 1.0, 0.02, 0.5
#: Tolerance of the length of a step to the region's edge, as a share of the radius.
EDGE = 1e-10
#: A region this small (in units of the variables) means that the objective contradicts its derivatives.
MIN_RADIUS = 1e-12


@dataclass(frozen=True, eq=False)
class Point(ByContent):
    """The objective at one place; value -inf where it does not exist."""

    x: FloatArray
    value: float
    gradient: FloatArray
    hessian: FloatArray


@dataclass(frozen=True, eq=False)
class Maximum:
    """Where a search ended."""

    best: Point
    #: True where the predicted gain fell below the tolerance.
    converged: bool
    #: True where the objective does not exist at the last place tried.
    blocked: bool
    #: (i, k) accepted places and (i,) values there, the start first.
    path: FloatArray
    path_value: FloatArray


@dataclass(frozen=True)
class Effort:
    """When a search ends."""

    #: Largest number of steps.
    most: int = field(default_factory=lambda: MAX_ITERATIONS)
    #: A predicted gain below which it has converged, nats.
    enough: float = GAIN_TOLERANCE
    #: Whether it begins with long strides, as in a climb after a step along a ridge that is often flat.
    strides: bool = False


def maximise(
    objective: Callable[[FloatArray], Point],
    start: Point,
    bounds: tuple[FloatArray, FloatArray],
    free: NDArray[np.bool_],
    progress: Callable[[float], None] | None = None,
    known: Sequence[Point] = (),
    hope: float | None = None,
    effort: Effort | None = None,
) -> Maximum:
    """Climb to a local maximum.

    Args:
        objective: Value, gradient and Hessian at (k,) variables; value -inf where it does not exist.
        start: Within the bounds; the objective must exist there.
        bounds: (k,) lower and upper ones.
        free: (k,) variables that may move.
        progress: Called with every accepted value.
        known: Maxima found before. The search ends early where it is converging to one of them.
        hope: The value of interest, for a concave objective. The search ends early where it cannot be reached, or to
            within a coarse tolerance.
        effort: When the search ends; the default is :class:`Effort`.

    Returns:
        The maximum and the accepted places before it.
    """
    lower, upper = bounds
    effort = effort or Effort()
    here, path, radius = start, [start], FIRST_RADIUS if not known and hope is None else AGAIN_RADIUS
    if hope is not None or effort.strides:
        radius = max(radius, WIDE * float(np.linalg.norm(start.x)))  # a concave climb may take strides
    converged = blocked = False
    while len(path) <= effort.most and radius > MIN_RADIUS:
        if any(_bound_for(here, top, bounds, free) for top in known):
            break
        if hope is not None and _settled(here, hope, bounds, free):
            break
        step = _step(here, lower, upper, free, radius)
        promised = _promise(here, step)
        # A step limited by the region predicts a small gain because it is short, not because the maximum is near.
        if promised < effort.enough and np.linalg.norm(step) < 0.9 * radius:
            converged = True
            break
        # A variable that meets its bound is set to it exactly.
        onto = np.where(step == lower - here.x, lower, np.where(step == upper - here.x, upper, here.x + step))
        there = objective(onto)
        gained, blocked = there.value - here.value, there.value == -np.inf
        if not gained > 0.25 * promised:
            radius = 0.25 * float(np.linalg.norm(step))
        elif gained > 0.75 * promised and np.linalg.norm(step) > 0.8 * radius:
            radius = min(2 * radius, MAX_RADIUS)
        # A gain below the rounding of the sum cannot be distinguished from noise. The Newton step is trusted then.
        noise = 1e-12 * abs(here.value)
        if gained > 0.05 * promised or (promised < noise and gained > -noise):
            here = there
            path.append(here)
            if progress is not None:
                progress(here.value)
    path_arrays = np.array([point.x for point in path]), np.array([point.value for point in path])
    return Maximum(here, converged, blocked, *path_arrays)


def moved(
    here: Point, j: int, step: float, bounds: tuple[FloatArray, FloatArray], others: NDArray[np.bool_]
) -> FloatArray:
    """Where the maximum over other variables is expected after a step of variable j, by the quadratic model here.

    Args:
        here: The maximum over the other variables at the present value of variable j.
        j: Number of the variable.
        step: Of that variable.
        bounds: (k,) lower and upper ones.
        others: (k,) variables that may move.
    """
    pulled = Point(here.x, here.value, here.gradient + here.hessian[:, j] * step, here.hessian)
    x: FloatArray = here.x + _step(pulled, *bounds, others, AGAIN_RADIUS)
    x[j] = here.x[j] + step
    return x


def _settled(here: Point, hope: float, bounds: tuple[FloatArray, FloatArray], free: NDArray[np.bool_]) -> bool:
    """Whether a concave climb is near its end, or will end below a value: several times its promise does not reach it.

    A self-concordant function gains at most -d - ln(1 - d) with d^2/2 the promise of Newton's step (Nesterov 2004,
    Introductory Lectures on Convex Optimization, Thm. 4.1.11): less than three times the promise up to d = 0.83.
    """
    promised = _promise(here, _step(here, *bounds, free, MAX_RADIUS))
    return promised < max(COARSE, (hope - here.value) / HOPE)


def _bound_for(here: Point, top: Point, bounds: tuple[FloatArray, FloatArray], free: NDArray[np.bool_]) -> bool:
    """Whether a full step from here ends at a known maximum, by place and by value."""
    if here.value < top.value - NEAR:
        return False
    step = _step(here, *bounds, free, TEST_RADIUS)
    away = here.x + step - top.x
    apart = -0.5 * float(away @ top.hessian @ away)
    # In units or in nats: around a flat maximum, places far apart may have the same value.
    near = bool(np.abs(away).max() < PLACE) or 0 <= apart < ALIKE
    return near and abs(here.value + _promise(here, step) - top.value) < SAME


def _step(here: Point, lower: FloatArray, upper: FloatArray, free: NDArray[np.bool_], radius: float) -> FloatArray:
    """A step that raises the quadratic model within region and bounds.

    It goes towards the model's best place in the region and stops at the first bound. There it turns to the best place
    along the bound, and so on. The best of the visited places is taken, so a bound never prevents an ascent.
    """
    outward = ((here.x <= lower) & (here.gradient < 0)) | ((here.x >= upper) & (here.gradient > 0))
    moving = free & ~outward
    low, high = lower - here.x, upper - here.x
    step = best = np.zeros_like(here.x)
    while moving.any():
        gradient = here.gradient[moving] + here.hessian[np.ix_(moving, ~moving)] @ step[~moving]
        left = np.sqrt(max(radius**2 - float(step[~moving] @ step[~moving]), 0.0))
        along = np.zeros_like(step)
        along[moving] = _region_step(gradient, here.hessian[np.ix_(moving, moving)], left) - step[moving]
        room = np.full_like(step, np.inf)
        room[along > 0] = (high - step)[along > 0] / along[along > 0]
        room[along < 0] = (low - step)[along < 0] / along[along < 0]
        met = room <= min(float(room.min()), 1.0)
        step = np.where(met, np.where(along > 0, high, low), step + min(float(room.min()), 1.0) * along)
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
        with np.errstate(over="ignore"):  # a flat direction asks for an endless step, which the radius limits
            step = -slope / curvature
            length = float(step @ step)
        if length <= radius**2:
            full: FloatArray = basis @ step
            return full
    # |p(shift)| falls from infinity to 0 as the shift grows above the largest curvature; 1/|p| is nearly linear in it.
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
        if length > 0:  # the slope is zero at a saddle
            shift += (length / radius - 1) * length**2 / float(step @ (step / (shift - curvature)))
        if not low < shift < high:
            shift = floor + np.sqrt((low - floor) * (high - floor)) if low > floor else 0.5 * (low + high)
    step = slope / (high - curvature)
    rest = radius**2 - float(step @ step)
    if steepest >= 0 and rest > 0 and abs(slope[-1]) < 1e-12:
        step[-1] = np.sqrt(rest)  # the hard case: a saddle is left along its steepest direction
    edge: FloatArray = basis @ step
    return edge
