"""Distances and connected parts on cells.

They stand in place of scipy.ndimage, whose import takes as long as a fit to a few demonstrations.
"""

import numpy as np
from numpy.typing import ArrayLike

from navirl_cli.arrays import BoolArray, FloatArray


def distances_to(marked: BoolArray) -> FloatArray:
    """Distance of every cell's centre to the nearest marked cell's centre, exact.

    The square is the least of f(c) + (x - c)^2 over columns c, with f the squared distance within the column. The
    nearest column never moves back as x moves on, so that it is sought between those of two cells around, halving the
    steps (A. Aggarwal et al., Geometric applications of a matrix-searching algorithm, Algorithmica 2, 1987).

    Args:
        marked: (rows, columns), some of them True.

    Returns:
        (rows, columns) distances in cells.
    """
    rows, columns = marked.shape
    row = np.arange(rows)[:, None]
    far = rows + columns
    above = np.maximum.accumulate(np.where(marked, row, -far), axis=0)
    below = np.minimum.accumulate(np.where(marked, row, rows + far)[::-1], axis=0)[::-1]
    within = np.minimum(row - above, below - row) ** 2
    squared = np.empty((rows, columns), dtype=np.int64)
    # By column plus one: the nearest column; those beyond the borders only bound the others.
    step = 1 << columns.bit_length()
    nearest = np.full((rows, 2 * step), columns - 1)
    nearest[:, 0] = 0
    while step := step // 2:
        here = np.arange(step, columns + 1, 2 * step)
        first, last = nearest[:, here - step].ravel(), nearest[:, here + step].ravel()
        count = last - first + 1
        starts = np.cumsum(count) - count
        column = np.arange(count.sum()) - np.repeat(starts - first, count)
        away = column - np.repeat(np.tile(here - 1, rows), count)
        found = within[np.repeat(np.repeat(np.arange(rows), len(here)), count), column] + away**2
        least, column = np.divmod(np.minimum.reduceat(found * columns + column, starts), columns)
        nearest[:, here], squared[:, here - 1] = column.reshape(rows, -1), least.reshape(rows, -1)
    distances: FloatArray = np.sqrt(squared)
    return distances


def connected_to(free: BoolArray, cell: ArrayLike) -> BoolArray:
    """Cells that eight-connected moves over free cells reach from one of them.

    Args:
        free: (rows, columns).
        cell: (2,) column and row of a free cell.

    Returns:
        (rows, columns), True for the cell and all that it is connected to.
    """
    # Runs of free cells along the rows: the first cell, and the first one after it. One more cell stands between rows.
    width = free.shape[1] + 1
    borders = np.diff(np.pad(free, ((0, 0), (1, 1))).astype(np.int8), axis=1).ravel()
    first, behind = np.flatnonzero(borders == 1), np.flatnonzero(borders == -1)
    # A run touches those of the next row that neither end before it begins nor begin after it ends, corners included.
    up, down = (
        zip(
            np.searchsorted(behind, first + to).tolist(),
            np.searchsorted(first, behind + to, "right").tolist(),
            strict=True,
        )
        for to in (-width, width)
    )
    touched = [(*range(*above), *range(*below)) for above, below in zip(up, down, strict=True)]
    column, row = np.asarray(cell)
    reached = {int(np.searchsorted(first, row * width + column, "right")) - 1}
    waiting = [*reached]
    while waiting:
        new = [run for run in touched[waiting.pop()] if run not in reached]
        reached.update(new)
        waiting += new
    runs = sorted(reached)
    steps = np.zeros(len(borders), dtype=np.int8)
    steps[first[runs]], steps[behind[runs]] = 1, -1
    inside: BoolArray = np.cumsum(steps.reshape(-1, width), axis=1)[:, :-1] > 0
    return inside
