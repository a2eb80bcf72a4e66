"""From a driven path to cells, by the study's rule or by what the line crosses.

The study's rule (it reproduces the published paths cell for cell): start in the first pose's cell; of the eight
neighbours, but never back into the cell before the present one, step to the one whose centre is nearest to the
remaining path; cut the remaining path at that nearest point; stop in the last pose's cell.
"""

from enum import StrEnum

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.crossings import crossed_cells, grid_intersections, thinned_path
from navirl_cli.demos.grid import MOVES, Grid
from navirl_cli.errors import DemonstrationError

#: No path needs more steps than this many per cell that its line passes; a rule that still walks has lost the path.
PATIENCE = 4


class Rule(StrEnum):
    """How a line becomes cells; on a straight line all agree but for corners."""

    #: From cell to cell, to the neighbour whose centre is nearest to the rest of the line. Leaves loops out.
    STUDY = "study"
    #: Every cell that the line crosses, but those that an 8-connected path does not need, shortest stay first: it cuts
    #: every corner.
    CROSSED = "crossed"
    #: The centres nearest to the line's crossings with the lines through centres (Freeman's chain code), never straight
    #: back. Keeps corners that the line passes near their centre.
    CHAIN = "chain"


def rasterize(xy_m: FloatArray, grid: Grid, rule: Rule = Rule.STUDY) -> IntArray:
    """The 8-connected path of cells along a driven line.

    Args:
        xy_m: (n, 2) m, map frame, in the order in which they were driven.
        grid: Gives the cells; what is occupied does not matter here.
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
        return thinned_path(crossed_cells(line), ends[0], ends[1], corners=False)
    return thinned_path(grid_intersections(line), ends[0], ends[1], corners=True)


def _nearest_first(line: FloatArray, ends: IntArray, grid: Grid) -> IntArray:
    """The study's rule on an (n, 2) line in cells, n > 1.

    Source: the study's published paths (Kollmitz et al., IROS 2020); the rule as facts about them.
    """
    # With cell centres at integers, so that neighbours are integer offsets.
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
                "split the log into trials, or choose a coarser --resolution"
            )
        options = here + MOVES
        if before is not None:
            options = options[(options != before).any(axis=1)]
        before, here = here, options[rest.cut_nearest(options)]
        path.append(here)
    return np.array(path)


class _Rest:
    """What is left of a line, as segments of which the first is cut shorter and shorter."""

    def __init__(self, line: FloatArray) -> None:
        #: By axis: where segments end, where they start, and how far they lead.
        self.end, self.start = line[1:].T, line[:-1].T.copy()
        self.along = self.end - self.start
        self.squared = (self.along**2).sum(axis=0)
        self.squared[self.squared == 0] = 1.0  # their start is their only point
        self.first = 0

    def cut_nearest(self, options: IntArray) -> int:
        """Cut the line at its point nearest to any of the (k, 2) options, and tell which option that is."""
        left = slice(self.first, None)
        (sx, sy), (ax, ay) = self.start[:, left], self.along[:, left]
        # Few operations on whole arrays: a path takes some sixty of these steps.
        dx, dy = options[:, 0, None] - sx, options[:, 1, None] - sy
        share = (dx * ax + dy * ay) / self.squared[left]
        np.maximum(share, 0.0, out=share)
        np.minimum(share, 1.0, out=share)
        dx -= share * ax
        dy -= share * ay
        option, segment = divmod(int((dx * dx + dy * dy).argmin()), len(sx))
        self.first += segment
        k = self.first
        self.start[:, k] += share[option, segment] * self.along[:, k]
        self.along[:, k] = self.end[:, k] - self.start[:, k]
        self.squared[k] = (self.along[:, k] ** 2).sum() or 1.0
        return option
