"""From a driven path to cells, by the study's rule or by the cells that the line crosses.

The study's rule (it reproduces the published paths cell for cell): start in the first pose's cell; of the eight
neighbours, but never back into the cell before the present one, step to the one whose centre is nearest to the
remaining path; cut the remaining path at that nearest point; stop in the last pose's cell.

The grid-intersect rule is the chain code of H. Freeman, Computer processing of line-drawing images, ACM Computing
Surveys 6 (1974), 57-97, Sec. 2: where the line crosses a lattice line through the cells' centres, the centre nearest to
that point is taken.
"""

import heapq
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import MOVES, Grid
from navirl_cli.errors import DemonstrationError

#: Most steps per cell that the line passes; a rule that needs more has lost the path.
PATIENCE = 4


class Rule(StrEnum):
    """How a line becomes cells; on a straight line all rules agree except at corners."""

    #: From cell to cell, to the neighbour whose centre is nearest to the remaining line. Leaves loops out.
    STUDY = "study"
    #: The cells that the line crosses, without those that an 8-connected path does not need: those with the shortest
    #: stay are left out first. Cuts every corner.
    CROSSED = "crossed"
    #: The centres nearest to the line's crossings with the lines through centres (Freeman's chain code), never straight
    #: back. Keeps corners whose centre is near the line.
    CHAIN = "chain"


def rasterize(xy_m: FloatArray, grid: Grid, rule: Rule = Rule.STUDY) -> IntArray:
    """The 8-connected path of cells along a driven line.

    Args:
        xy_m: (n, 2) m, map frame, in the order in which they were driven.
        grid: Gives the cells; occupancy does not matter.
        rule: How.

    Returns:
        (k, 2) column and row, from the first pose's cell to the last pose's; no cell follows itself.

    Raises:
        DemonstrationError: The study's rule does not arrive in the last pose's cell.
    """
    line = (xy_m - np.asarray(grid.origin_m)) / grid.resolution_m
    line = line[np.concatenate([[True], (np.diff(line, axis=0) != 0).any(axis=1)])]
    ends = grid.cells_of(xy_m[[0, -1]])
    if len(line) < 2:
        return ends[:1]
    if rule is Rule.STUDY:
        return _nearest_first(line, ends, grid)
    if rule is Rule.CROSSED:
        return _thinned_path(_crossed_cells(line), ends[0], ends[1], corners=False)
    return _thinned_path(_grid_intersections(line), ends[0], ends[1], corners=True)


def _nearest_first(line: FloatArray, ends: IntArray, grid: Grid) -> IntArray:
    """The study's rule on an (n, 2) line in cells, n > 1.

    Source: the study's published paths (Kollmitz et al., IROS 2020); the rule as facts about them.
    """
    # with cell centres at integers, neighbours are integer offsets
    rest = _Rest(line - 0.5)
    here, last = ends
    path = [here]
    limit = PATIENCE * (int(np.abs(np.diff(line, axis=0)).sum()) + 8)
    before = None
    while (here != last).any():
        if len(path) > limit:
            x, y = grid.centres_of(here)
            raise DemonstrationError(
                f"the path could not be put on the grid: it circles near x {x:.2f} m, y {y:.2f} m; "
                "split the log into trials, or choose a coarser `resolution`"
            )
        options = here + MOVES
        if before is not None:
            options = options[(options != before).any(axis=1)]
        before, here = here, options[rest.cut_nearest(options)]
        path.append(here)
    return np.array(path)


#: Segments of a line are looked at in blocks of so many.
_BLOCK = 64


class _Rest:
    """The remaining part of a line, as segments of which the first is cut shorter and shorter.

    Only blocks of segments that can hold the nearest point are looked at, which their bounding boxes decide: the time
    for a path would else grow with the square of its length.
    """

    def __init__(self, line: FloatArray) -> None:
        #: By axis: where segments end, where they start, and how far they lead.
        self.end, self.start = line[1:].T, line[:-1].T.copy()
        self.along = self.end - self.start
        self.squared = (self.along**2).sum(axis=0)
        self.squared[self.squared == 0] = 1.0  # their start is their only point
        self.first = 0
        starts = np.arange(0, self.start.shape[1], _BLOCK)
        #: (2, blocks) corners of the boxes around the segments of each block; cut segments stay inside.
        self.low = np.minimum.reduceat(np.minimum(self.start, self.end), starts, axis=1)
        self.high = np.maximum.reduceat(np.maximum(self.start, self.end), starts, axis=1)

    def cut_nearest(self, options: IntArray) -> int:
        """Cut the line at its point nearest to any of the (k, 2) options; the number of that option."""
        block, count = self.first // _BLOCK, self.start.shape[1]
        stop = min((block + 1) * _BLOCK, count)
        left: slice | IntArray = slice(self.first, stop)
        squared, share = self._distances(options, left)
        if stop < count:
            (low_x, low_y), (high_x, high_y) = self.low[:, block + 1 :], self.high[:, block + 1 :]
            (x0, y0), (x1, y1) = options.min(axis=0), options.max(axis=0)
            # from the box around the options to that of each block
            dx, dy = np.maximum(low_x - x1, x0 - high_x), np.maximum(low_y - y1, y0 - high_y)
            away = np.maximum(dx, 0.0) ** 2 + np.maximum(dy, 0.0) ** 2
            near = np.flatnonzero(away <= squared.min()) + block + 1
            if near.size:
                others = (near[:, None] * _BLOCK + np.arange(_BLOCK)).ravel()
                left = np.concatenate([np.arange(self.first, stop), others[others < count]])
                squared, share = self._distances(options, left)
        option, place = divmod(int(squared.argmin()), squared.shape[1])
        k = self.first + place if isinstance(left, slice) else int(left[place])
        self.first = k
        self.start[:, k] += share[option, place] * self.along[:, k]
        self.along[:, k] = self.end[:, k] - self.start[:, k]
        self.squared[k] = (self.along[:, k] ** 2).sum() or 1.0
        return int(option)

    def _distances(self, options: IntArray, left: slice | IntArray) -> tuple[FloatArray, FloatArray]:
        """Squared distances of options to segments, (k, segments), and where on these the nearest points are, 0..1."""
        (sx, sy), (ax, ay) = self.start[:, left], self.along[:, left]
        # few operations on whole arrays: a path takes about sixty of these steps
        dx, dy = options[:, 0, None] - sx, options[:, 1, None] - sy
        share = (dx * ax + dy * ay) / self.squared[left]
        np.maximum(share, 0.0, out=share)
        np.minimum(share, 1.0, out=share)
        dx -= share * ax
        dy -= share * ay
        return dx * dx + dy * dy, share


