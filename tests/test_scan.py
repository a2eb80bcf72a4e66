"""The scan: a closed form with several peaks, and data on which a climb from the start alone ends too low."""

import factories as make
import numpy as np
import pytest

from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.newton import Point, maximise
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scan import Scan
from navirl_cli.irl.terms.term import geometric

BOUNDS = np.array([-50.0, 1e-3]), np.array([50.0, 1e3])
VALUES = geometric(1e-3, 1e3, 15)
FREE = np.array([True, True])
#: Of every peak of the profile: place, height, width, the last two by the logarithm.
PEAKS = ((2.0, 1.0, 0.8), (0.01, 1.5, 1.0))


def hills(x, peaks=PEAKS, far=1.0):
    """-far (x_0 - u)^2 + hills over u = log x_1: concave in x_0, with the hills as its profile."""
    u = np.log(x[1])
    value = first = second = 0.0
    for place, height, width in peaks:
        t = (u - np.log(place)) / width
        one = height * np.exp(-(t**2) / 2)
        value, first, second = value + one, first - one * t / width, second + one * (t**2 - 1) / width**2
    d = x[0] - u
    by_u, bend = 2 * far * d + first, -2 * far + second
    gradient = np.array([-2 * far * d, by_u / x[1]])
    hessian = np.array([[-2 * far, 2 * far / x[1]], [2 * far / x[1], (bend - by_u) / x[1] ** 2]])
    return Point(np.asarray(x), value - far * d**2, gradient, hessian)


@pytest.mark.parametrize("far", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("second", [1e-3, 0.004, 0.03, 40.0, 300.0, 1e3])
def test_the_highest_of_several_hills_is_found(second, far):
    peaks = ((2.0, 1.0, 0.8), (second, 1.2, 0.8))
    calls = []

    def objective(x):
        calls.append(x)
        return hills(x, peaks, far)

    near = maximise(objective, objective(np.array([0.0, 2.5])), BOUNDS, FREE)
    assert near.best.x[1] == pytest.approx(2.0, rel=0.1), "the climb alone ends on the near hill"
    scan = Scan(objective, BOUNDS, FREE, None, [near])
    scan.over([(1, VALUES)])
    assert scan.top.x[1] == pytest.approx(second, rel=0.1)
    assert scan.top.value >= 1.2 - 1e-9
    assert len(calls) < 200


def test_a_scan_of_one_hill_finds_nothing_else():
    peaks = ((2.0, 40.0, 1.5),)
    near = maximise(lambda x: hills(x, peaks), hills(np.array([0.5, 2.5]), peaks), BOUNDS, FREE)
    scan = Scan(lambda x: hills(x, peaks), BOUNDS, FREE, None, [near])
    scan.over([(1, VALUES)])
    assert scan.top is near.best
    assert len(scan.found) == 1


def test_variables_that_are_not_free_do_not_move():
    near = maximise(hills, hills(np.array([3.0, 2.5])), BOUNDS, np.array([False, True]))
    scan = Scan(hills, BOUNDS, np.array([False, True]), None, [near])
    scan.over([(1, VALUES)])
    assert all(one.best.x[0] == 3.0 for one in scan.found)


@pytest.fixture(scope="module")
def wide():
    """Three paths: a climb from the start ends on the bound of the decay, 0.14 nats short of the best."""
    rng = np.random.default_rng((1400, 2))
    scene = make.random_scene(rng, 24, 14, 0.1, 2)
    return evidence_of(make.drawn(scene, Reward((-42.0, -0.3, -12.0, 0.02)), 3, seed=7))


def slow_best(evidence, l2):
    """The best of climbs from a fine grid of decays, with every other parameter free."""
    starts = [Reward((-50.0, -0.1, a_p, sigma)) for sigma in geometric(1e-3, 100.0, 11) for a_p in (-5.0, 1.0)]
    return max(fit(evidence, start, l2, scan=False).objective for start in starts)


@pytest.mark.parametrize("l2", [0.0, 1e-3])
def test_no_climb_from_a_fine_grid_ends_higher(wide, l2):
    found = fit(wide, Reward.named({}), l2)
    assert found.objective >= slow_best(wide, l2) - 1e-4
    assert found.objective == pytest.approx(
        log_likelihood(wide, found.reward) - l2 / 2 * sum((np.array(found.reward.theta) / [10, 1, 1, 1]) ** 2)
    )


def test_a_climb_alone_misses_what_the_scan_finds(wide):
    alone, found = (fit(wide, Reward.named({}), scan=scan) for scan in (False, True))
    assert alone.reward.theta[3] == 1e-3
    assert found.objective > alone.objective + 0.1
