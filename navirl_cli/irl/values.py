"""Soft values, policy and visits as solutions of linear systems (Eqs. 7-10 without iteration over time).

With deterministic moves and an absorbing goal, z = exp(V) solves (I - M) z = e_goal with M(s, s') = exp(r(s, a)) >= 0.
Values reach -600 within a few metres, so the system is scaled twice. First M is conjugated with the hard value
(Dijkstra), which bounds its entries by 1 where rewards are negative; on large maps a better guess is found band by
band. Then the series of :mod:`navirl_cli.irl.series` gives z relative to that guess, accurate in every entry. M
conjugated with z as well is the policy P. Visits and expected sums are solved with the same factor.
"""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import OPPOSITE
from navirl_cli.irl.graph import Graph
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.ordering import Ordering
from navirl_cli.irl.series import InfinitePartitionError, Splitting, ValueStatus

#: Within so many steps from the goal, z relative to the hard value stays in the range of a double: three or four of the
#: moves lead down, and 4^250 is e^347.
PLAIN_STEPS = 250
#: Size of a block of states within which z relative to the best path through the block stays in that range.
STEPS_PER_BAND = 100.0
#: Every climb of a best path in the order of the states costs a sweep. Beyond so many, a new order is cheaper.
MAX_CLIMBS = 6
#: A cell with fewer expected visits is practically never entered.
SEEN = 1e-200


@dataclass(frozen=True, eq=False)
class Policy:
    """The soft-optimal policy of one reward on one scene, with the factors for its linear systems."""

    ordering: Ordering
    #: (n,) soft value V = log z.
    value: FloatArray
    #: (n, 8) probability of each move; rows sum to 1, the goal's to 0.
    probability: FloatArray
    #: Sweeps that the values took.
    sweeps: int
    _splitting: Splitting
    #: (n,) by rank: P is the factorised matrix conjugated with it, diag(z)^-1 M' diag(z).
    _z: FloatArray

    @property
    def graph(self) -> Graph:
        """The states."""
        return self.ordering.graph

    @property
    def lattice(self) -> Lattice:
        """The cells that the states belong to."""
        return self.graph.lattice

    @property
    def goal(self) -> int:
        """The absorbing state."""
        return self.ordering.goal

    def expected_to_goal(self, reward: FloatArray) -> FloatArray:
        """Expected sum of a per-state reward on the path to the goal: Y = (I - P)^-1 reward.

        Args:
            reward: (n,) or (n, k); its goal row counts once.

        Returns:
            Y, same shape.
        """
        z = self._z if reward.ndim == 1 else self._z[:, None]
        return (self._splitting.solve(reward[self.ordering.order] * z, self._z, self.sweeps) / z)[self.ordering.rank]

    def visits(self, start: FloatArray) -> FloatArray:
        """Expected visits D = (I - P^T)^-1 start (Eq. 10 summed over all times).

        Args:
            start: (n,) weight of every state as a start.

        Returns:
            (n,) expected visits; the flow into the goal is the sum of the weights.
        """
        weighed = start[self.ordering.order] / self._z
        by_rank = self._splitting.solve(weighed, 1 / self._z, self.sweeps, transposed=True)
        return (by_rank * self._z)[self.ordering.rank]

    def visits_from(self, cell: int) -> FloatArray:
        """(n,) expected visits of a path that begins in a cell: :meth:`visits` of e_start."""
        start = np.zeros(self.graph.size)
        start[self.graph.beginning_in(cell)] = 1.0
        return self.visits(start)

    def log_likelihoods(self, cells: IntArray, moves: IntArray) -> FloatArray:
        """Log-probabilities of moves along paths, nats; -inf where the policy never makes one.

        Args:
            cells: (..., k) numbers of the paths' cells in the lattice.
            moves: (..., k - 1) their moves; -1 where a path stays in the goal, which has probability 1.
        """
        states = self.graph.along(cells, moves)
        with np.errstate(divide="ignore"):
            logs = np.log(self.probability[states[..., :-1], moves])
        return np.where(moves >= 0, logs, 0.0)

    def value_by_cell(self) -> FloatArray:
        """(cells,) soft value of paths that begin in each cell."""
        return self.graph.where_paths_begin(self.value)

    def visits_by_cell(self, cell: int) -> FloatArray:
        """(cells,) expected visits of a path that begins in a cell."""
        return self.graph.by_cell(self.visits_from(cell))

    def flow_by_cell(self, cell: int) -> FloatArray:
        """(cells, 8) expected number of times that a path that begins in a cell takes each step."""
        return self.graph.by_cell(self.visits_from(cell)[:, None] * self.probability)

    def probability_by_cell(self, cell: int) -> FloatArray:
        """(cells, 8) probability of each move, for a path that begins in a cell.

        Where states differ by incoming move, its mean over visits. Cells that the path practically never enters have
        the probabilities of paths that begin in them.
        """
        flow, begun = self.flow_by_cell(cell), self.graph.where_paths_begin(self.probability)
        visits = flow.sum(axis=1, keepdims=True)
        return np.where(visits > SEEN, flow / np.maximum(visits, SEEN), begun)