@dataclass(frozen=True, eq=False)
class _Passage:
    """Cells in the order in which a line passes them."""

    #: (k, 2) column and row; neighbours or equal from one to the next.
    cells: IntArray
    #: (k,) weight of each cell: how strongly the line passes it.
    weight: FloatArray


def _crossed_cells(line: FloatArray) -> _Passage:
    """Every cell that a line crosses (supercover), weighted by the length of the line in it.

    Args:
        line: (n, 2) in cells: cell (c, r) reaches from c to c + 1 and from r to r + 1.
    """
    at = np.unique(np.concatenate([np.arange(len(line), dtype=float), *(_crossings(axis)[0] for axis in line.T)]))
    points = _points(line, at)
    # between two crossings the line is in one cell, safely found by the middle
    cells = np.floor((points[:-1] + points[1:]) / 2).astype(np.int64)
    return _Passage(cells, np.hypot(*np.diff(points, axis=0).T))


def _grid_intersections(line: FloatArray) -> _Passage:
    """Cells in which a line crosses an arm of the cross through the centre, as wide and high as the cell.

    The arms of all cells together are the lines of a square lattice, and those of one square belong to its four corner
    cells, so that successive cells are neighbours. A corner that is just touched is left out.

    Args:
        line: (n, 2) in cells, as in :func:`_crossed_cells`.
    """
    ats, found, weights = [], [], []
    for axis in (0, 1):
        at, level = _crossings(line[:, axis] - 0.5)
        other = _points(line, at)[:, 1 - axis]
        cells = np.empty((len(at), 2), dtype=np.int64)
        cells[:, axis], cells[:, 1 - axis] = level, np.floor(other)
        ats.append(at)
        found.append(cells)
        # the nearer to the centre, the larger
        weights.append(0.5 - np.abs(other - np.floor(other) - 0.5))
    order = np.argsort(np.concatenate(ats), kind="stable")
    return _Passage(np.concatenate(found)[order], np.concatenate(weights)[order])


def _thinned_path(passage: _Passage, first: IntArray, last: IntArray, *, corners: bool) -> IntArray:
    """The cells of a passage without those that an 8-connected path does not need.

    A cell that is entered and left straight back is removed: poses with noise cross borders of cells. So is a cell
    whose neighbours on the path are neighbours on the grid, which is a corner that can be cut, unless corners are kept
    and it has a weight. The cell with the least weight is removed first, until no more can be.

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
        # an entry from before the cell's surroundings changed is followed by a newer one
        if weight == chain.weight[i] < np.inf and chain.gap(i) <= (0 if corners and weight > 0 else 1):
            for j in chain.drop(i):
                heapq.heappush(queue, (chain.weight[j], j))
    return chain.path()


class _Chain:
    """A linked list of cells; removed cells and the ends have infinite weight, so that they are never removed."""

    def __init__(self, passage: _Passage, first: IntArray, last: IntArray) -> None:
        self.cells: list[list[int]] = np.concatenate([first[None], passage.cells, last[None]]).tolist()
        # rounded, so that on a diagonal line, where all weights are equal, every second cell is removed
        self.weight: list[float] = [np.inf, *np.round(passage.weight, 9).tolist(), np.inf]
        count = len(self.cells)
        self.before, self.after = list(range(-1, count - 1)), list(range(1, count + 1))
        for i in range(1, count):
            self._join(i)

    def gap(self, i: int) -> int:
        """Distance of the cells before and after an inner one, along rows or columns."""
        (x0, y0), (x1, y1) = self.cells[self.before[i]], self.cells[self.after[i]]
        return max(abs(x1 - x0), abs(y1 - y0))

    def drop(self, i: int) -> tuple[int, ...]:
        """Remove an inner cell; its neighbours, whose surroundings have changed."""
        one, other = self.before[i], self.after[i]
        self._unlink(i)
        if self._join(other):
            other = self.after[one]
        return (one, other) if other < len(self.cells) else (one,)

    def path(self) -> IntArray:
        """(k, 2) the remaining cells."""
        i, left = 0, []
        while i < len(self.cells):
            left.append(self.cells[i])
            i = self.after[i]
        return np.array(left, dtype=np.int64)

    def _join(self, i: int) -> bool:
        """Join a cell with an equal one before it."""
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
    """Where a piecewise linear function crosses integers.

    Args:
        values: (n,) at 0, 1, 2, ...

    Returns:
        (m,) places, and (m,) the integers.
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
