"""How sure a fit is of how to pass people, and what another pass would change."""

from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.evaluation.meaning import drawn_rewards
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.paths import Planner
from navirl_cli.planning.recommendation import LEVEL, Quantity, straight_passage

#: Rewards drawn from the estimate.
DRAWS: Final = 40


@dataclass(frozen=True)
class Certainty:
    """The distance at which paths of a policy pass a person on open ground, and how sure it is."""

    #: Between the robot's shell and the person's centre, m; NaN bounds where a parameter has no standard error.
    passing_m: Quantity
    #: Standard deviation of the change that another demonstration would make, m; NaN where unknown.
    another_m: float


def passing_m(reward: Reward, robot_radius_m: float, resolution_m: float) -> float:
    """Mean least distance to a person on the robot's straight line, shell to centre, m; NaN without a policy."""
    try:
        return Planner(straight_passage(robot_radius_m, resolution_m), reward).passing_m[0]
    except RewardError:
        return float("nan")


def certainty(fit: Fit, robot_radius_m: float, resolution_m: float, seed: int = 0) -> Certainty:
    """How sure a fit is of the distance at which to pass people.

    Rewards are drawn from the normal distribution of the estimate. Among them the distance is taken as linear in the
    parameters (least squares). Another demonstration is expected to bring as much information as those so far did on
    average.

    Args:
        fit: To demonstrations, with or without a prior.
        robot_radius_m: Radius of the robot, m.
        resolution_m: Side of the cells, m.
        seed: Of the draws.
    """
    value = passing_m(fit.reward, robot_radius_m, resolution_m)
    draws = drawn_rewards(fit.reward, fit.covariance, None, DRAWS, np.random.default_rng(seed))
    drawn = np.array([passing_m(one, robot_radius_m, resolution_m) for one in draws])
    known = np.isfinite(drawn)
    if not np.isfinite(value) or known.sum() < DRAWS / 2:
        return Certainty(Quantity(value), float("nan"))
    lower, upper = np.quantile(drawn[known], [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    theta = np.array([one.theta for one in draws])[known]
    slope = np.linalg.lstsq(np.column_stack([np.ones(len(theta)), theta - fit.reward.theta]), drawn[known])[0][1:]
    return Certainty(Quantity(value, float(lower), float(upper)), another_pass(fit, slope))


def another_pass(fit: Fit, slope: FloatArray) -> float:
    """Standard deviation of the change of a quantity through another demonstration.

    Args:
        fit: With a covariance of all parameters.
        slope: (k,) of the quantity, by parameter.
    """
    scale = fit.standard_errors
    precision = np.linalg.inv(fit.correlation)
    prior = 0.0 if fit.prior is None else fit.prior.precision * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(precision - prior)
    of_one = (vectors * np.maximum(values, 0.0)) @ vectors.T / fit.demonstrations
    after = np.linalg.inv(precision + of_one)
    along = slope * scale
    variance = float(along @ (fit.correlation - after) @ along)
    return sqrt(max(variance, 0.0))
