"""Gaussian prior of the parameters, in natural parameters, so that two priors add up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.terms.term import Parameter


@dataclass(frozen=True, eq=False)
class Prior(ByContent):
    """log density = shift.x - x.precision.x / 2 - constant, where the constant does not depend on x."""

    #: (k, k) positive semidefinite; a zero row gives no information on its parameter.
    precision: FloatArray
    #: (k,) precision times mean.
    shift: FloatArray
    constant: float = 0.0

    @staticmethod
    def l2(parameters: Sequence[Parameter], weight: float) -> "Prior":
        """The paper's regulariser: weight/2 times the sum of squares of the parameters divided by their scales.

        Args:
            parameters: The k parameters.
            weight: In nats per squared scale.

        Raises:
            RewardError: The weight is negative or not a number.
        """
        if not weight >= 0:
            raise RewardError(f"`l2`: expected 0 or more, found {weight:g}")
        scale = np.array([parameter.scale for parameter in parameters])
        return Prior(np.diag(weight / scale**2), np.zeros(len(scale)))

    @staticmethod
    def gaussian(mean: FloatArray, covariance: FloatArray) -> "Prior":
        """A Gaussian prior from the estimate and covariance of an earlier fit.

        Args:
            mean: (k,).
            covariance: (k, k); rows and columns that are not finite belong to parameters without information.

        Raises:
            RewardError: The finite part of the covariance is not positive definite.
        """
        known = np.isfinite(np.diag(covariance))
        block = covariance[np.ix_(known, known)]
        if not (np.isfinite(block).all() and np.allclose(block, block.T) and (np.linalg.eigvalsh(block) > 0).all()):
            raise RewardError("the covariance of the prior is not positive definite")
        precision = np.zeros_like(covariance)
        precision[np.ix_(known, known)] = np.linalg.inv(block)
        precision = (precision + precision.T) / 2
        shift = precision @ mean
        return Prior(precision, shift, float(shift @ mean) / 2)

    @property
    def known(self) -> NDArray[np.bool_]:
        """(k,) parameters on which it gives information."""
        known: NDArray[np.bool_] = (np.abs(self.precision).max(axis=1) > 0).astype(bool)
        return known

    def where(self, mask: NDArray[np.bool_]) -> "Prior":
        """The prior of some parameters only, which must be independent of the others."""
        return Prior(self.precision * np.outer(mask, mask), self.shift * mask, self.constant)

    def __add__(self, other: "Prior") -> "Prior":
        """The product of both densities."""
        return Prior(self.precision + other.precision, self.shift + other.shift, self.constant + other.constant)

    def log_density(self, theta: FloatArray) -> float:
        """Log density at (k,) parameters, relative to that at the mean (for the regulariser: at zero)."""
        return float(self.shift @ theta - theta @ self.precision @ theta / 2) - self.constant

    def gradient(self, theta: FloatArray) -> FloatArray:
        """(k,) gradient of the log density."""
        gradient: FloatArray = self.shift - self.precision @ theta
        return gradient
