"""The soft value of every state over the map."""

from dataclasses import dataclass
from typing import Unpack

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.contour import QuadContourSet
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from navirl_cli.arrays import FloatArray
from navirl_cli.figures.cells import (
    CellOptions,
    DrawnCells,
    check_states,
    draw_bar,
    draw_image,
    draw_scene,
    scene_window,
    shown_states,
    table_of,
)
from navirl_cli.figures.ground import frame
from navirl_cli.figures.style import INK, house_style
from navirl_cli.irl.scene import Scene

#: Lightest at the goal; light enough everywhere for dark contour lines.
VALUE_MAP = LinearSegmentedColormap.from_list("value", colormaps["YlGnBu_r"](np.linspace(0.35, 1.0, 256)))
#: Largest number of contour lines, and size of their numbers, points.
_CONTOURS, _NUMBER_PT = 10, 5.5
#: Numbers nearer to the frame than this share of the map are left out: it would cut them.
_MARGIN = 0.04


@dataclass(frozen=True)
class DrawnValue(DrawnCells):
    """The artists of :func:`draw_value`."""

    #: Lines of equal value, at round numbers that the colour bar has too; and their numbers.
    contours: QuadContourSet
    numbers: list[Text]


@house_style()
def draw_value(axes: Axes, scene: Scene, value: FloatArray, **options: Unpack[CellOptions]) -> DrawnValue:
    """Draw the soft value of every state: the expected reward until the goal, with the entropy of the moves.

    Colours span the values within the view. Contour lines connect equal values; probable moves cross them at right
    angles.

    Args:
        axes: Where to draw.
        scene: The scene.
        value: (n,) soft value V by state, nats; 0 at the goal.
        options: As in :class:`CellOptions`.

    Returns:
        The artists.

    Raises:
        ValueError: The number of values is not the number of states.
    """
    check_states(scene, value)
    window = options.get("window_m") or scene_window(scene, scene.nominal)
    seen = value[shown_states(scene, window)]
    colours = VALUE_MAP.with_extremes(bad=(0, 0, 0, 0))
    image = draw_image(axes, scene, value, Normalize(seen.min(), seen.max()), colours)
    rows, columns = scene.lattice.grid.shape
    x = scene.lattice.grid.centres_of(np.stack([np.arange(columns), np.zeros(columns, dtype=int)], axis=1))[:, 0]
    y = scene.lattice.grid.centres_of(np.stack([np.zeros(rows, dtype=int), np.arange(rows)], axis=1))[:, 1]
    levels = MaxNLocator(_CONTOURS, steps=[1, 2, 5, 10]).tick_values(seen.min(), seen.max())
    inner = levels[(levels > seen.min()) & (levels < seen.max())]
    contours = axes.contour(x, y, table_of(scene, value), inner, colors=INK, linewidths=0.5, linestyles="-", zorder=0.5)
    bar = draw_bar(axes, image, window, "soft value [nats]", extend="neither")
    bar.add_lines(contours)
    # Before the view is set: numbers of lines that leave it are at places inside.
    frame(axes, window)
    placed = axes.clabel(contours, fmt=_number, fontsize=_NUMBER_PT, colors=INK, inline_spacing=2, zorder=3.6)
    numbers = []
    for number in placed:
        inside = axes.transAxes.inverted().transform(axes.transData.transform(number.get_position()))
        if not (inside.min() > _MARGIN and inside.max() < 1 - _MARGIN):
            number.remove()  # the frame would cut it
            continue
        numbers.append(number)
        number.set_path_effects([withStroke(linewidth=1.2, foreground=VALUE_MAP(0.9))])
    options["opaque_people"] = True
    drawn = draw_scene(image, bar, scene, window, **options)
    return DrawnValue(**vars(drawn), contours=contours, numbers=numbers)


def _number(value: float) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")
