"""Coordinates in which ridges are straight: against their inverse and difference quotients."""

import factories as make
import numpy as np
import pytest

from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.objective import Objective
from navirl_cli.irl.reward import PAPER_TERMS, Reward
from navirl_cli.irl.stretched import Stretched
from navirl_cli.irl.terms import TERMS

SCENE = make.scene_on(make.open_grid(9, 6), [0, 2], [8, 3], [[0.5, 0.3]])
TURNING = (*PAPER_TERMS, TERMS["turn"])
#: Near zero and far from it, in units of the scales.
PLACES = ((-4.0, -0.5, -2.0, 3.0, -1.0), (-3.0, 0.0, -400.0, 0.004, 25.0), (-8.0, -30.0, 0.0, 0.4, 0.1))


@pytest.fixture(scope="module")
def stretched():
    reward = Reward((-30.0, -1.0, -2.0, 2.0, -0.5), TURNING)
    return Stretched.of(Objective.of(evidence_of(make.drawn(SCENE, reward, 3, seed=2)), reward, 0.0, None))


@pytest.mark.parametrize("x", PLACES)
def test_there_and_back(stretched, x):
    assert stretched.plain(stretched.stretched(np.array(x))) == pytest.approx(x, rel=1e-12)


def test_a_bound_is_met_exactly_and_never_passed(stretched):
    for bound, side in zip(stretched.bounds, (-1, 1), strict=True):
        plain = stretched.objective.bounds[max(side, 0)]
        assert (stretched.plain(bound) == plain).all()
        finite = np.isfinite(bound)
        assert (stretched.plain(np.where(finite, bound + side, 0.0)) == plain)[finite].all()


@pytest.mark.parametrize("x", PLACES)
def test_derivatives_against_difference_quotients(stretched, x):
    u = stretched.stretched(np.array(x))
    here = stretched(u)
    for j in range(len(u)):
        step = np.where(np.arange(len(u)) == j, 1e-5, 0.0)
        above, below = stretched(u + step), stretched(u - step)
        if not (stretched.bounds[0] < u - step).all() or not (u + step < stretched.bounds[1]).all():
            continue
        assert here.gradient[j] == pytest.approx((above.value - below.value) / 2e-5, rel=1e-5, abs=1e-6)
        quotient = (above.gradient - below.gradient) / 2e-5
        assert here.hessian[j] == pytest.approx(quotient, rel=1e-4, abs=1e-5 * np.abs(here.hessian).max())


@pytest.mark.parametrize("x", PLACES)
def test_a_place_by_its_coordinates_is_the_same_place(stretched, x):
    plain = stretched.objective(np.array(x))
    again = stretched.place(stretched.point(plain))
    assert (again.value, again.x, again.gradient) == (
        plain.value,
        pytest.approx(plain.x, rel=1e-12),
        pytest.approx(plain.gradient, rel=1e-9, abs=1e-12),
    )
    assert again.hessian == pytest.approx(plain.hessian, rel=1e-7, abs=1e-9)


def test_a_ridge_of_strength_and_decay_is_straight(stretched):
    """A person of any strength at the same distance: x = -exp(c + decay)."""
    decay = np.array([4.0, 8.0, 12.0])
    u = [stretched.stretched(np.array([-4.0, -1.0, -np.exp(1.0 + one), one, 0.0])).tolist() for one in decay.tolist()]
    first, second = (np.subtract(after, before) for before, after in ((u[0], u[1]), (u[1], u[2])))
    assert first[[2, 3]] == pytest.approx(second[[2, 3]], rel=1e-3)
