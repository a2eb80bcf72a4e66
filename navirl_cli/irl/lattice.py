"""The free cells of a grid as a graph."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import MOVE_LENGTHS, MOVES, Grid
from navirl_cli.errors import SceneError
from navirl_cli.irl.graph import Graph
from navirl_cli.irl.ordering import Ordering


@dataclass(frozen=True, eq=False)
class Lattice(Graph):
    """The connected free cells of a grid, numbered, with their eight moves."""

    grid: Grid
    #: (n, 2) column and row of every state.
    cells: IntArray
    #: (rows, columns) number of the state, -1 where the cell is no state.
    index: IntArray
    #: (n, 8) the state that each move leads to, -1 where the move is not possible.
    neighbours: IntArray
    #: Orders of the cells by goal, for all scenes on it: thousands of scenes share few goals.
    _orderings: dict[int, Ordering] = field(default_factory=dict, init=False, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Cross process borders as the map: what is computed from it is larger, and is computed again."""
        return Lattice.around, (self.grid, self.cells[0])

    def ordering_to(self, goal: int) -> Ordering:
        """The states by the length of their shortest 8-connected path to a goal, m; always the same object."""
        if goal not in self._orderings:
            cheapest = np.broadcast_to(self.grid.resolution_m, self.size)
            self._orderings[goal] = Ordering(self, goal, self.costs_to(goal, self.step_m), cheapest)
        return self._orderings[goal]

    @staticmethod
    def around(grid: Grid, cell: IntArray) -> "Lattice":
        """All cells that can be reached from one.

        Args:
            grid: The map.
            cell: (2,) column and row of a free cell.

        Raises:
            SceneError: The cell is occupied or beyond the map.
        """
        if grid.is_occupied(cell):
            x, y = grid.centres_of(cell)
            raise SceneError(f"the cell at x {x:.2f} m, y {y:.2f} m is not free on the map, so no path can pass it")
        rows, columns = np.nonzero(grid.connected_to(cell))
        cells = np.stack([columns, rows], axis=1)
        index = np.full(grid.shape, -1, dtype=np.int64)
        index[rows, columns] = np.arange(len(cells))
        framed = np.pad(index, 1, constant_values=-1)
        neighbours = np.stack([framed[rows + 1 + dy, columns + 1 + dx] for dx, dy in MOVES], axis=1)
        return Lattice(grid, cells, index, neighbours)

    @property
    def lattice(self) -> "Lattice":
        """Itself: its states are the cells."""
        return self

    def states_in(self, cells: IntArray, incoming: IntArray) -> IntArray:  # noqa: ARG002
        """The cells, whatever the incoming moves."""
        return cells

    def cells_of(self, states: IntArray) -> IntArray:
        """The states: every cell is one state."""
        return states

    def on_states(self, values: FloatArray) -> FloatArray:
        """The values: every cell is one state."""
        return values

    def by_cell(self, values: FloatArray) -> FloatArray:
        """The values: every cell is one state."""
        return values

    def where_paths_begin(self, values: FloatArray) -> FloatArray:
        """The values: every cell is one state."""
        return values

    @cached_property
    def step_m(self) -> FloatArray:
        """(8,) length of every move, m."""
        return MOVE_LENGTHS * self.grid.resolution_m

    @cached_property
    def xy_m(self) -> FloatArray:
        """(n, 2) centre of every state, m, map frame."""
        return self.grid.centres_of(self.cells)

    @cached_property
    def edges(self) -> tuple[IntArray, IntArray, IntArray]:
        """Source, move and target of every possible step, each (m,), by source."""
        source, move = np.nonzero(self.possible)
        return source, move, self.neighbours[source, move]

    def states_of(self, cells: IntArray) -> IntArray:
        """Numbers of (k, 2) cells; -1 for cells that are occupied, unconnected or beyond the map."""
        inside = self.grid.contains(cells)
        states = np.full(len(cells), -1, dtype=np.int64)
        states[inside] = self.index[cells[inside, 1], cells[inside, 0]]
        return states

    def descend(self, start: int, goal: int, cost: FloatArray) -> IntArray:
        """States along one cheapest path, start and goal included.

        Args:
            start: A state.
            goal: A state.
            cost: Broadcastable to (n, 8), positive.

        Returns:
            (k,) states.
        """
        to_go = self.costs_to(goal, cost)
        full = np.where(self.possible, np.broadcast_to(cost, self.neighbours.shape), np.inf)
        path = [start]
        while path[-1] != goal:
            here = path[-1]
            best = int(np.argmin(full[here] + to_go[self.neighbours[here]]))
            path.append(int(self.neighbours[here, best]))
        return np.array(path)
