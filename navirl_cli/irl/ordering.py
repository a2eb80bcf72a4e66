"""The states of a lattice in order of their distance to a goal, and the pattern of the matrices in that order."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import OPPOSITE
from navirl_cli.irl.lattice import Lattice


@dataclass(frozen=True, eq=False)
class Ordering:
    """Ranks of states by any distance to the goal; the goal has rank 0."""

    lattice: Lattice
    #: Number of the goal's state.
    goal: int
    #: (n,) distance to the goal by state: zero there, positive elsewhere; and that of the cheapest step out of each.
    distance: FloatArray
    step: FloatArray

    @cached_property
    def order(self) -> IntArray:
        """(n,) state at every rank."""
        order: IntArray = np.argsort(self.distance, kind="stable")
        return order

    @cached_property
    def rank(self) -> IntArray:
        """(n,) rank of every state."""
        rank = np.empty_like(self.order)
        rank[self.order] = np.arange(self.lattice.size)
        return rank

    @cached_property
    def neighbours(self) -> IntArray:
        """(n, 8) rank that each move leads to from every rank, -1 where the move is not possible."""
        neighbours = self.lattice.neighbours[self.order]
        ranks: IntArray = np.where(neighbours >= 0, self.rank[neighbours], -1)
        return ranks

    def climbs(self, parent: IntArray) -> int:
        """The largest number of steps to a farther state (by rank) on any path along a tree to the goal.

        Args:
            parent: (n,) next state on the path from every state, -1 for the goal.
        """
        following = np.where(parent >= 0, parent, np.arange(len(parent)))
        count = (self.rank[following] > self.rank).astype(np.int64)
        if not count.any():
            return 0
        while (following != self.goal).any():
            count = count + count[following]  # twice as far along the path each time
            following = following[following]
        return int(count.max())

    @cached_property
    def _patterns(self) -> tuple["_Pattern", "_Pattern"]:
        """Patterns of I - L (the steps that lead down, and the diagonal) by columns, and of U (the others) by rows."""
        rank = np.arange(self.lattice.size)[:, None]
        above = self.neighbours > rank
        # The reverse of a step up is a step down: a column holds the reverses of the steps in its row.
        reverse = self.neighbours * 8 + OPPOSITE
        lower = _Pattern.of(self.neighbours[above], reverse[above], above.sum(axis=1), diagonal=True)
        return lower, _Pattern.of(self.neighbours[above], np.flatnonzero(above), above.sum(axis=1))

    def split(self, weight: FloatArray) -> tuple[Any, Any]:
        """A matrix M >= 0 of steps as I - L, triangular, and the rest U, with M = L + U.

        Args:
            weight: (n, 8) by rank; any value where a move is not possible.

        Returns:
            csc_array I - L and csr_array U, rows and columns by rank.
        """
        from scipy.sparse import csc_array, csr_array

        lower, upper = self._patterns
        shape = (self.lattice.size, self.lattice.size)
        # The diagonal is 1.
        entries = np.ones(len(lower.indices))
        entries[lower.places] = -weight.ravel()[lower.taken]
        triangular = csc_array((entries, lower.indices, lower.starts), shape=shape)
        # Each entry occurs once, in any order. Without this flag the solver would sort them to check.
        triangular.has_canonical_format = True
        return triangular, csr_array((weight.ravel()[upper.taken], upper.indices, upper.starts), shape=shape)


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Pattern of a compressed sparse matrix whose entries are some of the steps."""

    starts: IntArray
    indices: IntArray
    #: Positions of the entries that are steps, and the flat index of each of these steps in (n, 8) arrays.
    places: IntArray
    taken: IntArray

    @staticmethod
    def of(indices: IntArray, taken: IntArray, counts: IntArray, *, diagonal: bool = False) -> "_Pattern":
        """From indices and positions of the steps in order, and their number in each row or column.

        A diagonal entry precedes the steps. SuperLU takes integers of 32 bits.
        """
        size = len(counts)
        starts = np.concatenate([[0], np.cumsum(counts + int(diagonal))])
        places = np.arange(len(indices)) + (np.repeat(np.arange(size), counts) + 1 if diagonal else 0)
        full = np.empty(starts[-1], dtype=np.int32)
        full[places] = indices
        if diagonal:
            full[starts[:-1]] = np.arange(size)
        return _Pattern(starts.astype(np.int32), full, places, taken)
