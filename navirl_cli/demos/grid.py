"""Occupancy grids: where cells are, which are free, and how a robot's radius grows the obstacles."""

from dataclasses import dataclass
from hashlib import sha256
from math import ceil

import numpy as np
from numpy.typing import ArrayLike, NDArray

from navirl_cli.arrays import BoolArray, ByContent, FloatArray, IntArray
from navirl_cli.demos.cells import connected_to
from navirl_cli.errors import GridError

#: (8, 2) displacements (dx, dy) of the moves in cells, counter-clockwise from the x axis. All arrays "by move" have
#: this order.
MOVES: IntArray = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)], dtype=np.int64)
#: (8,) length of each move in cells.
MOVE_LENGTHS: FloatArray = np.hypot(MOVES[:, 0], MOVES[:, 1])
#: (8,) the move back.
OPPOSITE: IntArray = (np.arange(8) + 4) % 8
_APART = np.abs(np.subtract.outer(np.arange(8), np.arange(8)))
#: (8, 8) unsigned change of direction from one move (row) to the next (column), rad, 0 to pi.
TURN_RAD: FloatArray = np.minimum(_APART, 8 - _APART) * (np.pi / 4)
#: (3, 3) number of the move with the displacement (dx, dy) at [dx + 1, dy + 1]; -1 in the middle.
_NUMBER: IntArray = np.array([[5, 4, 3], [6, -1, 2], [7, 0, 1]], dtype=np.int64)

#: Finer cells mean nothing to a robot, coarser ones hold no paths, m.
MIN_RESOLUTION_M, MAX_RESOLUTION_M = 0.01, 2.0
#: Maps of more cells do not fit into memory with what is computed on them.
MOST_CELLS = 50_000_000
#: Cells on which distances are computed at once: they and what is computed on them stay in the processor's cache.
_BLOCK_CELLS = 1 << 16
#: map_server's default: an occupancy of 65 % and more is an obstacle.
OCCUPIED_FROM = 65
#: A costmap marks cells within the robot's inscribed radius 99 and obstacles themselves 100.
INSCRIBED, LETHAL = 99, 100
#: Share of the obstacles' cells that are ringed in an inflated costmap; cells seen just before may not be yet.
MOST = 0.9


