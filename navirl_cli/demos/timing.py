"""When a robot was in each cell of its path, and which steps it took while a person pushed it."""

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.demos.lines import divided
from navirl_cli.errors import DemonstrationError

#: Longest piece of the driven line, as a share of a cell.
PIECE = 1 / 16


def cell_times_s(xy_m: FloatArray, t_s: FloatArray, cells: IntArray, grid: Grid) -> FloatArray:
    """The times at which a driven line is nearest to the cells of its path.

    Among all times in order, those with the least sum of squared distances between the line and the cells' centres.
    This is each cell's own nearest point where these points are in order, as they are except at corners. Where the path
    crosses itself, each cell has the pass that fits its neighbours.

    Args:
        xy_m: (n, 2) m, map frame.
        t_s: (n,) s, increasing.
        cells: (k, 2) column and row along the line, by whatever rule.
        grid: Gives the cells.

    Returns:
        (k,) s, non-decreasing, from the first pose's time to the last pose's; accurate to about a sixteenth of a cell.

    Raises:
        DemonstrationError: Fewer than two poses with their times, or fewer than two cells.
    """
    if len(xy_m) < 2 or len(cells) < 2 or t_s.shape != xy_m.shape[:1]:
        raise DemonstrationError(
            f"times of cells need at least two poses, as many times, and two cells; "
            f"found {len(xy_m)}, {len(t_s)} and {len(cells)}"
        )
    line, times = divided(xy_m, t_s, PIECE * grid.resolution_m)
    centres = grid.centres_of(cells)
    # least[j, i]: of the first j + 1 cells when the last of them is at point i or before; the first is at the start.
    least = np.empty((len(cells), len(line)))
    least[0] = 0.0
    for j in range(1, len(cells)):
        away = ((line - centres[j]) ** 2).sum(axis=1)
        np.minimum.accumulate(away + least[j - 1], out=least[j])
    at = np.full(len(cells), len(line) - 1)
    for j in range(len(cells) - 2, 0, -1):
        # the first point that attains the least sum up to the next cell's
        at[j] = np.searchsorted(-least[j], -least[j, at[j + 1]])
    at[0] = 0
    found: FloatArray = times[at]
    return found


def steps_in_contact(demonstration: Demonstration) -> NDArray[np.bool_]:
    """Which steps of a demonstration's path were taken while the person pushed, at least for a part of the step.

    Returns:
        (k - 1,) one for each step between successive cells.

    Raises:
        DemonstrationError: Contact is unknown.
    """
    d = demonstration
    if d.contacts is None:
        raise DemonstrationError(
            f"demonstration {d.id}: contact is unknown, because it was extracted without a wrench; learn from all steps"
        )
    times = cell_times_s(d.xy_m, d.t_s, d.cells, d.grid)
    pushed = np.zeros(len(times) - 1, dtype=bool)
    for contact in d.contacts:
        pushed |= (times[1:] >= contact.start_s) & (times[:-1] <= contact.end_s)
    return pushed
