"""States for rewards of turns: the cell together with the move by which a path came there.

A move's reward may then depend on the move before it, and everything else (soft values, visits, derivatives) is
computed on these states exactly as on cells.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import OPPOSITE
from navirl_cli.irl.graph import NO_MOVE, Graph
from navirl_cli.irl.lattice import Lattice


@dataclass(frozen=True, eq=False)
class TurnGraph(Graph):
    """Cells of a lattice by incoming move, sorted by cell; the absorbing goal is one state."""

    base: Lattice
    #: (n,) cell of every state, ascending, and the move by which a path came there: NO_MOVE where it begins, and in the
    #: goal.
    cell: IntArray
    incoming: IntArray
    #: (cells, 9) number of the state by cell and incoming move; -1 where no path comes from there.
    index: IntArray
    neighbours: IntArray

    @staticmethod
    def of(lattice: Lattice, goal: int) -> "TurnGraph":
        """The states of paths into a cell of a lattice."""
        # A cell is entered by a move if the cell behind it is free. No move leaves the goal.
        there = np.concatenate([lattice.possible[:, OPPOSITE], np.ones((lattice.size, 1), dtype=bool)], axis=1)
        beside = lattice.possible[goal]
        there[lattice.neighbours[goal, beside], np.flatnonzero(beside)] = False
        there[goal, :NO_MOVE] = False
        cell, incoming = np.nonzero(there)
        index = np.full(there.shape, -1, dtype=np.int64)
        index[cell, incoming] = np.arange(len(cell))
        index[goal] = index[goal, NO_MOVE]
        after = lattice.neighbours[cell]
        neighbours = np.where(after >= 0, index[after, np.arange(8)], -1)
        return TurnGraph(lattice, cell, incoming, index, neighbours)

    @property
    def lattice(self) -> Lattice:
        """The cells."""
        return self.base

    def states_in(self, cells: IntArray, incoming: IntArray) -> IntArray:
        """Numbers of states by cell and incoming move, arrays of equal shape."""
        states: IntArray = self.index[cells, incoming]
        return states

    def cells_of(self, states: IntArray) -> IntArray:
        """The cells of states."""
        cells: IntArray = self.cell[states]
        return cells

    def on_states(self, values: FloatArray) -> FloatArray:
        """Values by cell and move, or by cell, incoming move and move, by state and move."""
        if values.ndim == 2:
            return values if len(values) == 1 else values[self.cell]
        full = np.broadcast_to(values, (len(values), NO_MOVE + 1, values.shape[2]))
        spread: FloatArray = full[self.cell if len(values) > 1 else 0, self.incoming]
        return spread

    def by_cell(self, values: FloatArray) -> FloatArray:
        """(cells, ...) sums over the incoming moves."""
        sums: FloatArray = np.add.reduceat(values, self._firsts, axis=0)
        return sums

    def where_paths_begin(self, values: FloatArray) -> FloatArray:
        """(cells, ...) the values without an incoming move."""
        return values[self.index[:, NO_MOVE]]

    @cached_property
    def _firsts(self) -> IntArray:
        """(cells,) number of the first state of each cell."""
        return np.searchsorted(self.cell, np.arange(self.lattice.size))
