"""Soft values, policy and visits as solutions of linear systems (Eqs. 7-10 without iteration over time).

With deterministic moves and an absorbing goal, z = exp(V) solves (I - M) z = e_goal with M(s, s') = exp(r(s, a)) >= 0.
Values reach -600 within a few metres, so the system is scaled twice. First M is conjugated with the hard value phi
(Dijkstra), which bounds its entries by 1 where rewards are negative. Then the states are put in order of phi: the steps
that go down toward the goal form a triangular matrix L, solving with which adds positive terms only and is therefore
exact in every entry to rounding, and the rest U is swept in:

    z = sum_k G^k z_0,   z_0 = (I - L)^-1 e_goal,   G = (I - L)^-1 U.

All terms are positive, so that max_s (G x)(s) / x(s) < 1 for one positive x proves that the partition function is
finite and bounds what is left out, and min_s (G x)(s) / x(s) >= 1 proves that it is infinite (Collatz and Wielandt; the
splitting is regular, so that this holds of M as of G).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from navirl_cli.demos.grid import FloatArray, IntArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.lattice import Lattice

#: Relative size at which the rest of a positive series counts as nothing.
TOLERANCE = 1e-14
MAX_SWEEPS = 3000
#: A block of states within which z cannot grow by more than a double holds (8 moves a step: 8^140 = e^291).
STEPS_PER_BAND = 140
MAX_BANDS = 256
#: The first term of the series for z may be this large; what the sweeps add fits above it.
ROOM = 1e200


class ValueStatus(StrEnum):
    """Why there are no soft values."""

    INFINITE = "infinite partition function"
    UNDECIDED = "too close to an infinite partition function to be computed"


class InfinitePartitionError(RewardError):
    """The partition function is infinite, or so close to it that it cannot be told."""

    def __init__(self, status: ValueStatus) -> None:
        """Keep the status beside the message."""
        self.status = status
        super().__init__(
            f"{status.value}: a step costs so little under these parameters that endless detours outweigh the direct "
            "way; choose a more negative c0 (on open ground below about -1.8 per cell, -18 /m on 10 cm cells) "
            "or a smaller positive a_p"
        )

    def __reduce__(self) -> tuple[type["InfinitePartitionError"], tuple[ValueStatus]]:
        """Cross process borders with the status, from which the message is made anew."""
        return type(self), (self.status,)


@dataclass(frozen=True)
class Policy:
    """The soft-optimal policy of one reward on one scene, with the means to solve linear systems in it."""

    lattice: Lattice
    goal: int
    #: (n,) soft value V = log z.
    value: FloatArray
    #: (n, 8) probability of each move; rows sum to 1, the goal's to 0.
    probability: FloatArray
    #: Sweeps that the values took.
    sweeps: int
    _split: "_Splitting"
    #: (n,) by rank: P is the factorised matrix conjugated with it, diag(z)^-1 M' diag(z).
    _z: FloatArray

    def expected_to_goal(self, reward: FloatArray) -> FloatArray:
        """Expected sum of a per-state reward on the way to the goal: Y = (I - P)^-1 reward.

        Args:
            reward: (n,) or (n, k); its goal row counts once.

        Returns:
            Y, same shape.
        """
        z = self._z if reward.ndim == 1 else self._z[:, None]
        by_rank = self._split.sum_series(reward[self._split.order] * z, 1 / z, transposed=False)
        return self._split.by_state(by_rank / z)

    def visits(self, start: FloatArray) -> FloatArray:
        """Expected visits D = (I - P^T)^-1 start (Eq. 10 summed over all times).

        Args:
            start: (n,) weight of every state as a start, e_start for one demonstration.

        Returns:
            (n,) expected visits; the flow into the goal is the sum of the weights.
        """
        by_rank = self._split.sum_series(start[self._split.order] / self._z, self._z, transposed=True)
        return self._split.by_state(by_rank * self._z)


@dataclass(frozen=True)
class _Splitting:
    """A matrix L + U >= 0 in an order in which L is triangular, with I - L factorised."""

    #: State at every rank.
    order: IntArray
    #: scipy's SuperLU of I - L in that order (no fill-in: L is triangular).
    factor: Any
    #: U as csr_array, in that order.
    rest: Any

    def by_state(self, by_rank: FloatArray) -> FloatArray:
        """An array by rank put in the order of the states."""
        result = np.empty_like(by_rank)
        result[self.order] = by_rank
        return result

    def sum_series(self, right: FloatArray, measure: FloatArray, *, transposed: bool) -> FloatArray:
        """x with (I - L - U) x = right, or its transpose, where the series is known to converge.

        Args:
            right: (n,) or (n, k) by rank.
            measure: Weights under which the entries of x are of comparable size.
            transposed: Solve with the transpose.

        Returns:
            x by rank.

        Raises:
            InfinitePartitionError: So close to an infinite partition function the series takes too long.
        """
        trans, rest = ("T", self.rest.T) if transposed else ("N", self.rest)
        term = total = self.factor.solve(right, trans)
        for _ in range(MAX_SWEEPS):
            term = self.factor.solve(rest @ term, trans)
            total = total + term
            if (np.abs(term * measure).max(axis=0) <= TOLERANCE * np.abs(total * measure).max(axis=0)).all():
                result: FloatArray = total
                return result
        raise InfinitePartitionError(ValueStatus.UNDECIDED)


def solve(lattice: Lattice, goal: int, reward: FloatArray) -> Policy:
    """Soft values and policy of a reward.

    Args:
        lattice: The states.
        goal: The absorbing state.
        reward: (n, 8) reward of every step, -inf where a move is not possible and in the goal.

    Returns:
        The policy.

    Raises:
        InfinitePartitionError: The partition function is infinite or not to be told from infinite.
    """
    cost = np.where(lattice.possible, -reward, np.inf)
    cost[goal] = np.where(lattice.possible[goal], 1.0, np.inf)  # no step leaves the goal: any positive cost will do
    # Dijkstra needs positive costs; as the shift is exact whatever it is, a clipped cost is as good.
    floor = 1e-3 * float(lattice.step_m.min())
    cost = np.maximum(cost, floor)
    shift = -lattice.costs_to(goal, cost)
    order = np.argsort(-shift, kind="stable")
    splitting = _split(lattice, reward, shift, order)
    unit = np.zeros(lattice.size)
    unit[order == goal] = 1.0  # by rank
    first = splitting.factor.solve(unit)
    if not first.max() < ROOM:  # a large map: beside the hard value z leaves the range of a double
        if (cost > -reward)[lattice.possible].any():
            raise InfinitePartitionError(ValueStatus.UNDECIDED)  # steps that pay: there is no hard value to start from
        cheapest = max(float(cost[lattice.possible].min()), floor)
        shift = _banded_shift(lattice, reward, cost, shift, order, STEPS_PER_BAND * cheapest)
        splitting = _split(lattice, reward, shift, order)
        first = splitting.factor.solve(unit)
    z, sweeps = _sum_values(splitting, first)
    value = np.empty(lattice.size)
    value[order] = np.log(z)
    value += shift
    probability = np.zeros((lattice.size, 8))
    source, move, target = lattice.edges
    probability[source, move] = np.exp(reward[source, move] + value[target] - value[source])
    return Policy(lattice, goal, value, probability, sweeps, splitting, z)


def _split(lattice: Lattice, reward: FloatArray, shift: FloatArray, order: IntArray) -> _Splitting:
    """M conjugated with exp(shift), split and factorised."""
    from scipy.sparse import csc_array, csr_array, eye_array
    from scipy.sparse.linalg import splu

    source, move, target = lattice.edges
    with np.errstate(under="ignore", over="ignore"):
        weight = np.exp(reward[source, move] + shift[target] - shift[source])
    if not np.isfinite(weight).all():
        raise InfinitePartitionError(ValueStatus.UNDECIDED)
    rank = np.empty(lattice.size, dtype=np.int32)
    rank[order] = np.arange(lattice.size, dtype=np.int32)
    row, column = rank[source], rank[target]
    down = column < row
    shape = (lattice.size, lattice.size)
    lower = csc_array((-weight[down], (row[down], column[down])), shape=shape) + eye_array(lattice.size, format="csc")
    factor = splu(
        lower.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )
    rest = csr_array((weight[~down], (row[~down], column[~down])), shape=shape)
    return _Splitting(order, factor, rest)


def _sum_values(splitting: _Splitting, first: FloatArray) -> tuple[FloatArray, int]:
    """The positive series for z from its first term on, with the proof that it ends."""
    term = total = first
    for sweep in range(1, MAX_SWEEPS + 1):
        with np.errstate(over="ignore", invalid="ignore"):
            after = splitting.factor.solve(splitting.rest @ term)
            total = total + after
        if not np.isfinite(total).all():
            break
        alive = term > total * 1e-290
        if not alive.any() or not after.any():
            return total, sweep
        ratio = after[alive] / term[alive]
        most = float(ratio.max())
        if most < 1 and float((after / total).max()) * most / (1 - most) <= TOLERANCE:
            return total, sweep
        if float(ratio.min()) >= 1 and sweep > 1:
            raise InfinitePartitionError(ValueStatus.INFINITE)
        term = after
    raise InfinitePartitionError(ValueStatus.UNDECIDED)


def _banded_shift(
    lattice: Lattice, reward: FloatArray, cost: FloatArray, shift: FloatArray, order: IntArray, height: float
) -> FloatArray:
    """A shift so near to the value that z fits a double on maps where it would not beside the hard value.

    One pass over the down-going steps, band by band away from the goal; each band's z is taken relative to the best
    single way through the band and on with the values below it, so that no number leaves the range of a double.
    """
    bands = min(MAX_BANDS, int(np.ceil(-shift.min() / height)))
    band = np.minimum((-shift / -shift.min() * bands).astype(np.int64), bands - 1)
    better = np.full(lattice.size, np.nan)
    for number in range(bands):
        members = order[band[order] == number]
        if len(members):
            better[members] = _band_values(lattice, reward, cost, better, members)
    return better


def _band_values(
    lattice: Lattice, reward: FloatArray, cost: FloatArray, known: FloatArray, members: IntArray
) -> FloatArray:
    """log z of one band by its down-going steps, given that of the bands below it (NaN where it is not known)."""
    from scipy.sparse import csr_array, eye_array
    from scipy.sparse.linalg import spsolve_triangular

    rank = np.full(lattice.size, -1, dtype=np.int64)
    rank[members] = np.arange(len(members))
    row, move = np.nonzero(lattice.possible[members])
    source, target = members[row], lattice.neighbours[members[row], move]
    out = ~np.isnan(known[target])
    leaving = reward[source, move][out] + known[target[out]]
    inside = (rank[target] >= 0) & (rank[target] < row)
    here, there = row[inside], rank[target[inside]]
    entry = np.full(len(members), -np.inf)
    np.maximum.at(entry, row[out], leaving)
    if np.isnan(known).all():
        entry[0] = 0.0  # the goal stands first
    own = _best_ways(entry, here, there, cost[source, move][inside])
    with np.errstate(under="ignore"):
        right = np.bincount(row[out], np.exp(leaving - own[row[out]]), minlength=len(members))
        weight = np.exp(reward[source, move][inside] + own[there] - own[here])
    if np.isnan(known).all():
        right[0] = 1.0
    # SuperLU's indices are of 32 bits, and not every scipy converts them.
    place = here.astype(np.int32), there.astype(np.int32)
    lower = eye_array(len(members), format="csr") - csr_array((weight, place), shape=(len(members), len(members)))
    values: FloatArray = own + np.log(spsolve_triangular(lower, right, lower=True, unit_diagonal=True))
    return values


def _best_ways(entry: FloatArray, here: IntArray, there: IntArray, cost: FloatArray) -> FloatArray:
    """max over ways of (entry where the way ends - cost of its steps here -> there), by Dijkstra from a node beyond."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    count, ends = len(entry), np.flatnonzero(np.isfinite(entry))
    top = float(entry[ends].max()) + 1.0  # costs must be positive
    tail, head = np.concatenate([np.full(len(ends), count), there]), np.concatenate([ends, here])
    graph = csr_array((np.concatenate([top - entry[ends], cost]), (tail, head)), shape=(count + 1, count + 1))
    best: FloatArray = top - dijkstra(graph, indices=count)[:count]
    return best