@dataclass(frozen=True, eq=False)
class Grid(ByContent):
    """An occupancy grid whose rows run along y and whose columns run along x of the map frame."""

    #: True where the robot's centre cannot be. Shape (rows, columns): row 0 has the lowest y, column 0 the lowest x.
    occupied: BoolArray
    #: Side of a cell in m.
    resolution_m: float
    #: Lower left corner of cell (column 0, row 0), (x, y) in m, map frame.
    origin_m: tuple[float, float]

    def __post_init__(self) -> None:
        """Check shapes and units."""
        if self.occupied.ndim != 2 or self.occupied.dtype != np.bool_ or self.occupied.size == 0:
            raise GridError(
                f"a grid needs a two-dimensional array of bool, found {self.occupied.dtype} "
                f"of shape {self.occupied.shape}"
            )
        if not (np.isfinite(self.resolution_m) and self.resolution_m > 0):
            raise GridError(f"a grid's resolution must be a positive number of metres, found {self.resolution_m}")
        if not np.isfinite(self.origin_m).all():
            raise GridError(f"a grid's origin must be finite, found {self.origin_m}")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows (along y) and columns (along x)."""
        rows, columns = self.occupied.shape
        return rows, columns

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Borders in m, map frame: x_min, x_max, y_min, y_max (the order of matplotlib's ``extent``)."""
        rows, columns = self.shape
        x, y = self.origin_m
        return x, x + columns * self.resolution_m, y, y + rows * self.resolution_m

    @property
    def digest(self) -> str:
        """SHA-256 of geometry and cells: equal grids have equal digests."""
        x, y = self.origin_m  # plain floats, for numpy prints its own otherwise
        head = repr((self.shape, float(self.resolution_m), (float(x), float(y)))).encode()
        return sha256(head + np.packbits(self.occupied).tobytes()).hexdigest()

    def cells_of(self, xy_m: ArrayLike) -> IntArray:
        """Cells that hold points of the map frame, inside the grid or not.

        Args:
            xy_m: (..., 2) m.

        Returns:
            (..., 2) column and row.
        """
        return np.floor((np.asarray(xy_m, dtype=float) - self.origin_m) / self.resolution_m).astype(np.int64)

    def centres_of(self, cells: ArrayLike) -> FloatArray:
        """Centres in m, map frame, of (..., 2) cells (column, row)."""
        centres: FloatArray = (np.asarray(cells) + 0.5) * self.resolution_m + np.asarray(self.origin_m)
        return centres

    def contains(self, cells: ArrayLike) -> BoolArray:
        """Whether (..., 2) cells lie on the grid."""
        cells = np.asarray(cells)
        rows, columns = self.shape
        inside: BoolArray = np.all((cells >= 0) & (cells < (columns, rows)), axis=-1)
        return inside

    def is_occupied(self, cells: ArrayLike) -> BoolArray:
        """Whether (..., 2) cells are occupied; cells beyond the grid are."""
        cells = np.asarray(cells)
        inside = self.contains(cells)
        blocked = np.ones(inside.shape, dtype=bool)
        blocked[inside] = self.occupied[cells[inside][..., 1], cells[inside][..., 0]]
        return blocked

    def connected_to(self, cell: ArrayLike) -> BoolArray:
        """(rows, columns) cells that eight-connected moves over free cells reach from a (2,) free cell on the grid."""
        return connected_to(~self.occupied, cell)

    def freed(self, cells: IntArray) -> "Grid":
        """The same grid with (n, 2) cells free.

        Raises:
            GridError: A cell lies beyond the grid.
        """
        outside = ~self.contains(cells)
        if outside.any():
            x, y = self.centres_of(cells[outside][0])
            raise GridError(
                f"{int(outside.sum())} cells of the path lie beyond the map, the first at x {x:.2f} m, y {y:.2f} m; "
                f"the map spans x {self.extent_m[0]:.2f} to {self.extent_m[1]:.2f} m, "
                f"y {self.extent_m[2]:.2f} to {self.extent_m[3]:.2f} m; give the map in which the robot drove"
            )
        occupied = self.occupied.copy()
        occupied[cells[:, 1], cells[:, 0]] = False
        return Grid(occupied, self.resolution_m, self.origin_m)

    def inflated(self, radius_m: float, around_m: ArrayLike | None = None) -> "Grid":
        """Obstacles grown by a radius, so that a robot of that radius is a point.

        Args:
            radius_m: Cells whose centre is nearer than this to an occupied cell's centre become occupied.
            around_m: (p, 2) m, map frame: grow these points, such as people, in place of the obstacles' centres.

        Returns:
            A new grid; obstacles remain.
        """
        if radius_m <= 0:
            return self
        if around_m is not None:
            rows, columns = np.indices(self.shape)
            centres = self.centres_of(np.stack([columns, rows], axis=2))
            near = np.zeros(self.shape, dtype=bool)
            for point in np.reshape(np.asarray(around_m, dtype=float), (-1, 2)):
                near |= np.hypot(*np.moveaxis(centres - point, 2, 0)) < radius_m
            return Grid(self.occupied | near, self.resolution_m, self.origin_m)
        if not self.occupied.any():
            return self
        return Grid(_grown(self.occupied, self.resolution_m, radius_m), self.resolution_m, self.origin_m)

    def resampled(self, resolution_m: float) -> "Grid":
        """The same area on cells of another size: a cell is occupied when it touches an occupied one."""
        if resolution_m == self.resolution_m:
            return self
        if not MIN_RESOLUTION_M <= resolution_m <= MAX_RESOLUTION_M:
            raise GridError(
                f"cells must have sides of {MIN_RESOLUTION_M} to {MAX_RESOLUTION_M} m, found {resolution_m} m"
            )
        rows, columns = (max(1, ceil(n * self.resolution_m / resolution_m - 1e-9)) for n in self.shape)
        if rows * columns > MOST_CELLS:
            raise GridError(
                f"a map of {self.shape[1]} x {self.shape[0]} cells of {self.resolution_m:g} m: expected at most "
                f"{MOST_CELLS} cells of {resolution_m:g} m, found {columns} x {rows}; check the map, or choose a "
                "larger `resolution`"
            )
        occupied = np.zeros((rows, columns), dtype=bool)
        taken = np.argwhere(self.occupied)
        ratio = self.resolution_m / resolution_m
        low = np.floor(taken * ratio + 1e-9).astype(np.int64)
        high = np.ceil((taken + 1) * ratio - 1e-9).astype(np.int64)
        span = int((high - low).max()) if len(taken) else 0
        for i in range(span):
            for j in range(span):
                row, column = np.minimum(low[:, 0] + i, high[:, 0] - 1), np.minimum(low[:, 1] + j, high[:, 1] - 1)
                occupied[np.minimum(row, rows - 1), np.minimum(column, columns - 1)] = True
        return Grid(occupied, resolution_m, self.origin_m)


