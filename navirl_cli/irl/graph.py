"""States with eight moves each, and the cheapest paths between them: cells of a map, or cells by incoming move."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IndexArray, IntArray

if TYPE_CHECKING:
    from navirl_cli.irl.lattice import Lattice

#: Places of steps in flat (n, 8) arrays, states that they leave, and where the steps to each state begin.
Steps: TypeAlias = tuple[IndexArray, IndexArray, IndexArray]
#: In place of the incoming move where a path begins.
NO_MOVE = 8


class Graph(ABC):
    """Numbered states, and where their moves lead."""

    #: (n, 8) the state that each move leads to, -1 where the move is not possible.
    neighbours: IntArray

    @property
    @abstractmethod
    def lattice(self) -> "Lattice":
        """The cells that the states belong to."""

    @abstractmethod
    def states_in(self, cells: IntArray, incoming: IntArray) -> IntArray:
        """Numbers of states, for arrays of equal shape.

        Args:
            cells: Numbers of cells in the lattice.
            incoming: The move by which a path came into the cell; NO_MOVE where it begins there.
        """

    @abstractmethod
    def cells_of(self, states: IntArray) -> IntArray:
        """The cells of states."""

    @abstractmethod
    def on_states(self, values: FloatArray) -> FloatArray:
        """A term's array (:class:`~navirl_cli.irl.terms.term.Jet`) as one that broadcasts to (n, 8)."""

    @abstractmethod
    def by_cell(self, values: FloatArray) -> FloatArray:
        """(cells, ...) sums of (n, ...) values over the states of each cell."""

    @abstractmethod
    def where_paths_begin(self, values: FloatArray) -> FloatArray:
        """(cells, ...) the (n, ...) values of the states of paths that begin in each cell."""

    @property
    def size(self) -> int:
        """Number of states n."""
        return len(self.neighbours)

    @cached_property
    def possible(self) -> NDArray[np.bool_]:
        """(n, 8) whether a move is possible."""
        return self.neighbours >= 0

    def beginning_in(self, cell: int) -> int:
        """The state of a path that begins in a cell."""
        return int(self.states_in(np.array([cell]), np.array([NO_MOVE]))[0])

    def along(self, cells: IntArray, moves: IntArray) -> IntArray:
        """(..., k) states along paths that begin with the first cell.

        Args:
            cells: (..., k) numbers of their cells in the lattice.
            moves: (..., k - 1) their moves; any number where a path stays in the goal.
        """
        first = np.full_like(cells[..., :1], NO_MOVE)
        return self.states_in(cells, np.concatenate([first, moves], axis=-1))

    def costs_to(self, goal: int, cost: FloatArray) -> FloatArray:
        """Cost of the cheapest path from every state to the goal (Dijkstra).

        Args:
            goal: A state.
            cost: Broadcastable to (n, 8), positive, of each possible move.

        Returns:
            (n,) costs.
        """
        from scipy.sparse.csgraph import dijkstra

        found: FloatArray = dijkstra(self._reversed_graph(cost), indices=goal)
        return found

    def cheapest_tree(self, goal: int, cost: FloatArray) -> tuple[FloatArray, IntArray]:
        """As :meth:`costs_to`, with the (n,) next state on each cheapest path, -1 for the goal."""
        from scipy.sparse.csgraph import dijkstra

        found, following = dijkstra(self._reversed_graph(cost), indices=goal, return_predecessors=True)
        return found, np.maximum(following, -1)

    @cached_property
    def _reversed(self) -> Steps:
        """The graph of reversed steps: a path to the goal is a path from the goal along reversed steps."""
        return steps_by_target(self.neighbours, self.possible)

    def _reversed_graph(self, cost: FloatArray) -> Any:
        from scipy.sparse import csr_array

        taken, sources, starts = self._reversed
        full = np.broadcast_to(cost, self.neighbours.shape).reshape(-1)
        return csr_array((full[taken], sources, starts), shape=(self.size, self.size))


def steps_by_target(neighbours: IntArray | IndexArray, chosen: NDArray[np.bool_]) -> Steps:
    """Some of the steps of a graph, sorted by the state that they lead to.

    Args:
        neighbours: (n, 8) the state that each move leads to.
        chosen: (n, 8) steps to take.

    Returns:
        (m,) places of the steps in flat (n, 8) arrays, (m,) the states that they leave, and (n + 1,) where the steps to
        each state begin; indices of 32 bits.
    """
    from scipy.sparse import csr_array

    taken = np.flatnonzero(chosen).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(chosen.sum(axis=1))]).astype(np.int32)
    targets = neighbours.ravel()[taken].astype(np.int32)
    turned = csr_array((taken, targets, starts), shape=(len(neighbours), len(neighbours))).tocsc()
    return turned.data, turned.indices, turned.indptr
