"""Filters and a smoothing spline for signals of a few columns.

These pages of numpy stand in place of scipy.signal and scipy.interpolate, whose import takes longer than extracting a
small log; tests/test_smoothing.py holds them to scipy.
"""

from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray

#: Samples by which a signal is continued beyond both ends, so that a filter has settled where the signal begins.
_PADDING: Final = 9
#: A filter's memory ends where its coefficients are smaller than this.
_NEGLIGIBLE: Final = 1e-20


def low_passed(values: FloatArray, rate_hz: float, cutoff_hz: float) -> FloatArray:
    """A Butterworth filter of second order, run forward and backward, so that it delays nothing.

    The analogue filter is made digital by the bilinear transform with the cutoff frequency kept. Beyond its ends the
    signal goes on turned about its end points, and before that as a constant.

    Args:
        values: (n, k) samples, n > 9.
        rate_hz: Samples a second.
        cutoff_hz: Frequency that one run halves in power, Hz; from half the rate on there is nothing to remove.
    """
    if cutoff_hz >= rate_hz / 2:
        return values
    tangent = np.tan(np.pi * cutoff_hz / rate_hz)
    gain = 1 / (1 + np.sqrt(2) * tangent + tangent**2)
    a1, a2 = 2 * (tangent**2 - 1) * gain, (1 - np.sqrt(2) * tangent + tangent**2) * gain
    before = 2 * values[0] - values[_PADDING:0:-1]
    after = 2 * values[-1] - values[-2 : -_PADDING - 2 : -1]
    smooth = np.concatenate([before, values, after])
    for _ in range(2):
        # relative to the first sample, as if the signal had always been that
        change = smooth - smooth[0]
        driven = change.copy()
        driven[1:] += 2 * change[:-1]
        driven[2:] += change[:-2]
        smooth = (_recursive(tangent**2 * gain * driven, a1, a2) + smooth[0])[::-1]
    return smooth[_PADDING:-_PADDING]


def lagged(values: FloatArray, keep: float) -> FloatArray:
    """What a first-order lag makes of (n,) values: of each result the next keeps a share, and starts at 0."""
    return _recursive((1 - keep) * values, -keep, 0.0)


def _recursive(values: FloatArray, a1: float, a2: float) -> FloatArray:
    """The recursion y[n] = x[n] - a1 y[n - 1] - a2 y[n - 2] along the first axis, for a stable filter at rest.

    With D(z) = 1 + a1 z + a2 z^2, 1 / D(z) = D(-z) / (D(z) D(-z)), and the denominator is such a polynomial in z^2
    (Graeffe's iteration). So each pass doubles the reach of the recursion, until its coefficients have vanished.
    """
    step = 1
    while step < len(values) and max(abs(a1), abs(a2)) > _NEGLIGIBLE:
        reached = values.copy()
        reached[step:] -= a1 * values[:-step]
        reached[2 * step :] += a2 * values[: -2 * step]
        values, step = reached, 2 * step
        a1, a2 = 2 * a2 - a1**2, a2**2
    return values


def smoothing_spline(at: FloatArray, values: FloatArray, penalty: float) -> FloatArray:
    """The values at the data of a natural cubic spline that smooths them.

    The spline minimises the sum of squared residuals plus the penalty times the integral of its squared second
    derivative (C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967), 177-183).

    Args:
        at: (n,) increasing, n > 2.
        values: (n, k) data.
        penalty: In the cube of the unit of `at`.

    Returns:
        (n, k).
    """
    width = np.diff(at)
    slope = 1 / width
    middle = -(slope[:-1] + slope[1:])
    # (R + penalty Q^T Q) c = Q^T y for the second derivatives c, and y - penalty Q c for the values
    diagonal = (width[:-1] + width[1:]) / 3 + penalty * (slope[:-1] ** 2 + middle**2 + slope[1:] ** 2)
    beside = width[1:-1] / 6 + penalty * slope[1:-1] * (middle[:-1] + middle[1:])
    beyond = penalty * slope[1:-2] * slope[2:-1]
    bend = _solved(diagonal, beside, beyond, np.diff(np.diff(values, axis=0) * slope[:, None], axis=0))
    ends = np.zeros((1, values.shape[1]))
    jumps = np.diff(np.concatenate([ends, bend, ends]), axis=0) * slope[:, None]
    return values - penalty * np.diff(np.concatenate([ends, jumps, ends]), axis=0)


def _solved(diagonal: FloatArray, beside: FloatArray, beyond: FloatArray, right: FloatArray) -> FloatArray:
    """The solution of a symmetric positive definite system with five diagonals, by its factors L D L^T.

    Args:
        diagonal: (n,).
        beside: (n - 1,) the diagonal next to it.
        beyond: (n - 2,) the next one.
        right: (n, k) right-hand sides.
    """
    pivots: list[float] = []
    first: list[float] = []
    second: list[float] = []
    solved = right.copy()
    for i, (here, one, two) in enumerate(
        zip(diagonal.tolist(), [*beside.tolist(), 0.0], [*beyond.tolist(), 0.0, 0.0], strict=False)
    ):
        pivot, upper = here, one
        if i > 0:
            pivot -= first[-1] ** 2 * pivots[-1]
            upper -= first[-1] * pivots[-1] * second[-1]
            solved[i] -= first[-1] * solved[i - 1]
        if i > 1:
            pivot -= second[-2] ** 2 * pivots[-2]
            solved[i] -= second[-2] * solved[i - 2]
        pivots.append(pivot)
        first.append(upper / pivot)
        second.append(two / pivot)
    solved /= np.array(pivots)[:, None]
    for i in range(len(solved) - 2, -1, -1):
        solved[i] -= first[i] * solved[i + 1]
        if i + 2 < len(solved):
            solved[i] -= second[i] * solved[i + 2]
    return solved
