"""The bias of maximum likelihood with few demonstrations, to first order in 1 / number of demonstrations.

D. R. Cox, E. J. Snell, A general definition of residuals, Journal of the Royal Statistical Society B 30 (1968), Sec. 3,
as G. M. Cordeiro and R. Klein write it (Statistics and Probability Letters 19, 1994):

    bias_s = 1/2 sum_ijk I^si I^jk (kappa_ij,k - dI_ij/dtheta_k),

with I the expected information, I^ij its inverse, and kappa_ij,k the mean of the product of the second derivative (ij)
and the first (k) of the log-likelihood. A path's log-likelihood is its reward minus a function of the parameters.
Therefore kappa_ij,k is the covariance of d2r/dij and dr/dk summed along paths. It has the form of I and is computed as
exactly.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit
from navirl_cli.irl.likelihood import log_likelihood, path_covariance
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status

#: Step of the difference quotients of I, in standard errors.
STEP = 0.02
TOO_FEW = "too few demonstrations: a first-order correction is not valid"


def first_order_bias(evidence: Evidence, reward: Reward, identified: NDArray[np.bool_]) -> FloatArray:
    """Expected difference between a fit and the true reward, if this were the true reward.

    Args:
        evidence: Whole paths of demonstrations. Only their number and their starts matter.
        reward: The reward; k parameters.
        identified: (k,) parameters that are fitted; the others are constant.

    Returns:
        (k,) bias in the parameters' units, 0 for constant parameters. A fit can be corrected by it where it is a
        fraction of a standard error. Where it exceeds one, the demonstrations are too few.

    Raises:
        InfinitePartitionError: The partition function is infinite at the reward or close to it.
    """
    k = len(reward.theta)
    covariance, pairs = path_covariance(evidence, reward)
    fitted = np.flatnonzero(identified)
    block = np.ix_(fitted, fitted)
    inverse = np.linalg.inv(covariance[:k, :k][block])
    mixed = np.zeros((k, k, k))
    for number, (i, j) in enumerate(pairs):
        mixed[i, j] = mixed[j, i] = covariance[k + number, :k]
    slope = np.zeros((k, k, k))
    for j, error in zip(fitted.tolist(), np.sqrt(np.diag(inverse)).tolist(), strict=True):
        slope[:, :, j] = _information_slope(evidence, reward, j, STEP * error)
    inner = (mixed - slope)[np.ix_(fitted, fitted, fitted)]
    bias = np.zeros(k)
    bias[fitted] = 0.5 * np.einsum("si,jk,ijk->s", inverse, inverse, inner)
    return bias


def expected_bias(evidence: Evidence, found: Fit) -> FloatArray | None:
    """(k,) bias to expect of a fit to whole paths, in the parameters' units.

    None where it is not known: the fit is not at a maximum of the likelihood alone, or no parameter has a standard
    error, or there is no policy close by.
    """
    identified = np.isfinite(found.standard_errors)
    if not (_is_plain(found) and identified.any()):
        return None
    try:
        return first_order_bias(evidence, found.reward, identified)
    except RewardError:
        return None


def _is_plain(found: Fit) -> bool:
    """Whether a fit is at a maximum of the likelihood alone, or with the paper's small regulariser."""
    ended = found.status not in {Status.STOPPED_EARLY, Status.INFINITE}
    return ended and found.prior is None and found.l2 <= PAPER_L2


def corrected(evidence: Evidence, found: Fit) -> Fit:
    """A fit to whole paths minus its bias; the standard errors are those of the fit.

    Raises:
        RewardError: The fit is not at a maximum of the likelihood, or its bias exceeds a standard error. Then the
            demonstrations are too few for a correction to first order.
    """
    if not _is_plain(found):
        raise RewardError(
            "`correct_bias`: the bias is known only at a maximum of the likelihood, without `prior` or a larger `l2`"
        )
    identified = np.isfinite(found.standard_errors)
    try:
        bias = first_order_bias(evidence, found.reward, identified)
        reward = Reward(tuple((np.array(found.reward.theta) - bias).tolist()), found.reward.terms)
        value = log_likelihood(evidence, reward)
    except RewardError as error:
        raise RewardError(f"`correct_bias`: {TOO_FEW} (beyond the bounds of the reward)") from error
    large = [
        parameter.name
        for parameter, one, spread, fitted_here in zip(
            reward.parameters, bias, found.standard_errors, identified, strict=True
        )
        if fitted_here and abs(one) > spread
    ]
    if large:
        raise RewardError(f"`correct_bias`: {TOO_FEW} (by more than a standard error in {', '.join(large)})")
    regulariser = Prior.l2(reward.parameters, found.l2).log_density(np.array(reward.theta))
    return replace(found, reward=reward, log_likelihood=value, objective=value + regulariser, bias=bias)


def _information_slope(evidence: Evidence, reward: Reward, number: int, step: float) -> FloatArray:
    """(k, k) derivative of the expected information by one parameter, by a difference quotient within its bounds."""
    parameter, here = reward.parameters[number], reward.theta[number]
    ends = max(here - step, parameter.lower), min(here + step, parameter.upper)
    k = len(reward.theta)
    low, high = (
        path_covariance(evidence, Reward((*reward.theta[:number], end, *reward.theta[number + 1 :]), reward.terms))[0]
        for end in ends
    )
    slope: FloatArray = (high - low)[:k, :k] / (ends[1] - ends[0])
    return slope
