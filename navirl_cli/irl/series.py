"""Linear systems (I - M) x = b with M >= 0, solved as positive series, or by a Krylov method where the series are slow.

M is split into L, triangular in the order of the states, and the rest U. Solving with I - L is forward substitution.
For a positive right side it adds positive terms only, so every entry is exact to rounding. It has no fill-in. Sweeps
add U:

    x = sum_k G^k x_0,   x_0 = (I - L)^-1 b,   G = (I - L)^-1 U.

A sweep costs little more than a product with M, so hundreds of them are affordable. Where the spectral radius of G is
so close to 1 that thousands would be needed, a Krylov method (BiCGSTAB) solves (I - G) x = x_0. Its accuracy is
relative to the largest entry. The variables are therefore divided by their sizes, which makes every entry as accurate.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.ordering import Ordering

#: Relative size below which the remainder of a positive series is neglected.
TOLERANCE = 1e-14
#: Number of sweeps after which the Krylov method starts, and after which the solution fails.
PLAIN_SWEEPS = 300
MAX_SWEEPS = 5000
#: A sum that the last sweep raised by at most this share has the right size in every entry.
SETTLED = 0.1
#: Steps of the Krylov method, and how often it restarts from its last result.
KRYLOV_STEPS, CORRECTIONS = 500, 16
#: Number of sweeps within which a vector must prove that the partition function is infinite.
PROOF_SWEEPS = 40
#: Largest guaranteed relative error of z that is accepted.
ACCEPTED = 1e-9
#: Replaces zero in denominators.
TINY = 1e-290


class ValueStatus(StrEnum):
    """Why there are no soft values."""

    INFINITE = "infinite partition function"
    UNDECIDED = "too close to an infinite partition function to be computed"


class InfinitePartitionError(RewardError):
    """The partition function is infinite, or too close to infinite to be decided."""

    def __init__(self, status: ValueStatus) -> None:
        """Keep the status with the message."""
        self.status = status
        super().__init__(
            f"{status.value}: a step costs so little under these parameters that endless detours outweigh the direct "
            "path; choose a more negative c0 (on open ground below about -1.8 per cell, -18 /m on 10 cm cells) "
            "or a smaller positive a_p"
        )

    def __reduce__(self) -> tuple[type["InfinitePartitionError"], tuple[ValueStatus]]:
        """Cross process borders with the status, from which the message is built again."""
        return type(self), (self.status,)


@dataclass(frozen=True, eq=False)
class Splitting:
    """A matrix M = L + U >= 0 by rank, with I - L factorised."""

    #: scipy's SuperLU of I - L (no fill-in: it is triangular).
    factor: Any
    #: U as csr_array.
    rest: Any

    @staticmethod
    def of(ordering: Ordering, weight: FloatArray) -> "Splitting":
        """Split and factorise (n, 8) weights of steps by rank."""
        from scipy.sparse.linalg import splu

        triangular, rest = ordering.split(weight)
        # Supernodes and panels serve fill-in. Without fill-in they only cost time.
        factor = splu(
            triangular,
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            relax=1,
            panel_size=1,
            options={"SymmetricMode": True, "Equil": False},
        )
        return Splitting(factor, rest)

    @cached_property
    def rest_transposed(self) -> Any:
        """U transposed, as a matrix that is fast to multiply with."""
        return self.rest.T.tocsr()

    def start(self, right: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x_0 = (I - L)^-1 right, or with the transpose."""
        first: FloatArray = self.factor.solve(right, "T" if transposed else "N")
        return first

    def sweep(self, x: FloatArray, *, transposed: bool = False) -> FloatArray:
        """G x = (I - L)^-1 U x, or (I - L)^-T U^T x."""
        rest = self.rest_transposed if transposed else self.rest
        # The solver returns column-major arrays; the product is faster on row-major ones.
        return self.start(rest @ np.ascontiguousarray(x), transposed=transposed)

    def solve(self, right: FloatArray, size: FloatArray, sweeps: int, *, transposed: bool = False) -> FloatArray:
        """x with (I - L - U) x = right, or with the transpose, where the spectral radius of M is known to be below 1.

        Args:
            right: (n,) or (n, k) by rank.
            size: (n,) positive; x / size is of comparable size in all entries.
            sweeps: Estimated number of sweeps; convergence is not tested before.
            transposed: Solve with the transpose.

        Returns:
            x, same shape, to rounding relative to the largest x / size of its column.

        Raises:
            InfinitePartitionError: x cannot be found, because the partition function is too close to infinite.
        """
        measure = 1 / size if right.ndim == 1 else 1 / size[:, None]
        first = term = total = self.start(right, transposed=transposed)
        for number in range(1, PLAIN_SWEEPS + 1):
            term = self.sweep(term, transposed=transposed)
            total = total + term
            if number < sweeps - 1:
                continue
            if (np.abs(term * measure).max(axis=0) <= TOLERANCE * np.abs(total * measure).max(axis=0)).all():
                return total
        if right.ndim == 1:
            return self._refined(first, total, size, transposed=transposed)
        columns = zip(first.T, total.T, strict=True)
        return np.stack([self._refined(*column, size, transposed=transposed) for column in columns], axis=1)

    def _refined(self, first: FloatArray, guess: FloatArray, size: FloatArray, *, transposed: bool) -> FloatArray:
        """One column of :meth:`solve` by the Krylov method, from the first term and a guess."""
        x = guess
        for _ in range(CORRECTIONS):
            lacking = (first + self.sweep(x, transposed=transposed) - x) / size
            if np.abs(lacking).max() <= 10 * TOLERANCE * np.abs(x / size).max():
                return x
            x = x + size * self._corrected(lacking, size, 1e-8, transposed=transposed)
        raise InfinitePartitionError(ValueStatus.UNDECIDED)

    def partition(self, right: FloatArray) -> tuple[FloatArray, int]:
        """z with (I - L - U) z = right, whatever the spectral radius of M is.

        Args:
            right: (n,) by rank, nowhere negative.

        Returns:
            z, accurate in every entry, and the number of sweeps it took.

        Raises:
            InfinitePartitionError: There is no finite positive z, or this cannot be decided, or z is not accurate.
        """
        first = term = total = self.start(right)
        untried = True
        for sweeps in range(1, MAX_SWEEPS + 1):
            before = term
            with np.errstate(over="ignore", invalid="ignore"):
                term = self.sweep(before)
                total = total + term
                share = float((term / np.maximum(total, TINY)).max())
            if not share <= 1:
                break  # it overflows
            # Relative to the hard value every z is at least 1: smaller entries have not been reached yet.
            settled = share < SETTLED and float(total.min()) > 0.5
            if settled and share < 1e3 * TOLERANCE and share * _rest_of_series(term, before, total) <= TOLERANCE:
                return total, sweeps
            if sweeps % 4 == 2 and _grows(term, before, total):
                raise InfinitePartitionError(ValueStatus.INFINITE)
            if settled and sweeps >= PLAIN_SWEEPS and untried:
                found, untried = self._accelerated(first, total), False
                if found is not None:
                    return found, sweeps
        raise InfinitePartitionError(ValueStatus.UNDECIDED)

    def _accelerated(self, first: FloatArray, z: FloatArray) -> FloatArray | None:
        """The sum of the series by the Krylov method, from a sum of the right size everywhere; None if not certain."""
        worst = np.inf
        for number in range(CORRECTIONS):
            lacking = (first + self.sweep(z) - z) / z
            before, worst = worst, float(np.abs(lacking).max())
            if worst <= TOLERANCE or before <= 1e3 * TOLERANCE or number == CORRECTIONS - 1:
                break
            ratio = 1 + self._corrected(lacking, z, 1e-6)
            if not np.isfinite(ratio).all():
                break
            if ratio.min() <= 0:
                self._refuse_infinite(z * np.abs(ratio))
            z = z * np.maximum(ratio, 0.5)
        # (I - G') t >= 1/4 with t > 0 proves that the series ends, and bounds the inverse of I - G' by 4 max t.
        t = self._corrected(np.ones_like(z), z, 0.3 / np.sqrt(len(z)))
        certain = float(t.min()) > 0 and float((t - self.sweep(z * t) / z).min()) >= 0.25
        return z if certain and 4 * float(t.max()) * worst <= ACCEPTED else None

    def _refuse_infinite(self, x: FloatArray) -> None:
        """Raise where a positive vector, or its image after sweeps, proves the partition function infinite."""
        x = np.maximum(x, TINY * float(x.max()))
        for _ in range(PROOF_SWEEPS):
            after = self.sweep(x)
            if (after >= x).all():
                raise InfinitePartitionError(ValueStatus.INFINITE)
            x = after / float(after.max())

    def _corrected(
        self, lacking: FloatArray, size: FloatArray, accuracy: float, *, transposed: bool = False
    ) -> FloatArray:
        """d with d - G' d = lacking by BiCGSTAB, G' = G on variables divided by their size.

        Args:
            lacking: (n,) right side in units of size.
            size: (n,) positive.
            accuracy: Norm of the residual relative to that of the right side.
            transposed: With the transpose.

        Returns:
            (n,) in units of size; not a number where it overflows.
        """
        from scipy.sparse.linalg import LinearOperator, bicgstab

        def without_sweep(u: FloatArray) -> FloatArray:
            left: FloatArray = u - self.sweep(size * u, transposed=transposed) / size
            return left

        # The norm of numbers near the smallest double is zero. The system is linear, so it can be scaled.
        unit = float(np.abs(lacking).max()) or 1.0
        operator = LinearOperator((len(lacking), len(lacking)), matvec=without_sweep, dtype=float)
        # Where it breaks down or takes too long, its last result is still a better guess for a restart.
        found, _ = bicgstab(operator, lacking / unit, rtol=accuracy, maxiter=KRYLOV_STEPS)
        step: FloatArray = found * unit
        return step


def _rest_of_series(term: FloatArray, before: FloatArray, total: FloatArray) -> float:
    """Bound on the remainder after the last term, in multiples of it.

    The ratios of successive terms only fall (Collatz and Wielandt).
    """
    alive = before > total * 1e-290
    most = float((term[alive] / before[alive]).max(initial=0.0))
    return most / (1 - most) if most < 1 else np.inf


def _grows(term: FloatArray, before: FloatArray, total: FloatArray) -> bool:
    """Whether no entry of a sweep is smaller than before, which proves that the series is infinite."""
    alive = before > total * 1e-290
    return bool(alive.any() and (term[alive] >= before[alive]).all())
