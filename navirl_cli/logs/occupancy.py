"""Maps, and the maps of a recording over time: whole ones, and updates of parts of them.

The cells of the maps over time are kept compressed. A mapping robot sends a whole map every second or so, of which a
trial needs one. Equal maps are kept once.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, IntArray


@dataclass(frozen=True, eq=False)
class Occupancy(ByContent):
    """A map as nav_msgs/OccupancyGrid holds it."""

    #: (rows, columns) -1 unknown, 0..100 per cent; row 0 has the lowest y.
    data: NDArray[np.int8]
    resolution_m: float
    #: Lower left corner, (x, y) m, fixed frame.
    origin_m: tuple[float, float]


@dataclass(frozen=True)
class Sheet:
    """A whole map, or an update of a part of the one before."""

    #: Cells row by row as int8, compressed by zlib.
    packed: bytes
    #: Rows and columns.
    shape: tuple[int, int]
    #: Of a whole map; None for an update.
    resolution_m: float | None
    origin_m: tuple[float, float] = (0.0, 0.0)
    #: Of an update: the first row and column that it replaces.
    corner: tuple[int, int] = (0, 0)

    @property
    def cells(self) -> NDArray[np.int8]:
        """(rows, columns) -1 unknown, 0..100."""
        return np.frombuffer(zlib.decompress(self.packed), dtype=np.int8).reshape(self.shape)


@dataclass(frozen=True, eq=False)
class MapHistory(ByContent):
    """All maps of a recording, in the order in which they were sent."""

    #: (k,) ns, when each begins to count; the first one counts from the beginning.
    since_ns: IntArray
    sheets: tuple[Sheet, ...]

    def number_at(self, t_ns: int) -> int:
        """Which sheet was sent last at a time."""
        sent = np.flatnonzero(self.since_ns <= t_ns)
        return int(sent[-1]) if sent.size else 0

    def changes(self, since_ns: int, until_ns: int) -> int:
        """How many sheets begin to count between two times."""
        return int(((self.since_ns > since_ns) & (self.since_ns <= until_ns))[1:].sum())

    def occupancy(self, number: int) -> Occupancy:
        """The map after a sheet: the last whole one with the updates since."""
        base = max(row for row in range(number + 1) if self.sheets[row].resolution_m is not None)
        whole = self.sheets[base]
        cells = whole.cells.copy()
        for update in self.sheets[base + 1 : number + 1]:
            row, column = update.corner
            cells[row : row + update.shape[0], column : column + update.shape[1]] = update.cells
        return Occupancy(cells, whole.resolution_m or 0.0, whole.origin_m)

    def shifted(self, by_m: Sequence[float]) -> "MapHistory":
        """The same maps, moved by (x, y) m."""
        x, y = by_m
        if not (x or y):
            return self
        moved = [replace(one, origin_m=(one.origin_m[0] + x, one.origin_m[1] + y)) for one in self.sheets]
        return replace(self, sheets=tuple(moved))
