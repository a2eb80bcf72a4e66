"""A scale bar at a place of a map where it hides nothing."""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from matplotlib.quiver import Quiver
from matplotlib.text import Annotation

from navirl_cli.arrays import FloatArray
from navirl_cli.figures.ground import Window, inside
from navirl_cli.figures.style import look, panel_width_in

#: Least and largest length of a bar as a share of the map's width.
_LEAST, _MOST = 0.08, 0.4
#: Distance from the borders, and height and least width of bar and number, inches.
_PAD_IN, _HIGH_IN, _WIDE_IN = 0.07, 0.2, 0.25
#: Number of places tried at each border.
_PLACES = 9
#: Lines are sampled at this distance, m.
_SPACING_M = 0.1


def draw_scale_bar(axes: Axes, window: Window) -> Line2D | None:
    """Draw a scale bar of 1 m, or of a length that fits, at a free place at the upper or lower border of a map.

    Args:
        axes: Those of the map, with everything else already drawn.
        window: Limits of the view, m.

    Returns:
        The bar; None, and nothing drawn, where every place would hide paths, marks, arrows or visited cells. The axes
        are in metres too.
    """
    length = length_m(window[1] - window[0])
    middle, top, hides = free_place(axes, window, length)
    if hides:
        return None
    ends: dict[str, Any] = {"solid_capstyle": "butt", "zorder": 7, "label": "_scale"}
    x = middle[0] + length * np.array([-0.5, 0.5])
    (bar,) = axes.plot(x, middle[[1, 1]], color=look().ink, linewidth=1.6, **ends)
    bar.set_path_effects([withStroke(linewidth=3.2, foreground=look().paper)])
    write_beside(axes, f"{length:g} m", middle, top=top)
    return bar


def free_place(axes: Axes, window: Window, length: float) -> tuple[FloatArray, bool, bool]:
    """The place at the upper or lower border of a map in which a mark with a number hides least.

    Args:
        axes: Those of the map.
        window: Limits of the view, m.
        length: Length of the mark along x, m.

    Returns:
        (2,) place of the mark's middle, m; whether its number is below it, as at the upper border; and whether it hides
        something. Of equal places corners come first, on the right and below. Colours of a map that is coloured
        everywhere are hidden where nothing else is.
    """
    x0, x1, y0, y1 = window
    inch_m = (x1 - x0) / panel_width_in(axes)  # a little too small: labels are beside the map
    pad, high, wide = _PAD_IN * inch_m, _HIGH_IN * inch_m, max(length, _WIDE_IN * inch_m)
    busy, coloured = np.concatenate([_drawn_m(axes), _visited_m(axes)]), _coloured_m(axes)
    lefts = np.linspace(x1 - pad - wide, x0 + pad, _PLACES)[[0, -1, *range(1, _PLACES - 1)]]
    places = {}
    for left, top in product(lefts, (False, True)):
        low = y1 - pad - high if top else y0 + pad
        box = (left - pad, left + wide + pad, low - pad, low + high + pad)
        places[float(left), top] = int(inside(box, busy).sum()), int(inside(box, coloured).sum())
    left, top = min(places, key=lambda place: places[place])  # the first of equal ones
    return np.array([left + wide / 2, y1 - pad if top else y0 + pad]), top, places[left, top][0] > 0


def write_beside(axes: Axes, text: str, middle: FloatArray, *, top: bool) -> Annotation:
    """Write a mark's number above its (2,) middle, m, or below it in an upper corner, legible on any colour."""
    side: dict[str, Any] = {"ha": "center", "va": "top" if top else "bottom", "fontsize": 7, "zorder": 7}
    shift = (0.0, -2.0 if top else 2.0)
    number = axes.annotate(text, (middle[0], middle[1]), shift, textcoords="offset points", **side)
    number.set_path_effects([withStroke(linewidth=1.6, foreground=look().paper)])
    return number


def length_m(width_m: float) -> float:
    """Length of the bar of a map of a width, m: 1 if it is visible and leaves room, otherwise 1, 2 or 5 times 10^k."""
    if _LEAST * width_m <= 1.0 <= _MOST * width_m:
        return 1.0
    power = 10.0 ** np.floor(np.log10(_MOST / 2 * width_m))
    return float(max(step * power for step in (1, 2, 5) if step * power <= _MOST / 2 * width_m))


def _drawn_m(axes: Axes) -> FloatArray:
    """(n, 2) points on all lines, markers, circles and arrows of a map, m."""
    points = [np.empty((0, 2))]
    for line in axes.lines:
        corners = np.asarray(line.get_xydata(), dtype=float)
        if line.get_linestyle() == "None" or len(corners) < 2:
            points.append(corners)
            continue
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        at = np.linspace(0.0, along[-1], max(2, int(along[-1] / _SPACING_M)))
        points.append(np.stack([np.interp(at, along, axis) for axis in corners.T], axis=1))
    around = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    points += [circle * one.radius + one.center for one in axes.patches if isinstance(one, Circle)]
    for field in axes.collections:
        if isinstance(field, Quiver):
            tails = np.asarray(field.get_offsets(), dtype=float)
            points += [tails, tails + np.stack([field.U, field.V], axis=1)]
    return np.concatenate(points)


def _visited_m(axes: Axes) -> FloatArray:
    """(n, 2) centres of cells that stand out from their surroundings: those of a logarithmic scale within it."""
    return _cells_m(axes, lambda norm, values: isinstance(norm, LogNorm) & (values >= (norm.vmin or 0.0)))


def _coloured_m(axes: Axes) -> FloatArray:
    """(n, 2) centres of cells that have any value of a scale."""
    return _cells_m(axes, lambda norm, values: (not isinstance(norm, LogNorm)) & np.isfinite(values))


def _cells_m(axes: Axes, chosen: Callable[[Any, FloatArray], Any]) -> FloatArray:
    """(n, 2) centres of some cells of the images below everything else, m."""
    points = [np.empty((0, 2))]
    for image in axes.images:
        table = image.get_array()
        if image.get_zorder() != 0 or table is None:
            continue
        values: FloatArray = np.ma.filled(np.ma.asarray(table, dtype=float), np.nan)
        x0, x1, y0, y1 = image.get_extent()
        rows, columns = np.nonzero(np.broadcast_to(chosen(image.norm, values), values.shape))
        x = x0 + (columns + 0.5) * (x1 - x0) / values.shape[1]
        points.append(np.stack([x, y0 + (rows + 0.5) * (y1 - y0) / values.shape[0]], axis=1))
    return np.concatenate(points)
