"""Marks of a map's scale below it, beside the label of its axis, where they hide nothing."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.transforms import ScaledTranslation, Transform, blended_transform_factory

from navirl_cli.figures.ground import Window
from navirl_cli.figures.style import look, panel_width_in

#: Least and largest length of a bar as a share of the map's width.
_LEAST, _MOST = 0.08, 0.25
#: Distance of the label's middle from the map, and of a mark from its number, points.
_BELOW_PT, _GAP_PT = 18.5, 3.0
#: Width of the labels beside a map, of half the axis' label, and of a number with the room around it, inches.
_BESIDE_IN, _LABEL_IN, _NUMBER_IN = 0.4, 0.17, 0.4
#: What marks of the scale are called, which belong to the label of the axis.
SCALE = "_scale"


def draw_scale_bar(axes: Axes, window: Window) -> Line2D | None:
    """Draw a scale bar of 1 m, or of a length that fits, below the right end of a map.

    Args:
        axes: Those of the map.
        window: Limits of the view, m.

    Returns:
        The bar; None, and nothing drawn, where a narrow panel has no room beside the label. The axes are in metres too.
    """
    x0, x1, _, _ = window
    length = length_m(x1 - x0)
    map_in = panel_width_in(axes) - _BESIDE_IN
    if (0.5 - length / (x1 - x0)) * map_in < _LABEL_IN + _NUMBER_IN:
        return None
    line: dict[str, Any] = {"color": look().ink, "linewidth": 1.6, "solid_capstyle": "butt", "clip_on": False}
    bar = Line2D([x1 - length, x1], [0.0, 0.0], transform=below(axes), label=SCALE, **line)
    axes.add_artist(bar)
    write_beside(axes, f"{length:g} m", x1 - length, left=True)
    return bar


def below(axes: Axes) -> Transform:
    """From x in metres, and y in inches from the middle of the label below a map, to the canvas."""
    shift = ScaledTranslation(0.0, -_BELOW_PT / 72, axes.figure.dpi_scale_trans)
    return blended_transform_factory(axes.transData, axes.transAxes + shift)


def write_beside(axes: Axes, text: str, x_m: float, *, left: bool) -> Annotation:
    """Write a mark's number on the left or on the right of its end at x_m."""
    side: dict[str, Any] = {"ha": "right" if left else "left", "va": "center", "fontsize": 7, "annotation_clip": False}
    shift = (-_GAP_PT if left else _GAP_PT, 0.0)
    return axes.annotate(text, (x_m, 0.0), shift, xycoords=below(axes), textcoords="offset points", label=SCALE, **side)


def length_m(width_m: float) -> float:
    """Length of the bar of a map of a width, m: 1 if it is visible and leaves room, otherwise 1, 2 or 5 times 10^k."""
    if _LEAST * width_m <= 1.0 <= _MOST * width_m:
        return 1.0
    power = 10.0 ** np.floor(np.log10(_MOST * width_m))
    return float(max(step * power for step in (1, 2, 5) if step * power <= _MOST * width_m))
