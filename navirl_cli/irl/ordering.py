"""The states of a graph in order of their distance to a goal, and the pattern of the matrices in that order."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray, IndexArray, IntArray
from navirl_cli.irl.graph import Graph, steps_by_target


@dataclass(frozen=True, eq=False)
class Ordering:
    """Ranks of states by any distance to the goal; the goal has rank 0."""

    graph: Graph
    #: Number of the goal's state.
    goal: int
    #: (n,) distance to the goal by state: zero there, positive elsewhere; and that of the cheapest step out of each.
    distance: FloatArray
    step: FloatArray

    @cached_property
    def order(self) -> IndexArray:
        """(n,) state at every rank."""
        return np.argsort(self.distance, kind="stable").astype(np.int32)

    @cached_property
    def rank(self) -> IndexArray:
        """(n,) rank of every state."""
        rank = np.empty_like(self.order)
        rank[self.order] = np.arange(self.graph.size)
        return rank

    @cached_property
    def neighbours(self) -> IndexArray:
        """(n, 8) rank that each move leads to from every rank, -1 where the move is not possible."""
        neighbours = self.graph.neighbours[self.order]
        return np.where(neighbours >= 0, self.rank[neighbours], np.int32(-1))

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
        rank = np.arange(self.graph.size)[:, None]
        above = self.neighbours > rank
        down = steps_by_target(self.neighbours, ~above & (self.neighbours >= 0))
        lower = _Pattern.with_diagonal(*down)
        starts = np.concatenate([[0], np.cumsum(above.sum(axis=1))]).astype(np.int32)
        up = np.flatnonzero(above).astype(np.int32)
        return lower, _Pattern(starts, self.neighbours.ravel()[up], up)

    def split(self, weight: FloatArray) -> tuple[Any, Any]:
        """A matrix M >= 0 of steps as I - L, triangular, and the rest U, with M = L + U.

        Args:
            weight: (n, 8) by rank; any value where a move is not possible.

        Returns:
            csc_array I - L and csr_array U, rows and columns by rank.
        """
        from scipy.sparse import csc_array, csr_array

        lower, upper = self._patterns
        shape = (self.graph.size, self.graph.size)
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

    starts: IndexArray
    indices: IndexArray
    #: The flat index in (n, 8) arrays of each step that is an entry, and the positions of these entries; None for all.
    taken: IndexArray
    places: IndexArray | None = None

    @staticmethod
    def with_diagonal(taken: IndexArray, rows: IndexArray, starts: IndexArray) -> "_Pattern":
        """Of steps by column, as :func:`navirl_cli.irl.graph.steps_by_target` gives them.

        A diagonal entry precedes the steps. SuperLU takes integers of 32 bits.
        """
        size = len(starts) - 1
        places = (np.arange(len(rows)) + np.repeat(np.arange(1, size + 1), np.diff(starts))).astype(np.int32)
        diagonal = (starts + np.arange(size + 1)).astype(np.int32)
        full = np.empty(diagonal[-1], dtype=np.int32)
        full[places] = rows
        full[diagonal[:-1]] = np.arange(size)
        return _Pattern(diagonal, full, taken, places)
