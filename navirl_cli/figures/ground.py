"""What figures of a map share: obstacles, people, start and goal to scale, axes in metres, legend below."""

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.font_manager import FontProperties
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke
from matplotlib.textpath import text_to_path

from navirl_cli.demos.grid import FloatArray, Grid
from navirl_cli.evaluation.compare import PERSON_RADIUS_M
from navirl_cli.figures.style import INK, OBSTACLE_COLOUR, PERSON_COLOUR, panel_width_in

#: Borders of what is shown: x_min, x_max, y_min, y_max, m, map frame.
Window = tuple[float, float, float, float]

#: Around the paths this much of the map is shown, m.
MARGIN_M = 1.5
#: A map that is larger than the paths' surroundings by less than this factor of area is shown whole.
CROP_FROM = 2.0
#: Width of a legend's handle with the space around it, and of what a legend adds around its columns, inches.
_HANDLE_IN, _AROUND_IN = 0.265, 0.04
#: Share of a panel's width that a legend may fill without pushing the map aside.
_LEGEND_SHARE = 0.92
#: Space that ticks and label take below the axes, in sizes of the legend's font.
_BELOW = 4.0

#: Looks of markers and lines, on the map and in the legend.
_START: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 3.5,
    "markerfacecolor": "white",
    "markeredgecolor": INK,
    "markeredgewidth": 0.8,
    "label": "start",
}
_GOAL: dict[str, Any] = {
    "linestyle": "none",
    "marker": "*",
    "markersize": 8,
    "markerfacecolor": INK,
    "markeredgecolor": "white",
    "markeredgewidth": 0.5,
    "label": "goal",
}
_NOMINAL: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2)), "label": "nominal path"}
_HALO = (withStroke(linewidth=2.2, foreground="white"),)
#: Outline of a person on a white map, and on colours, where it has to differ from the robot's and hides nothing.
_PERSON: dict[str, Any] = {"fill": False, "edgecolor": INK, "linewidth": 0.8, "zorder": 4}
_PERSON_ON_COLOURS: dict[str, Any] = {
    **_PERSON,
    "linewidth": 1.2,
    "path_effects": (withStroke(linewidth=2.4, foreground="white"),),
}
#: How opaque people are together where all of them overlap.
_OPACITY = 0.9


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
    extents = np.array([grid.extent_m for grid in grids])
    first, last = extents[:, ::2].min(axis=0), extents[:, 1::2].max(axis=0)
    seen = np.clip(points_m, first, last)
    low, high = seen.min(axis=0), seen.max(axis=0)
    near_first, near_last = np.maximum(low - margin_m, first), np.minimum(high + margin_m, last)
    if np.prod(last - first) >= CROP_FROM * np.prod(near_last - near_first):
        first, last = near_first, near_last
    return float(first[0]), float(last[0]), float(first[1]), float(last[1])


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
        cmap=ListedColormap([OBSTACLE_COLOUR]),
        extent=grid.extent_m,
        origin="lower",
        interpolation="nearest",
        rasterized=True,
        zorder=1,
    )


def draw_people(axes: Axes, people_m: FloatArray, *, filled: bool) -> list[Circle]:
    """Draw (p, 2) people, m, map frame, as circles to scale.

    Filled ones lie below the paths, and are the more translucent the more there are: where people of several trials
    overlap, all outlines are seen. Others are an outline that hides nothing of the colours below.

    Returns:
        The outlines.
    """
    opacity = 1 - (1 - _OPACITY) ** (1 / max(1, len(people_m)))
    if filled:
        for x, y in people_m:
            axes.add_patch(Circle((x, y), PERSON_RADIUS_M, facecolor=(PERSON_COLOUR, opacity), linewidth=0, zorder=2))
    look = _PERSON if filled else _PERSON_ON_COLOURS
    outlines = [Circle((x, y), PERSON_RADIUS_M, **look) for x, y in people_m]
    for outline in outlines:
        axes.add_patch(outline)
    return outlines


def draw_starts(axes: Axes, starts_m: FloatArray, robot_radius_m: float | None) -> tuple[Line2D, list[Circle]]:
    """Mark (k, 2) starts, m, map frame; where the robot's radius is known, its outline is drawn to scale.

    Starts within a radius of each other share an outline.

    Returns:
        The markers and the outlines.
    """
    outlines: list[Circle] = []
    for x, y in starts_m if robot_radius_m else ():
        if all(np.hypot(x - o.center[0], y - o.center[1]) >= robot_radius_m for o in outlines):
            outlines.append(Circle((x, y), robot_radius_m or 0.0, fill=False, edgecolor=INK, linewidth=0.6, zorder=5))
            axes.add_patch(outlines[-1])
    (markers,) = axes.plot(*starts_m.T, zorder=6, **_START)
    return markers, outlines


def draw_goals(axes: Axes, goals_m: FloatArray) -> Line2D:
    """Mark (k, 2) goals, m, map frame."""
    (markers,) = axes.plot(*goals_m.T, zorder=6, **_GOAL)
    return markers


def draw_nominal(axes: Axes, line_m: FloatArray) -> Line2D:
    """Draw the nominal path, a (k, 2) line, m, map frame, legible on any colour."""
    (line,) = axes.plot(*line_m.T, zorder=3, path_effects=_HALO, **_NOMINAL)
    return line


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


def ground_handles(
    people: Sequence[Circle], outlines: Sequence[Circle], *, nominal: bool, filled: bool
) -> list[Artist]:
    """Legend entries of what is there: obstacles, start, goal, and people, robot and nominal path where drawn."""
    disc: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 7, "markeredgecolor": INK}
    handles: list[Artist] = [Line2D([], [], **_NOMINAL)] if nominal else []
    handles += [Line2D([], [], **_START), Line2D([], [], **_GOAL)]
    if outlines:
        handles.append(Line2D([], [], label="robot", markerfacecolor="white", markeredgewidth=0.6, **disc))
    if people:
        label = "person" if len(people) == 1 else f"person ({len(people)} places)"
        colour, look = (PERSON_COLOUR, _PERSON) if filled else ("none", _PERSON_ON_COLOURS)
        edge_pt = look["linewidth"]
        handles.append(Line2D([], [], label=label, markerfacecolor=colour, markeredgewidth=edge_pt, **disc))
    return [*handles, Patch(facecolor=OBSTACLE_COLOUR, label="obstacle, inflated")]
