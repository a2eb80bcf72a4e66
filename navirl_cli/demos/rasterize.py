"""From a driven path to cells, by the study's rule.

The rule (it reproduces the published paths cell for cell): start in the first pose's cell; of the eight neighbours,
but never back into the cell before the present one, step to the one whose centre is nearest to the remaining path; cut
the remaining path at that nearest point; stop in the last pose's cell.
"""

import numpy as np

from navirl_cli.demos.grid import MOVES, FloatArray, Grid, IntArray
from navirl_cli.errors import DemonstrationError

#: No path needs more steps than this many per cell that its line passes; a rule that still walks has lost the path.
PATIENCE = 4


def rasterize(xy_m: FloatArray, grid: Grid) -> IntArray:
    """The 8-connected path of cells along a driven line.

    Args:
        xy_m: (n, 2) m, map frame, in the order in which they were driven.
        grid: Gives the cells; what is occupied does not matter here.

    Returns:
        (k, 2) column and row, from the first pose's cell to the last pose's.

    Raises:
        DemonstrationError: The rule does not arrive in the last pose's cell.

    Source: the study's published paths (Kollmitz et al., IROS 2020); the rule as facts about them.
    """
    # In cells, with cell centres at integers, so that neighbours are integer offsets.
    line = (xy_m - np.asarray(grid.origin_m)) / grid.resolution_m - 0.5
    line = line[np.concatenate([[True], (np.diff(line, axis=0) != 0).any(axis=1)])]
    cells = grid.cells_of(xy_m[[0, -1]])
    here, last = cells[0], cells[1]
    path = [here]
    if len(line) < 2:
        return np.array(path)
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
