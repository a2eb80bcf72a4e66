"""Basics of figures of a map: limits of the view, obstacles, axes in metres, legend below."""

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.font_manager import FontProperties
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.textpath import text_to_path

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.figures.style import look, panel_width_in

#: Limits of the view: x_min, x_max, y_min, y_max, m, map frame.
Window = tuple[float, float, float, float]

#: Margin around the paths, and around those of a cropped map, m.
MARGIN_M, CROPPED_M = 1.5, 0.5
#: Least distance between a person's outline and the border of a cropped map, m: a robot has room on either side.
_CLEAR_M = 0.75
#: The complete map is shown if its area is less than this times that of the paths' surroundings.
CROP_FROM = 2.0
#: Width of a legend's handle with the space around it, and of the border around a legend, inches.
_HANDLE_IN, _AROUND_IN = 0.265, 0.04
#: Largest share of a panel's width for a legend that does not shrink the map.
_LEGEND_SHARE = 0.92
#: Height of ticks and label below the axes, in sizes of the legend's font.
_BELOW = 4.0


def window_around(grids: Sequence[Grid], points_m: FloatArray, margin_m: float = MARGIN_M) -> Window:
    """Limits of the view of a map: all of it, or the surroundings of the paths on a much larger map.

    Args:
        grids: One or several maps in one frame.
        points_m: (n, 2) m, map frame, points that must be visible. The view ends at the maps' borders, also where
            points are outside of them.
        margin_m: Around the points' bounding box, m.

    Returns:
        Limits, m, within the maps.
    """
    complete, near = _borders(grids), _surroundings(grids, points_m, margin_m)
    return near if _area(complete) >= CROP_FROM * _area(near) else complete


def cropped_to(grids: Sequence[Grid], paths_m: FloatArray, people_m: FloatArray) -> Window:
    """Limits of the view of a cropped map: the paths, and people near them.

    Args:
        grids: One or several maps in one frame.
        paths_m: (n, 2) points of paths, m, map frame.
        people_m: (p, 2) m, map frame. Those within MARGIN_M of the paths' bounding box are completely visible.

    Returns:
        Limits, m, CROPPED_M around the paths and within the maps.
    """
    low, high = paths_m.min(axis=0) - MARGIN_M, paths_m.max(axis=0) + MARGIN_M
    near = people_m[((people_m >= low) & (people_m <= high)).all(axis=1)]
    reach = PERSON_RADIUS_M + _CLEAR_M
    edges = (paths_m - CROPPED_M, paths_m + CROPPED_M, near - reach, near + reach)
    return _surroundings(grids, np.concatenate(edges), 0.0)


def inside(window: Window, points_m: FloatArray, beyond_m: float = 0.0) -> BoolArray:
    """(n,) whether (n, 2) points, m, map frame, are within a window, or at most so far outside of it."""
    (x, y), (x0, x1, y0, y1) = points_m.T, window
    within: BoolArray = (x > x0 - beyond_m) & (x < x1 + beyond_m) & (y > y0 - beyond_m) & (y < y1 + beyond_m)
    return within


def _borders(grids: Sequence[Grid]) -> Window:
    """Limits of all maps together."""
    x0, x1, y0, y1 = np.array([grid.extent_m for grid in grids]).T
    return float(x0.min()), float(x1.max()), float(y0.min()), float(y1.max())


def _surroundings(grids: Sequence[Grid], points_m: FloatArray, margin_m: float) -> Window:
    """Limits around points with a margin, within the maps."""
    borders = _borders(grids)
    first, last = np.array(borders[::2]), np.array(borders[1::2])
    seen = np.clip(points_m, first, last)
    low, high = np.maximum(seen.min(axis=0) - margin_m, first), np.minimum(seen.max(axis=0) + margin_m, last)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def _area(window: Window) -> float:
    """Area of a window, m²."""
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
    """Draw occupied cells in light grey.

    The grid is that of the robot's centre: obstacles are inflated by the robot's radius.
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


def legend_below(axes: Axes, *sections: Sequence[Artist]) -> None:
    """Put a legend below the axes' label, in as many columns as fit into the panel's width.

    Args:
        axes: Those of the map.
        sections: The entries. Where the columns of all together do not fit, two sections are side by side if they do.
    """
    handles = [handle for section in sections for handle in section]
    labels = [str(handle.get_label()) for handle in handles]
    room_in = _LEGEND_SHARE * panel_width_in(axes)
    fitting = (n for n in range(len(labels), 1, -1) if _legend_width_in(labels, n) <= room_in)
    rows = ceil(len(labels) / next(fitting, 1))
    columns = ceil(len(labels) / rows)
    if columns == 1 and len(sections) == 2:
        padded = _side_by_side(*sections)
        if _legend_width_in([str(handle.get_label()) for handle in padded], 2) <= panel_width_in(axes):
            handles, columns = padded, 2
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=_BELOW, ncols=columns)


def _side_by_side(left: Sequence[Artist], right: Sequence[Artist]) -> list[Artist]:
    """Two columns of equal length: the shorter one has empty entries at its end."""
    rows = max(len(left), len(right))
    empty = [Line2D([], [], linestyle="none", label=" ") for _ in range(2 * rows)]
    return [*left, *empty[len(left) : rows], *right, *empty[rows + len(right) :]]


def _legend_width_in(labels: Sequence[str], columns: int) -> float:
    """Width of a legend in columns, inches; as in matplotlib, the first columns have one entry more."""
    font = FontProperties(size=rcParams["legend.fontsize"])
    points = [text_to_path.get_text_width_height_descent(label, font, ismath=False)[0] for label in labels]
    split = np.array_split(np.array(points) / 72, columns)
    return _AROUND_IN + sum(_HANDLE_IN + float(column.max()) for column in split)
