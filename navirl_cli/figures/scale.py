"""A scale bar in the corner of a map where it hides least."""

from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
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
#: Lines are sampled at this distance, m.
_SPACING_M = 0.1


def draw_scale_bar(axes: Axes, window: Window) -> tuple[Line2D, Annotation]:
    """Draw a scale bar of 1 m, or of a length that fits, into the emptiest corner of a map.

    Args:
        axes: Those of the map, with everything else already drawn.
        window: Limits of the view, m.

    Returns:
        The bar and its number.
    """
    length = length_m(window[1] - window[0])
    middle, top = free_corner(axes, window, length)
    ends: dict[str, Any] = {"solid_capstyle": "butt", "zorder": 7, "label": "_scale"}
    x = middle[0] + length * np.array([-0.5, 0.5])
    (bar,) = axes.plot(x, middle[[1, 1]], color=look().ink, linewidth=1.6, **ends)
    bar.set_path_effects([withStroke(linewidth=3.2, foreground=look().paper)])
    return bar, write_beside(axes, f"{length:g} m", middle, top=top)


def free_corner(axes: Axes, window: Window, length: float) -> tuple[FloatArray, bool]:
    """The corner of a map in which a mark with a number hides least.

    Args:
        axes: Those of the map.
        window: Limits of the view, m.
        length: Length of the mark along x, m.

    Returns:
        (2,) place of the mark's middle, m, and whether its number is below it, as in the upper corners.
    """
    x0, x1, y0, y1 = window
    inch_m = (x1 - x0) / panel_width_in(axes)  # a little too small: labels are beside the map
    pad, high, wide = _PAD_IN * inch_m, _HIGH_IN * inch_m, max(length, _WIDE_IN * inch_m)
    busy = _drawn_m(axes)
    hidden = {}
    for right, top in product((True, False), (False, True)):
        left, low = (x1 - pad - wide if right else x0 + pad), (y1 - pad - high if top else y0 + pad)
        box = (left - pad, left + wide + pad, low - pad, low + high + pad)
        hidden[right, top] = int(inside(box, busy).sum())
    right, top = min(hidden, key=lambda corner: hidden[corner])  # the first of equal ones
    x = x1 - pad - wide / 2 if right else x0 + pad + wide / 2
    return np.array([x, y1 - pad if top else y0 + pad]), top


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
