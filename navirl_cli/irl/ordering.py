"""The states of a lattice in order of how far they are from a goal, and the pattern of the matrices in that order."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import OPPOSITE
from navirl_cli.irl.lattice import Lattice


@dataclass(frozen=True, eq=False)
class Ordering:
    """Ranks of states by a distance to the goal, of whatever kind; the goal has rank 0."""

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
        """How often the paths along a tree lead to a state that is farther from the goal, at most.

        Args:
            parent: (n,) next state on the path from every state, -1 for the goal.
        """
        following = np.where(parent >= 0, parent, np.arange(len(parent)))
        count = (self.rank[following] > self.rank).astype(np.int64)
        if not count.any():
            return 0
        while (following != self.goal).any():
            count = count + count[following]  # twice as far along the path every time
            following = following[following]
        return int(count.max())

    @cached_property
    def _patterns(self) -> tuple["_Pattern", "_Pattern"]:
        """Of I - L (the steps that lead down, and the diagonal) by columns, and of U (the others) by rows."""
        rank = np.arange(self.lattice.size)[:, None]
        above = self.neighbours > rank
        # Every step up has its reverse, a step down: what stands in a column are the reverses of the steps in its row.
        reverse = self.neighbours * 8 + OPPOSITE
        lower = _Pattern.of(self.neighbours[above], reverse[above], above.sum(axis=1), diagonal=True)
        return lower, _Pattern.of(self.neighbours[above], np.flatnonzero(above), above.sum(axis=1))

    def split(self, weight: FloatArray) -> tuple[Any, Any]:
        """A matrix M >= 0 of steps as I - L, triangular, and the rest U, with M = L + U.

        Args:
            weight: (n, 8) by rank; zero or anything where a move is not possible.

        Returns:
            csc_array I - L and csr_array U, rows and columns by rank.
        """
        from scipy.sparse import csc_array, csr_array

        lower, upper = self._patterns
        shape = (self.lattice.size, self.lattice.size)
        # On the diagonal stand ones.
        entries = np.ones(len(lower.indices))
        entries[lower.places] = -weight.ravel()[lower.taken]
        triangular = csc_array((entries, lower.indices, lower.starts), shape=shape)
        # Each entry is there once, in whatever order; the solver would sort them to find out.
        triangular.has_canonical_format = True
        return triangular, csr_array((weight.ravel()[upper.taken], upper.indices, upper.starts), shape=shape)


@dataclass(frozen=True, eq=False)
class _Pattern:
    """A compressed sparse matrix whose entries are some of the steps: where they stand, and which steps they are."""

    starts: IntArray
    indices: IntArray
    #: Which of the entries are steps, and the place of each of these in (n, 8) arrays, flat.
    places: IntArray
    taken: IntArray

    @staticmethod
    def of(indices: IntArray, taken: IntArray, counts: IntArray, *, diagonal: bool = False) -> "_Pattern":
        """From indices and places of the steps in order, and their number in each row or column.

        With a diagonal that stands before the steps. SuperLU takes integers of 32 bits.
        """
        size = len(counts)
        starts = np.concatenate([[0], np.cumsum(counts + int(diagonal))])
        places = np.arange(len(indices)) + (np.repeat(np.arange(size), counts) + 1 if diagonal else 0)
        full = np.empty(starts[-1], dtype=np.int32)
        full[places] = indices
        if diagonal:
            full[starts[:-1]] = np.arange(size)
        return _Pattern(starts.astype(np.int32), full, places, taken)
