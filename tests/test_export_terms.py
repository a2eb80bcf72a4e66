"""Rewards of other terms as costs of planners: those that costs can hold, and the refusal of all others."""

import numpy as np
import pytest

from navirl_cli.errors import RewardError
from navirl_cli.export.costs import CostModel, navfn
from navirl_cli.irl.reward import Reward, parameters_of
from navirl_cli.irl.terms import TERMS


def terms(*names):
    return tuple(TERMS[name] for name in names)


def test_a_space_per_metre_costs_as_one_per_step_of_its_share():
    step = CostModel(Reward((-50.0, -1.0, -4.0, 2.0)), navfn(), 0.1)
    metre = CostModel(Reward((-50.0, -1.0, -40.0, 2.0), terms("length", "deviation", "length-space")), navfn(), 0.1)
    away = np.array([[0.3], [1.2]])
    assert metre.near_people(away) == pytest.approx(step.near_people(away))
    assert (metre.amplitude, metre.covariance_m2) == pytest.approx((step.amplitude, step.covariance_m2))


@pytest.mark.parametrize(
    "names",
    [
        ("length", "deviation"),
        ("length", "saturating-deviation", "personal-space"),
        ("length", "personal-space", "turn"),
        ("length", "anisotropic-space"),
    ],
)
def test_rewards_that_costs_cannot_hold_are_refused(names):
    reward = Reward(tuple(one.initial for one in parameters_of(terms(*names))), terms(*names))
    with pytest.raises(RewardError, match=f"which are what a planner's costs can hold, found {', '.join(names)}; fit"):
        CostModel(reward, navfn(), 0.1)
