"""Uncertainty of a fit from the curvature at its maximum and from differences between participants."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray

#: Information, in squared units of a parameter's scale, below which a parameter is not identified: a standard error of
#: 1000 scales.
NO_INFORMATION = 1e-6


def observed(
    information: FloatArray, regulariser: FloatArray, active: NDArray[np.bool_]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Covariance from the observed information, and the parameters that take part in a direction without information.

    A direction is judged without the regulariser, because the regulariser is not data.

    Args:
        information: (k, k) negative Hessian of the objective, parameters in units of their scales.
        regulariser: (k, k) the regulariser's share of it.
        active: (k,) parameters that are inside their bounds and change the likelihood.

    Returns:
        (k, k) inverse of the information, NaN for parameters without information; (k,) blind parameters.
    """
    covariance = np.full(information.shape, np.nan)
    blind = np.zeros_like(active)
    if active.any():
        block = np.ix_(active, active)
        values, directions = np.linalg.eigh(information[block])
        plain = np.einsum("ij,ik,kj->j", directions, (information - regulariser)[block], directions)
        seen = plain > NO_INFORMATION
        found = (directions[:, seen] / values[seen]) @ directions[:, seen].T
        covariance[block] = found
        # The variance along a direction without information is at least 1 / NO_INFORMATION. A parameter whose variance
        # is smaller than its share of it is blind.
        blind[active] = (directions[:, ~seen] ** 2).sum(axis=1) / NO_INFORMATION > np.diag(found)
        covariance[blind] = covariance[:, blind] = np.nan
    return covariance, blind


def clustered(
    covariance: FloatArray, scores: FloatArray, participants: Sequence[str], prior: FloatArray | None = None
) -> FloatArray | None:
    """Sandwich covariance that does not assume independent demonstrations of a participant.

    A S A with A the covariance from the observed information and S the scatter of the participants' summed scores,
    times c/(c - 1) for c participants (Liang and Zeger 1986, Biometrika 73:13; White 1982, Econometrica 50:1).

    Args:
        covariance: (k, k), NaN for parameters without one.
        scores: (demonstrations, k) gradient of each demonstration's log-likelihood at the maximum.
        participants: By demonstration.
        prior: (k, k) precision of the prior, whose mean is an estimate as well.

    Returns:
        (k, k), NaN as in ``covariance``; None for a single participant.
    """
    names = sorted(set(participants))
    if len(names) < 2:
        return None
    member = np.array([[name == participant for participant in participants] for name in names], dtype=float)
    sums = member @ scores
    # At a penalised maximum the scores add up to the penalty's gradient, which is no scatter.
    sums = sums - sums.mean(axis=0)
    scatter = sums.T @ sums * len(names) / (len(names) - 1)
    if prior is not None:
        scatter = scatter + prior
    known = np.isfinite(np.diag(covariance))
    bread = covariance[np.ix_(known, known)]
    robust = np.full_like(covariance, np.nan)
    robust[np.ix_(known, known)] = bread @ scatter[np.ix_(known, known)] @ bread
    return robust


def correlation(covariance: FloatArray) -> FloatArray:
    """(k, k) correlations, NaN where there is no covariance."""
    error = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        matrix: FloatArray = covariance / np.outer(error, error)
    return matrix


def condition_number(covariance: FloatArray) -> float:
    """Largest / smallest eigenvalue of the correlations: 1 without correlation, large if nearly singular.

    The condition number of a covariance would depend on the parameters' units.
    """
    known = np.isfinite(np.diag(covariance))
    if not known.any():
        return np.nan
    values = np.linalg.eigvalsh(correlation(covariance[np.ix_(known, known)]))
    return float(values[-1] / values[0]) if values[0] > 0 else np.inf
