"""The most likely move in every cell as a field of arrows."""

from dataclasses import dataclass
from math import ceil
from typing import Any, Unpack

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.grid import MOVE_LENGTHS, MOVES
from navirl_cli.figures.cells import CellOptions, draw_bar, draw_over, scene_window, shown_states
from navirl_cli.figures.ground import Window
from navirl_cli.figures.marks import Marks
from navirl_cli.figures.style import house_style, look, panel_width_in
from navirl_cli.irl.scene import Scene

#: Least distance between arrows, and width of a shaft, inches; length of the arrow of a certain move as a share of the
#: distance between arrows.
_PITCH_IN, _SHAFT_IN, _LENGTH = 0.085, 0.009, 0.95
#: Below paths the arrows are so many times as far from each other, and have this opacity.
_THINNED, _FAINT = 2.0, 0.5
#: Width of the labels and the colour bar beside a map, inches.
_BESIDE_IN = 0.85


@dataclass(frozen=True, eq=False)
class DrawnActions:
    """The artists of :func:`draw_actions`."""

    axes: Axes
    window_m: Window
    #: (m,) states whose moves are drawn, and their arrows.
    states: IntArray
    arrows: Quiver
    colour_bar: Colorbar
    nominal: Line2D
    marks: Marks
    #: One for each path over the map.
    overlays: list[Line2D]


@house_style()
def draw_actions(axes: Axes, scene: Scene, probability: FloatArray, **options: Unpack[CellOptions]) -> DrawnActions:
    """Draw the most likely move of a policy in every cell that is shown.

    The more probable the move, the longer and darker its arrow. Where cells are too small, only every second cell has
    an arrow, or every third, and so on, along x and along y. Below paths the arrows are fewer and fainter.

    Args:
        axes: Where to draw.
        scene: The scene.
        probability: (n, 8) probability of each move by state.
        options: As in :class:`CellOptions`.

    Returns:
        The artists.

    Raises:
        ValueError: The number of rows is not the number of states.
    """
    if probability.shape != (scene.lattice.size, len(MOVES)):
        expected = f"({scene.lattice.size}, {len(MOVES)})"
        raise ValueError(f"probabilities of moves need the shape {expected}, found {probability.shape}")
    window = options.get("window_m") or scene_window(scene, scene.nominal)
    over = any(one.lines_m for one in options.get("overlays", ()))
    every = _stride(axes, scene, window, _PITCH_IN * (_THINNED if over else 1.0))
    start = scene.lattice.cells[scene.start]
    chosen = shown_states(scene, window) & ((scene.lattice.cells - start) % every == 0).all(axis=1)
    chosen[scene.goal] = False
    states: IntArray = np.flatnonzero(chosen)
    best = probability[states].argmax(axis=1)
    sure = probability[states, best]
    along = MOVES[best] / MOVE_LENGTHS[best, None]
    length = sure[:, None] * _LENGTH * every * scene.lattice.grid.resolution_m
    style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "pivot": "mid", "units": "inches"}
    head: dict[str, Any] = {"width": _SHAFT_IN, "headwidth": 3.4, "headlength": 3.6, "headaxislength": 3.2}
    norm, x, y = Normalize(0.0, 1.0), *scene.lattice.xy_m[states].T
    arrows = axes.quiver(x, y, *(length * along).T, sure, cmap=_colours(), norm=norm, zorder=2, **style, **head)
    bar = draw_bar(axes, arrows, window, "probability of the most likely move", extend="neither")
    arrows.set_alpha(_FAINT if over else 1.0)  # after the colour bar, which would fade too
    options["opaque_people"] = True
    _, nominal, marks, lines = draw_over(axes, scene, window, **options)
    return DrawnActions(axes, window, states, arrows, bar, nominal, marks, lines)


def _stride(axes: Axes, scene: Scene, window: Window, pitch_in: float) -> int:
    """Distance between cells with an arrow, cells, for a least distance between arrows on paper, inches."""
    cell_in = scene.lattice.grid.resolution_m / (window[1] - window[0]) * (panel_width_in(axes) - _BESIDE_IN)
    return max(1, ceil(pitch_in / cell_in))


def _colours() -> LinearSegmentedColormap:
    """Colours that all differ from the background."""
    strong = colormaps[look().intensity](np.linspace(0.25, 1.0, 256))
    return LinearSegmentedColormap.from_list("sure", strong)
