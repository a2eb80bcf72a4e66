"""Filters and splines of numpy against those of scipy."""

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline
from scipy.signal import butter, lfilter, sosfiltfilt

from navirl_cli.demos.smoothing import lagged, low_passed, smoothing_spline


def walk(n, columns=2, seed=0):
    """Noise on a random walk far from 0."""
    rng = np.random.default_rng(seed)
    return 3.0 + 0.1 * np.cumsum(rng.normal(size=(n, columns)), axis=0) + rng.normal(size=(n, columns))


def largest(values):
    return float(np.abs(values).max())


@pytest.mark.parametrize("n", [10, 50, 999, 12_000])
@pytest.mark.parametrize(
    ("rate_hz", "cutoff_hz"), [(100.0, 5.0), (100.0, 30.0), (100.0, 49.0), (50.0, 5.0), (1000.0, 5.0)]
)
def test_the_low_pass_is_scipys(n, rate_hz, cutoff_hz):
    values = walk(n)
    expected = sosfiltfilt(butter(2, cutoff_hz, fs=rate_hz, output="sos"), values, axis=0)
    assert largest(low_passed(values, rate_hz, cutoff_hz) - expected) < 1e-12 * largest(values)


def test_a_low_pass_over_minutes_is_as_exact_as_long_doubles():
    # Here scipy's own result is wrong by 4e-8.
    values = walk(3000)
    assert largest(low_passed(values, 1000.0, 0.01) - in_long_doubles(values, 1000, "0.01")) < 1e-11 * largest(values)


def in_long_doubles(values, rate_hz, cutoff_hz):
    """The same filter sample by sample."""
    number = np.longdouble
    tangent = np.tan(4 * np.arctan(number(1)) * number(cutoff_hz) / rate_hz)
    gain = 1 / (1 + np.sqrt(number(2)) * tangent + tangent**2)
    a1, a2 = 2 * (tangent**2 - 1) * gain, (1 - np.sqrt(number(2)) * tangent + tangent**2) * gain
    smooth = np.concatenate([2 * values[0] - values[9:0:-1], values, 2 * values[-1] - values[-2:-11:-1]])
    smooth = smooth.astype(number)
    for _ in range(2):
        x = np.concatenate([np.zeros((2, values.shape[1])), smooth - smooth[0]])
        y = np.zeros_like(x)
        for n in range(2, len(x)):
            y[n] = tangent**2 * gain * (x[n] + 2 * x[n - 1] + x[n - 2]) - a1 * y[n - 1] - a2 * y[n - 2]
        smooth = (y[2:] + smooth[0])[::-1]
    return smooth[9:-9].astype(float)


def test_what_lies_below_half_the_rate_is_all_that_there_is():
    values = walk(60)
    assert low_passed(values, 10.0, 5.0) is values


def test_a_constant_and_a_line_pass_the_low_pass():
    line = np.outer(np.arange(200.0), [1.0, -0.5]) + 7.0
    assert low_passed(line, 100.0, 5.0)[80:-80] == pytest.approx(line[80:-80], abs=1e-6)
    assert low_passed(np.full((50, 1), 7.0), 100.0, 5.0) == pytest.approx(7.0, abs=1e-13)


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9, 0.98])
@pytest.mark.parametrize("n", [1, 2, 3, 5000])
def test_the_lag_is_scipys(keep, n):
    values = walk(n, columns=1)[:, 0]
    assert lagged(values, keep) == pytest.approx(lfilter([1 - keep], [1, -keep], values), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("n", [5, 6, 30, 400])
@pytest.mark.parametrize("penalty", [1e-3, 1.0, 5000.0])
def test_the_spline_is_scipys(n, penalty):
    at = np.cumsum(np.random.default_rng(n).uniform(0.5, 3.5, n))
    values = walk(n, columns=3)
    expected = np.stack([make_smoothing_spline(at, column, lam=penalty)(at) for column in values.T], axis=1)
    # scipy's own result is wrong by 5e-12, against long doubles
    assert smoothing_spline(at, values, penalty) == pytest.approx(expected, rel=1e-11, abs=1e-10)


def test_a_spline_leaves_a_line_as_it_is():
    at = np.array([0.0, 1.0, 3.0, 3.5, 8.0])
    line = np.outer(at, [2.0, -1.0]) + 5.0
    assert smoothing_spline(at, line, 5000.0) == pytest.approx(line, rel=1e-13)


def test_a_spline_through_three_points_by_hand():
    # R = 2/3, Q = (1, -2, 1), Q^T y = -2: the second derivative is -2 / (2/3 + 6) = -0.3
    found = smoothing_spline(np.arange(3.0), np.array([[0.0], [1.0], [0.0]]), 1.0)
    assert found[:, 0] == pytest.approx([0.3, 0.4, 0.3], rel=1e-14)
