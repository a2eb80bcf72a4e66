"""What a learnt reward means in metres: the reach of personal space, and the detours that the model accepts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import exp, log, pi, sqrt

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.groups import LEVEL
from navirl_cli.irl.reward import Reward

#: Draws from the estimate's normal distribution, for intervals.
DRAWS = 4000
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
    #: 95 % interval from the covariance; NaN where a parameter that it needs has no variance.
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
    reward: Reward, covariance: FloatArray, resolution_m: float, distance_m: float, rng: np.random.Generator
) -> list[Meaning]:
    """All quantities of a reward in metres.

    Args:
        reward: What was learnt; quantities of parameters that it does not have are left out.
        covariance: (k, k), NaN for parameters without a variance.
        resolution_m: Side of the cells that it was learnt on, m.
        distance_m: At which people were passed, centre to centre, m; NaN without people.
        rng: Source of randomness of the intervals.
    """
    names = [parameter.name for parameter in reward.parameters]
    estimate = dict(zip(names, reward.theta, strict=True))
    known = np.isfinite(np.diag(covariance))
    draws = _draws(reward, covariance, known, rng)
    found = []
    for text, unit, on, value in _quantities(resolution_m, distance_m):
        lower = upper = float("nan")
        if not set(on) <= set(names):
            continue
        if all(known[names.index(name)] for name in on):
            drawn = [value(dict(zip(names, row, strict=True))) for row in draws]
            lower, upper = (float(edge) for edge in np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2]))
        found.append(Meaning(text, unit, value(estimate), lower, upper))
    return found


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


def _draws(reward: Reward, covariance: FloatArray, known: np.ndarray, rng: np.random.Generator) -> list[list[float]]:
    """(DRAWS, k) parameters around the estimate, within their bounds."""
    theta = np.tile(reward.theta, (DRAWS, 1))
    if known.any():
        block = covariance[np.ix_(known, known)]
        theta[:, known] = rng.multivariate_normal(theta[0, known], block, DRAWS, method="eigh")
    # A decay of zero and a path without cost would divide by zero.
    least = {"sigma_p": 1e-3}
    most = {"c0": -1e-3}
    for j, parameter in enumerate(reward.parameters):
        low, high = (
            max(parameter.lower, least.get(parameter.name, -np.inf)),
            min(parameter.upper, most.get(parameter.name, np.inf)),
        )
        theta[:, j] = np.clip(theta[:, j], low, high)
    rows: list[list[float]] = theta.tolist()
    return rows
