"""What a learnt reward means in metres: the reach of personal space, and the detours that the model accepts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import exp, inf, isfinite, isinf, log, nan, pi, sqrt

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.evaluation.groups import LEVEL
from navirl_cli.irl.intervals import Intervals
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.uncertainty import correlation

#: Draws of the parameters, for intervals.
DRAWS = 4000
#: Half the width of a 95 % interval of a normal estimate, in standard errors.
WIDTH = 1.959964
#: Additional distance that a detour gains, and a distance beside the nominal path, m.
MORE_M, BESIDE_M = 0.1, 0.5

Theta = Mapping[str, float]
#: Text, unit, the parameters that it needs, and its value.
Quantity = tuple[str, str, tuple[str, ...], Callable[[Theta], float]]


@dataclass(frozen=True)
class Meaning:
    """One quantity that follows from the parameters."""

    text: str
    unit: str
    value: float
    #: 95 % interval by that of the parameters; NaN where one of them has none, infinite where an end is open.
    lower: float
    upper: float


def half_distance_m(theta: Theta) -> float:
    """Distance to a person at which the personal-space reward is half of that at the person's centre, m."""
    return sqrt(log(2) / theta["sigma_p"])


def tenth_distance_m(theta: Theta) -> float:
    """The same for a tenth, m."""
    return sqrt(log(10) / theta["sigma_p"])


def passing_penalty(theta: Theta, distance_m: float, resolution_m: float) -> float:
    """Personal-space reward summed along a straight path past a person: a_p/h integral exp(-sigma_p (x^2 + d^2)) dx.

    Args:
        theta: Parameters by name.
        distance_m: Smallest distance d of the path from the person's centre, m.
        resolution_m: Length h of a step, m.
    """
    return theta["a_p"] / resolution_m * sqrt(pi / theta["sigma_p"]) * exp(-theta["sigma_p"] * distance_m**2)


def accepted_detour_m(theta: Theta, distance_m: float, resolution_m: float) -> float:
    """Detour that costs as much reward as passing a person 10 cm farther away saves, m.

    On open ground, without the cost of the distance from the nominal path; arguments as of :func:`passing_penalty`.
    """
    near, far = (passing_penalty(theta, d, resolution_m) for d in (distance_m, distance_m + MORE_M))
    return (far - near) / -theta["c0"]


def longer_path_odds(theta: Theta) -> float:
    """Probability of a path that is 10 cm longer, divided by that of the shorter path."""
    return exp(theta["c0"] * MORE_M)


def beside_detour_m(theta: Theta, resolution_m: float) -> float:
    """The detour that costs as much as a metre driven half a metre beside the nominal path, m."""
    return theta["a_g"] * BESIDE_M**2 / resolution_m / theta["c0"]


def meanings(
    reward: Reward,
    covariance: FloatArray,
    resolution_m: float,
    distance_m: float,
    rng: np.random.Generator,
    intervals: Intervals | None = None,
) -> list[Meaning]:
    """All quantities of a reward in metres.

    Args:
        reward: What was learnt; quantities of parameters that it does not have are left out.
        covariance: (k, k), NaN for parameters without a variance.
        resolution_m: Side of the cells that it was learnt on, m.
        distance_m: At which people were passed, centre to centre, m; NaN without people.
        rng: Source of randomness of the intervals.
        intervals: Of the parameters; by default from the covariance.
    """
    names = [parameter.name for parameter in reward.parameters]
    estimate = dict(zip(names, reward.theta, strict=True))
    ends = _ends(reward, covariance, intervals)
    draws, beyond = _draws(reward, covariance, ends, DRAWS, rng)
    found = []
    for text, unit, on, value in _quantities(resolution_m, distance_m):
        if not set(on) <= set(names):
            continue
        lower = upper = float("nan")
        if all(name in ends for name in on):
            drawn = np.array([value(dict(zip(names, row, strict=True))) for row in draws.tolist()])
            endless = np.asarray(beyond[:, [names.index(name) for name in on]].any(axis=1))
            lower, upper = _quantiles(drawn, endless, value(estimate))
        found.append(Meaning(text, unit, value(estimate), lower, upper))
    return found


def drawn_rewards(
    reward: Reward, covariance: FloatArray, intervals: Intervals | None, count: int, rng: np.random.Generator
) -> list[Reward]:
    """Rewards drawn from the distribution of an estimate, for intervals of whatever follows from a reward.

    Args:
        reward: The estimate.
        covariance: (k, k), NaN for parameters without a variance.
        intervals: Of the parameters; by default from the covariance.
        count: Number of draws.
        rng: Source of randomness.

    Returns:
        The draws; none where they say nothing, because a parameter has no interval or an open one.
    """
    ends = _ends(reward, covariance, intervals)
    if not all(parameter.name in ends and np.isfinite(ends[parameter.name]).all() for parameter in reward.parameters):
        return []
    draws, _ = _draws(reward, covariance, ends, count, rng)
    return [replace(reward, theta=tuple(row)) for row in draws.tolist()]


