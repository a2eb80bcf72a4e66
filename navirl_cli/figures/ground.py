"""What figures of a map share: the part of it that is shown, obstacles, axes in metres, legend below."""

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.font_manager import FontProperties
from matplotlib.image import AxesImage
from matplotlib.textpath import text_to_path

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.evaluation.compare import PERSON_RADIUS_M
from navirl_cli.figures.style import look, panel_width_in

#: Borders of what is shown: x_min, x_max, y_min, y_max, m, map frame.
Window = tuple[float, float, float, float]

#: Around the paths this much of the map is shown, m; of a map that is cropped to them, this much.
MARGIN_M, CROPPED_M = 1.5, 0.5
#: Between a person's outline and the border of a cropped map, m.
_CLEAR_M = 0.1
#: A map that is larger than the paths' surroundings by less than this factor of area is shown whole.
CROP_FROM = 2.0
#: Width of a legend's handle with the space around it, and of what a legend adds around its columns, inches.
_HANDLE_IN, _AROUND_IN = 0.265, 0.04
#: Share of a panel's width that a legend may fill without pushing the map aside.
_LEGEND_SHARE = 0.92
#: Space that ticks and label take below the axes, in sizes of the legend's font.
_BELOW = 4.0


def window_around(grids: Sequence[Grid], points_m: FloatArray, margin_m: float = MARGIN_M) -> Window:
    """The part of the map that is worth its paper: all of it, or the surroundings of the paths in a much larger one.

    Args:
        grids: One or several maps in one frame.
        points_m: (n, 2) m, map frame, what must be seen as far as it is on the maps: where a point lies beyond them,
            the window ends with them.
        margin_m: Around the points' bounding box, m.

    Returns:
        Borders in m, within the maps'.
    """
    whole, near = _borders(grids), _surroundings(grids, points_m, margin_m)
    return near if _area(whole) >= CROP_FROM * _area(near) else whole


def cropped_to(grids: Sequence[Grid], paths_m: FloatArray, people_m: FloatArray) -> Window:
    """The part of the map in which paths lie, however small the rest, with the people whom they come near.

    Args:
        grids: One or several maps in one frame.
        paths_m: (n, 2) points of paths, m, map frame; as far as they are on the maps.
        people_m: (p, 2) m, map frame: who stands within MARGIN_M of the paths' bounding box is seen whole.

    Returns:
        Borders in m, within the maps', CROPPED_M around the paths.
    """
    low, high = paths_m.min(axis=0) - MARGIN_M, paths_m.max(axis=0) + MARGIN_M
    near = people_m[((people_m >= low) & (people_m <= high)).all(axis=1)]
    reach = PERSON_RADIUS_M + _CLEAR_M
    edges = (paths_m - CROPPED_M, paths_m + CROPPED_M, near - reach, near + reach)
    return _surroundings(grids, np.concatenate(edges), 0.0)


def inside(window: Window, points_m: FloatArray, beyond_m: float = 0.0) -> BoolArray:
    """(n,) whether (n, 2) points, m, map frame, lie in a window, or at most so far beyond it."""
    (x, y), (x0, x1, y0, y1) = points_m.T, window
    within: BoolArray = (x > x0 - beyond_m) & (x < x1 + beyond_m) & (y > y0 - beyond_m) & (y < y1 + beyond_m)
    return within


def _borders(grids: Sequence[Grid]) -> Window:
    """Borders of all maps together."""
    x0, x1, y0, y1 = np.array([grid.extent_m for grid in grids]).T
    return float(x0.min()), float(x1.max()), float(y0.min()), float(y1.max())


def _surroundings(grids: Sequence[Grid], points_m: FloatArray, margin_m: float) -> Window:
    """Borders of points with a margin around them, within the maps'."""
    whole = _borders(grids)
    first, last = np.array(whole[::2]), np.array(whole[1::2])
    seen = np.clip(points_m, first, last)
    low, high = np.maximum(seen.min(axis=0) - margin_m, first), np.minimum(seen.max(axis=0) + margin_m, last)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _area(window: Window) -> float:
    """Of a window, m^2."""
    return (window[1] - window[0]) * (window[3] - window[2])


def frame(axes: Axes, window: Window, title: str = "") -> None:
    """Show a window of the map frame in metres, x and y to the same scale."""
    axes.set_xlim(window[0], window[1])
    axes.set_ylim(window[2], window[3])
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    if title:
        axes.set_title(title)


def draw_obstacles(axes: Axes, grid: Grid) -> AxesImage:
    """Draw occupied cells in light grey, free ones not at all.

    The grid is that of the robot's centre, so that obstacles look grown by its radius.
    """
    shown = np.ma.masked_where(~grid.occupied, grid.occupied)
    return axes.imshow(
        shown,
        cmap=ListedColormap([look().obstacle]),
        extent=grid.extent_m,
        origin="lower",
        interpolation="nearest",
        rasterized=True,
        zorder=1,
    )


def legend_below(axes: Axes, handles: Sequence[Artist]) -> None:
    """Put a legend below the axes' label, in as many columns as fit the panel's width."""
    labels = [str(handle.get_label()) for handle in handles]
    room_in = _LEGEND_SHARE * panel_width_in(axes)
    fitting = (n for n in range(len(labels), 1, -1) if _legend_width_in(labels, n) <= room_in)
    rows = ceil(len(labels) / next(fitting, 1))
    columns = ceil(len(labels) / rows)
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=_BELOW, ncols=columns)


def _legend_width_in(labels: Sequence[str], columns: int) -> float:
    """How wide a legend in columns is, inches; as in matplotlib the first columns have an entry more."""
    font = FontProperties(size=rcParams["legend.fontsize"])
    points = [text_to_path.get_text_width_height_descent(label, font, ismath=False)[0] for label in labels]
    split = np.array_split(np.array(points) / 72, columns)
    return _AROUND_IN + sum(_HANDLE_IN + float(column.max()) for column in split)