def solve(ordering: Ordering, reward: FloatArray) -> Policy:
    """Soft values and policy of a reward.

    Args:
        ordering: The states by the length of their path to the goal. Where the best paths differ much from these, a
            better order is made.
        reward: (n, 8) reward of every step by state, -inf where a move is not possible and in the goal.

    Returns:
        The policy.

    Raises:
        InfinitePartitionError: The partition function is infinite, or too close to infinite to be decided.
    """
    graph = ordering.graph
    if reward.max() >= 0:
        # Moving to and fro costs nothing: a cycle of weight 1 is enough.
        ahead, here = graph.neighbours, np.arange(graph.size)[:, None]
        if ((reward + reward[ahead, OPPOSITE] >= 0) & (ahead[ahead, OPPOSITE] == here)).any():
            raise InfinitePartitionError(ValueStatus.INFINITE)
    # Dijkstra needs positive costs. The result is exact for any shift, so a clipped cost is valid. No step leaves the
    # goal, so any positive cost is valid there.
    floor = 1e-3 * float(graph.lattice.step_m.min())
    cost = np.maximum(np.where(np.isfinite(reward), -reward, 1.0), floor)
    hard, parent = graph.cheapest_tree(ordering.goal, cost)
    large = float(ordering.distance.max()) > PLAIN_STEPS * float(graph.lattice.step_m.min())
    if ordering.climbs(parent) > MAX_CLIMBS:
        ordering = Ordering(graph, ordering.goal, hard, np.where(graph.possible, cost, np.inf).min(axis=1))
    order = ordering.order
    ranked, shift = reward[order], -hard[order]
    if large:
        if (cost == floor).any():
            raise InfinitePartitionError(ValueStatus.UNDECIDED)  # steps with positive reward: no hard value
        up = parent[order]
        shift = _raised(ordering, ranked, shift, np.where(up >= 0, ordering.rank[up], -1))
    weight = _conjugated(ordering, ranked, shift)
    splitting = Splitting.of(ordering, weight)
    unit = np.zeros(graph.size)
    unit[0] = 1.0
    z, sweeps = splitting.partition(unit)
    weight *= z[ordering.neighbours]
    weight /= z[:, None]
    return Policy(ordering, (shift + np.log(z))[ordering.rank], weight[ordering.rank], sweeps, splitting, z)


def _conjugated(ordering: Ordering, ranked: FloatArray, shift: FloatArray) -> FloatArray:
    """(n, 8) weights exp(r) of the steps by rank, conjugated with exp(shift)."""
    with np.errstate(under="ignore", over="ignore"):
        weight: FloatArray = np.exp(ranked + shift[ordering.neighbours] - shift[:, None])
    if not np.isfinite(weight).all():
        raise InfinitePartitionError(ValueStatus.UNDECIDED)
    return weight


def _raised(ordering: Ordering, ranked: FloatArray, hard: FloatArray, parent: IntArray) -> FloatArray:
    """A guess of the value, close enough for z to fit a double on maps where the hard value is not.

    One pass over the steps that lead down, band by band away from the goal. Each band's z is relative to the best path
    down to the band below and to the values found from there. No number leaves the range of a double.

    Args:
        ordering: The states.
        ranked: (n, 8) reward by rank.
        hard: (n,) value of the best path by rank.
        parent: (n,) rank of the next state on the best path, -1 for the goal.

    Returns:
        (n,) by rank, between the hard value and the soft one.
    """
    raised = hard.copy()
    low = 0
    while low < len(hard):
        high = _end_of_band(ordering, low)
        raised[low:high] += _gain_along_path(raised - hard, parent, low, high)
        raised[low:high] += _gain_in_the_band(ordering, ranked, raised, low, high)
        low = high
    return raised


def _end_of_band(ordering: Ordering, low: int) -> int:
    """The first rank that is farther from the rank ``low`` than a band's number of the cheapest steps in between."""
    length = 4096
    while True:
        states = ordering.order[low : low + length]
        distance, cheapest = ordering.distance[states], np.minimum.accumulate(ordering.step[states])
        beyond = distance - distance[0] > STEPS_PER_BAND * cheapest
        if beyond.any():
            return low + max(int(np.argmax(beyond)), 1)
        if low + length >= len(ordering.order):
            return len(ordering.order)
        length *= 4


def _gain_along_path(gain: FloatArray, parent: IntArray, low: int, high: int) -> FloatArray:
    """Gain over the hard value where the best paths leave the band of ranks low to high downward."""
    leaves = parent[low:high].copy()
    while (inside := (leaves >= low) & (leaves < high)).any():
        leaves[inside] = leaves[leaves[inside] - low]  # these were moved on already, so twice as far each time
    return np.where((leaves >= 0) & (leaves < low), gain[leaves], 0.0)


def _gain_in_the_band(ordering: Ordering, ranked: FloatArray, raised: FloatArray, low: int, high: int) -> FloatArray:
    """log z of the band from its steps that lead down, relative to the guess, given the values of the bands below."""
    from scipy.sparse import csr_array, eye_array
    from scipy.sparse.linalg import spsolve_triangular

    neighbours = ordering.neighbours[low:high]
    rank = np.arange(low, high)[:, None]
    with np.errstate(under="ignore", over="ignore"):
        weight = np.exp(ranked[low:high] + raised[neighbours] - raised[low:high, None])
    right = np.where(neighbours < low, weight, 0.0).sum(axis=1)
    if low == 0:
        right[0] = 1.0  # the goal
    row, move = np.nonzero((neighbours >= low) & (neighbours < rank))
    size = high - low
    # SuperLU's indices are of 32 bits, and not every scipy converts them.
    place = row.astype(np.int32), (neighbours[row, move] - low).astype(np.int32)
    triangular = eye_array(size, format="csr") - csr_array((weight[row, move], place), shape=(size, size))
    z = spsolve_triangular(triangular, right, lower=True, unit_diagonal=True)
    if not np.isfinite(z).all():
        raise InfinitePartitionError(ValueStatus.UNDECIDED)
    # Where the best path first leads up, the steps that lead down give a smaller value.
    gain: FloatArray = np.log(np.maximum(z, 1.0))
    return gain
