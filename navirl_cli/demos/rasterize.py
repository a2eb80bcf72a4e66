"""From a driven path to cells, by the study's rule or by what the line crosses.

The study's rule (it reproduces the published paths cell for cell): start in the first pose's cell; of the eight
neighbours, but never back into the cell before the present one, step to the one whose centre is nearest to the
remaining path; cut the remaining path at that nearest point; stop in the last pose's cell.
"""

from enum import StrEnum

import numpy as np

from navirl_cli.demos.crossings import crossed_cells, grid_intersections, thinned_path
from navirl_cli.demos.grid import MOVES, FloatArray, Grid, IntArray
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
    line = line - 0.5
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
        before, (here, line) = here, _nearest(options, line)
        path.append(here)
    return np.array(path)


def _nearest(options: IntArray, line: FloatArray) -> tuple[IntArray, FloatArray]:
    """The option nearest to the line, and the line from that nearest point on."""
    start, along = line[:-1], np.diff(line, axis=0)
    away = options[:, None, :] - start[None, :, :]
    squared = (along**2).sum(axis=1)
    with np.errstate(invalid="ignore"):
        share = np.clip((away * along).sum(axis=2) / squared, 0.0, 1.0)
    share = np.where(squared > 0, share, 0.0)
    distance = ((away - share[..., None] * along) ** 2).sum(axis=2)
    option, segment = np.unravel_index(int(np.argmin(distance)), distance.shape)
    cut = start[segment] + share[option, segment] * along[segment]
    return options[option], np.concatenate([cut[None], line[segment + 1 :]])
