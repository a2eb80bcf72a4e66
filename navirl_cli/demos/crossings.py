"""From a driven path to cells by what its line crosses: whole cells, or the arms of a cross in each cell.

The grid-intersect rule is the chain code of H. Freeman, Computer processing of line-drawing images, ACM Computing
Surveys 6 (1974), 57-97, Sec. 2: where the line crosses a lattice line through the cells' centres, the centre nearest to
that point is taken.
"""

import heapq
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Passage:
    """Cells in the order in which a line passes them."""

    #: (k, 2) column and row; neighbours or equal from one to the next.
    cells: IntArray
    #: (k,) how much the line has to do with each.
    weight: FloatArray


def crossed_cells(line: FloatArray) -> Passage:
    """Every cell that a line crosses (supercover), weighted by the length of the line in it.

    Args:
        line: (n, 2) in cells: cell (c, r) reaches from c to c + 1 and from r to r + 1.
    """
    at = np.unique(np.concatenate([np.arange(len(line), dtype=float), *(_crossings(axis)[0] for axis in line.T)]))
    points = _points(line, at)
    # Between two crossings the line is in one cell, which its middle tells safely.
    cells = np.floor((points[:-1] + points[1:]) / 2).astype(np.int64)
    return Passage(cells, np.hypot(*np.diff(points, axis=0).T))


def grid_intersections(line: FloatArray) -> Passage:
    """Cells of whose cross through the centre, as wide and high as the cell, a line crosses an arm.

    The arms of all cells together are the lines of a square lattice, and those of one square belong to its four corner
    cells, so that successive cells are neighbours. A corner that is just touched is passed by.

    Args:
        line: (n, 2) in cells, as in :func:`crossed_cells`.
    """
    ats, found, weights = [], [], []
    for axis in (0, 1):
        at, level = _crossings(line[:, axis] - 0.5)
        other = _points(line, at)[:, 1 - axis]
        cells = np.empty((len(at), 2), dtype=np.int64)
        cells[:, axis], cells[:, 1 - axis] = level, np.floor(other)
        ats.append(at)
        found.append(cells)
        # The nearer to the centre, the more.
        weights.append(0.5 - np.abs(other - np.floor(other) - 0.5))
    order = np.argsort(np.concatenate(ats), kind="stable")
    return Passage(np.concatenate(found)[order], np.concatenate(weights)[order])


def thinned_path(passage: Passage, first: IntArray, last: IntArray, *, corners: bool) -> IntArray:
    """The cells of a passage without those that an 8-connected path does not need.

    A cell that is entered and left straight back is left out, for that is poses shaking over a border. So is a cell
    whose neighbours on the path are neighbours on the grid, a corner that can be cut, if corners are not to be kept or
    it has no weight. The cell with the least weight goes first, until none can.

    Args:
        passage: Cells and weights.
        first: (2,) column and row of the cell in which the path starts.
        last: (2,) column and row of the cell in which it ends.
        corners: Keep them.

    Returns:
        (k, 2) column and row.
    """
    chain = _Chain(passage, first, last)
    queue = [(weight, i) for i, weight in enumerate(chain.weight)]
    heapq.heapify(queue)
    while queue:
        weight, i = heapq.heappop(queue)
        # What was pushed before its surroundings changed was pushed again since.
        if weight == chain.weight[i] < np.inf and chain.gap(i) <= (0 if corners and weight > 0 else 1):
            for j in chain.drop(i):
                heapq.heappush(queue, (chain.weight[j], j))
    return chain.path()


class _Chain:
    """A linked list of cells; what left it weighs infinitely much, as its ends do, so that nothing drops it."""

    def __init__(self, passage: Passage, first: IntArray, last: IntArray) -> None:
        self.cells: list[list[int]] = np.concatenate([first[None], passage.cells, last[None]]).tolist()
        # Rounded, so that on a line along a diagonal, where all weigh the same, every second one goes.
        self.weight: list[float] = [np.inf, *np.round(passage.weight, 9).tolist(), np.inf]
        count = len(self.cells)
        self.before, self.after = list(range(-1, count - 1)), list(range(1, count + 1))
        for i in range(1, count):
            self._join(i)

    def gap(self, i: int) -> int:
        """How far apart the cells before and after an inner one are, along rows or columns."""
        (x0, y0), (x1, y1) = self.cells[self.before[i]], self.cells[self.after[i]]
        return max(abs(x1 - x0), abs(y1 - y0))

    def drop(self, i: int) -> tuple[int, ...]:
        """Leave an inner cell out; those next to it, for which something has changed."""
        one, other = self.before[i], self.after[i]
        self._unlink(i)
        if self._join(other):
            other = self.after[one]
        return (one, other) if other < len(self.cells) else (one,)

    def path(self) -> IntArray:
        """(k, 2) what is left."""
        i, left = 0, []
        while i < len(self.cells):
            left.append(self.cells[i])
            i = self.after[i]
        return np.array(left, dtype=np.int64)

    def _join(self, i: int) -> bool:
        """Make one of a cell and the same cell before it."""
        one = self.before[i]
        if self.cells[one] != self.cells[i]:
            return False
        self.weight[one] += self.weight[i]
        self._unlink(i)
        return True

    def _unlink(self, i: int) -> None:
        self.weight[i] = np.inf
        self.after[self.before[i]] = self.after[i]
        if self.after[i] < len(self.cells):
            self.before[self.after[i]] = self.before[i]


def _crossings(values: FloatArray) -> tuple[FloatArray, IntArray]:
    """Where a piecewise linear function crosses whole numbers.

    Args:
        values: (n,) at 0, 1, 2, ...

    Returns:
        (m,) places, and (m,) whole numbers.
    """
    start, end = values[:-1], values[1:]
    low, high = np.ceil(np.minimum(start, end)), np.floor(np.maximum(start, end))
    many = np.where(start == end, 0, np.maximum(high - low + 1, 0)).astype(np.int64)
    segment = np.repeat(np.arange(len(start)), many)
    level = low[segment] + (np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many))
    at = segment + np.clip((level - start[segment]) / (end - start)[segment], 0.0, 1.0)
    return at, level.astype(np.int64)


def _points(line: FloatArray, at: FloatArray) -> FloatArray:
    """(m, 2) points of a line at (m,) places counted in its segments."""
    segment = np.minimum(at.astype(np.int64), len(line) - 2)
    points: FloatArray = line[segment] + (at - segment)[:, None] * (line[segment + 1] - line[segment])
    return points
