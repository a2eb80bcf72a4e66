"""Profile likelihood: one parameter is held at values around its estimate, and the others are fitted again."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import inf, isfinite, sqrt
from statistics import NormalDist

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.errors import RewardError, unknown
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.irl.status import Status

#: Largest number of steps to either side, and how far beyond the interval's end the profile is continued.
MAX_STEPS, BEYOND = 60, 1.6
#: A likelihood this many nats above the fit is not due to rounding.
BETTER = 1e-3
#: Tolerance of the fall at the interval's ends, as a share of it, and the largest number of trials.
END_TOLERANCE, END_TRIES = 1e-3, 60


@dataclass(frozen=True, eq=False)
class Profile(ByContent):
    """Profile likelihood of one parameter (Venzon and Moolgavkar 1988, Applied Statistics 37:87)."""

    name: str
    #: (m,) values of the parameter, ascending, the estimate among them, and (m,) the best log-likelihood (with prior
    #: and regulariser, if any) at each, relative to that of the fit.
    values: FloatArray
    relative: FloatArray
    #: (m, k) all parameters at each.
    theta: FloatArray
    level: float
    #: Ends of the interval; None where the likelihood does not fall far enough on that side, for instance up to a
    #: bound.
    lower: float | None
    upper: float | None

    @property
    def threshold(self) -> float:
        """Relative log-likelihood at the ends of the interval."""
        return -fall_at(self.level)


def fall_at(level: float) -> float:
    """Fall of the log-likelihood at the ends of an interval: half the chi-square quantile (Wilks 1938)."""
    return NormalDist().inv_cdf(0.5 + level / 2) ** 2 / 2


def profile(
    evidence: Evidence,
    found: Fit,
    name: str,
    level: float = 0.95,
    progress: Callable[[int, str], None] | None = None,
) -> Profile:
    """Follow the best likelihood to both sides of the estimate.

    Args:
        evidence: The demonstrated steps of the fit.
        found: The fit.
        name: The parameter.
        level: Confidence level of the interval.
        progress: Called with the number of values done.

    Returns:
        The profile.

    Raises:
        RewardError: The reward has no such parameter, the demonstrations do not identify it, or the profile found a
            better fit.
    """
    j = number_of(found.reward, name)
    if found.status in {Status.STOPPED_EARLY, Status.INFINITE}:
        raise RewardError(
            f"`profile` {name}: the fit did not reach its maximum ({found.status.value}), so there is no reference"
        )
    if not found.identified[j]:
        raise RewardError(f"`profile` {name}: the demonstrations do not identify this parameter; add some that do")
    walker = _Walker(evidence, found, j, progress)
    ends = [walker.end(side, fall_at(level)) for side in (-1, 1)]
    values = np.array(sorted(value for value, (relative, _) in walker.seen.items() if isfinite(relative)))
    theta = np.array([walker.seen[value][1].theta for value in values.tolist()])
    relative = np.array([walker.seen[value][0] for value in values.tolist()])
    return Profile(name, values, relative, theta, level, *ends)


def number_of(reward: Reward, name: str) -> int:
    """The number of a parameter by its name.

    Raises:
        RewardError: The reward has no such parameter.
    """
    names = [parameter.name for parameter in reward.parameters]
    if name not in names:
        raise RewardError(unknown("`profile`", name, names))
    return names.index(name)


class _Walker:
    """Values of the parameter, with the best relative log-likelihood and the reward at each."""

    def __init__(
        self, evidence: Evidence, found: Fit, number: int, progress: Callable[[int, str], None] | None
    ) -> None:
        self.evidence, self.found, self.number, self.progress = evidence, found, number, progress
        self.parameter = found.reward.parameters[number]
        self.seen: dict[float, tuple[float, Reward]] = {found.reward.theta[number]: (0.0, found.reward)}
        error = float(found.standard_errors[number])
        self.step = 0.4 * error if isfinite(error) else 0.1 * self.parameter.scale

    def at(self, value: float, guess: Reward) -> float:
        """The best relative log-likelihood at a value of the parameter, from a guess of the others and from restarts.

        The restarts are needed because the best values of the others may jump to another branch. -inf without a policy.
        """
        if value in self.seen:
            return self.seen[value][0]
        begin = Reward((*guess.theta[: self.number], value, *guess.theta[self.number + 1 :]), guess.terms)
        relative, reward = -inf, begin
        with suppress(InfinitePartitionError):
            held = fit(self.evidence, begin, self.found.l2, prior=self.found.prior, fixed=(self.parameter.name,))
            relative, reward = held.objective - self.found.objective, held.reward
        if relative > BETTER:
            values = ",".join(f"{p.name}={x:.6g}" for p, x in zip(reward.parameters, reward.theta, strict=True))
            raise RewardError(
                f"`profile` {self.parameter.name}: the profile found a better fit; fit again with `init` {values}"
            )
        self.seen[value] = relative, reward
        if self.progress is not None:
            self.progress(len(self.seen), f"{self.parameter.name} {value:.3g}")
        return relative

    def end(self, side: int, fall: float) -> float | None:
        """Walk to one side until the likelihood has fallen beyond the interval's end, and find that end."""
        here, guess = self.found.reward.theta[self.number], self.found.reward
        step, crossed = self.step, None
        for _ in range(MAX_STEPS):
            there = min(max(here + side * step, self.parameter.lower), self.parameter.upper)
            if there == here:
                break
            before, relative = self.seen[here][0], self.at(there, guess)
            if relative >= -fall:
                crossed = None  # the likelihood may rise again on another branch of the others
            elif crossed is None:
                crossed = here, there
            if relative < -BEYOND * fall or there in {self.parameter.lower, self.parameter.upper}:
                break
            # Strides grow where the profile is flat and shrink where it is steep.
            step *= 1.5 if before - relative < 0.15 * fall else 0.7 if before - relative > 0.5 * fall else 1.0
            here, guess = there, self.seen[there][1]
        return None if crossed is None else self._crossing(*crossed, fall)

    def _crossing(self, inside: float, outside: float, fall: float) -> float:
        """The value at which the likelihood has fallen by a given amount, between two values on either side of it."""
        middle = inside
        for number in range(END_TRIES):
            # The root of the fall is nearly linear in the parameter, but not near a jump: every third trial bisects.
            low, high = (sqrt(max(-self.seen[value][0], 0.0)) for value in (inside, outside))
            share = 0.5 if number % 3 == 2 or not isfinite(high) else (sqrt(fall) - low) / (high - low)
            middle = inside + (outside - inside) * share
            if middle in {inside, outside}:
                break
            relative = self.at(middle, self.seen[inside][1])
            if abs(-relative - fall) < END_TOLERANCE * fall:
                break
            inside, outside = (middle, outside) if -relative < fall else (inside, middle)
        return middle