def _grown(occupied: BoolArray, resolution_m: float, radius_m: float) -> BoolArray:
    """(rows, columns) cells nearer than a radius to an occupied one, centre to centre.

    The distance along the row to the next occupied cell decides for every row within the radius. This is faster than a
    distance transform over a map as long as the radius spans few cells, and needs no import of scipy.ndimage.
    """
    rows, columns = occupied.shape
    reach = np.arange(ceil(radius_m / resolution_m) + 1)
    away = np.empty(occupied.shape, dtype=np.int32)
    here = np.arange(columns, dtype=np.int32)
    block = max(1, _BLOCK_CELLS // max(columns, 1))
    for begin in range(0, rows, block):
        part = occupied[begin : begin + block]
        left = np.maximum.accumulate(np.where(part, here, np.int32(-columns)), axis=1)
        right = np.minimum.accumulate(np.where(part, here, np.int32(2 * columns))[:, ::-1], axis=1)[:, ::-1]
        np.minimum(here - left, right - here, out=away[begin : begin + block])
    grown = occupied.copy()
    for apart in reach[: min(len(reach), rows)].tolist():
        width = np.count_nonzero(np.sqrt(reach**2 + apart**2) * resolution_m < radius_m)
        near = away < min(width, columns)
        grown[apart:] |= near[: rows - apart]
        grown[: rows - apart] |= near[apart:]
    return grown


def moves_along(cells: IntArray) -> IntArray:
    """Numbers of the moves along paths of neighbouring cells.

    Args:
        cells: (..., k, 2) column and row.

    Returns:
        (..., k - 1) rows of MOVES; -1 where a path stays in its cell.
    """
    dx, dy = np.moveaxis(np.diff(cells, axis=-2), -1, 0)
    moves: IntArray = _NUMBER[dx + 1, dy + 1]
    return moves


def is_costmap(data: NDArray[np.int8]) -> bool:
    """Whether occupancy is that of an inflated costmap.

    Such a map rings every obstacle (100) with cells within the robot's inscribed radius (99). A map of probabilities
    may hold a 99 here and there, but not around its obstacles.

    Args:
        data: (rows, columns), -1 unknown, 0..100.
    """
    if not (data == INSCRIBED).any():
        return False
    framed = np.pad(data, 1, constant_values=INSCRIBED)
    rows, columns = np.nonzero(data == LETHAL)
    around = np.stack([framed[rows + 1 + dy, columns + 1 + dx] for dx, dy in MOVES])
    return bool(((around >= INSCRIBED) | (around < 0)).all(axis=0).mean() > MOST) if len(rows) else True


def grid_from_occupancy(
    data: NDArray[np.int8], resolution_m: float, origin_m: tuple[float, float], robot_radius_m: float
) -> Grid:
    """Turn ROS occupancy into a grid for the robot's centre.

    An inflated costmap's lethal cells are taken as they are. A plain map's obstacles are grown by the robot's radius.
    Unknown cells (-1) count as occupied.

    Args:
        data: (rows, columns), -1 unknown, 0..100 per cent, as nav_msgs/OccupancyGrid.
        resolution_m: Side of a cell, m.
        origin_m: Lower left corner, m, map frame.
        robot_radius_m: Radius of the robot, m.

    Returns:
        The grid.
    """
    unknown = data < 0
    if is_costmap(data):
        return Grid((data >= INSCRIBED) | unknown, resolution_m, origin_m)
    obstacles = Grid(data >= OCCUPIED_FROM, resolution_m, origin_m).inflated(robot_radius_m)
    return Grid(obstacles.occupied | unknown, resolution_m, origin_m)