def _quantiles(drawn: FloatArray, endless: BoolArray, estimate: float) -> tuple[float, float]:
    """The interval of a quantity from its draws, of which some belong to open ends of a parameter."""
    lower, upper = (float(edge) for edge in np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2]))
    above, below = (float((endless & mask).mean()) > (1 - LEVEL) / 2 for mask in (drawn > estimate, drawn < estimate))
    return -inf if below else lower, inf if above else upper


def _quantities(resolution_m: float, distance_m: float) -> list[Quantity]:
    """All quantities; arguments as of :func:`meanings`."""
    wanted: list[Quantity] = [
        (
            "The personal-space reward falls to one half at a distance between centres of",
            "m",
            ("sigma_p",),
            half_distance_m,
        ),
        ("It falls to one tenth at", "m", ("sigma_p",), tenth_distance_m),
        (
            f"The probability of a path that is {MORE_M:g} m longer, divided by that of the shorter path, is",
            "",
            ("c0",),
            longer_path_odds,
        ),
        (
            f"Driving 1 m at {BESIDE_M:g} m beside the nominal path costs as much as a detour of",
            "m",
            ("c0", "a_g"),
            partial(beside_detour_m, resolution_m=resolution_m),
        ),
    ]
    if np.isfinite(distance_m):
        passed = (
            f"To pass a person at {distance_m + MORE_M:.2f} m instead of {distance_m:.2f} m (the mean distance between "
            "centres at which the robot passed), the model accepts a detour of"
        )
        detour = partial(accepted_detour_m, distance_m=distance_m, resolution_m=resolution_m)
        wanted.append((passed, "m", ("c0", "a_p", "sigma_p"), detour))
    return wanted


def _ends(reward: Reward, covariance: FloatArray, intervals: Intervals | None) -> dict[str, tuple[float, float]]:
    """Ends of the parameters' intervals by name, infinite where they are open.

    Without intervals they follow from the standard errors, on a logarithm where a parameter cannot change its sign.
    """
    if intervals is not None:
        return {
            one.parameter: (-inf if one.lower is None else one.lower, inf if one.upper is None else one.upper)
            for one in intervals.ends
        }
    found = {}
    for j, (parameter, value) in enumerate(zip(reward.parameters, reward.theta, strict=True)):
        error = WIDTH * sqrt(covariance[j, j]) if covariance[j, j] >= 0 else nan
        if isfinite(error):
            low, high = value - error, value + error
            if parameter.lower >= 0 or parameter.upper <= 0:
                low, high = sorted((value * exp(-error / abs(value)), value * exp(error / abs(value))))
            found[parameter.name] = (low, high)
    return found


def _draws(
    reward: Reward,
    covariance: FloatArray,
    ends: Mapping[str, tuple[float, float]],
    count: int,
    rng: np.random.Generator,
) -> tuple[FloatArray, BoolArray]:
    """(count, k) parameters whose 95 % intervals are those given, with the correlations of the estimate.

    Each side of a parameter is half a normal distribution; the decay and what cannot change its sign have it on a
    logarithm. (count, k) whether a draw lies towards an open end; it has the value of the parameter's bound.
    """
    theta, beyond = np.tile(reward.theta, (count, 1)), np.zeros((count, len(reward.theta)), dtype=bool)
    matrix = np.nan_to_num(correlation(covariance))
    np.fill_diagonal(matrix, 1.0)
    normal = rng.multivariate_normal(np.zeros(len(theta[0])), matrix, count, method="eigh") / WIDTH
    for j, parameter in enumerate(reward.parameters):
        if parameter.name not in ends:
            continue
        low, high = ends[parameter.name]
        # No effect at all is an end that can be computed with.
        low, high = (
            0.0 if isinf(end) and bound == 0 else end
            for end, bound in ((low, parameter.lower), (high, parameter.upper))
        )
        for mask, end, bound in ((normal[:, j] < 0, low, parameter.lower), (normal[:, j] >= 0, high, parameter.upper)):
            if isinf(end):
                theta[mask, j], beyond[mask, j] = bound, True
            else:
                theta[mask, j] = _towards(reward.theta[j], end, np.abs(normal[mask, j]))
        theta[:, j] = np.clip(theta[:, j], parameter.lower, parameter.upper)
    return theta, beyond


def _towards(value: float, end: float, share: FloatArray) -> FloatArray:
    """A value moved by shares of the distance to an end, by ratios where both have one sign."""
    if value * end > 0:
        return np.asarray(value * (end / value) ** share)
    return np.asarray(value + (end - value) * share)
