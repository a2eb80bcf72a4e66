"""Numbers by cell over the map: the propagated policy and the state reward (Fig. 8)."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any, TypedDict, Unpack

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, NullFormatter

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.figures.ground import Window, cropped_to, draw_obstacles, inside, legend_below, window_around
from navirl_cli.figures.marks import Marks, Places, draw_marks, draw_nominal
from navirl_cli.figures.overlay import Overlay, draw_overlays, overlay_handles
from navirl_cli.figures.style import house_style, look, panel_width_in
from navirl_cli.irl.scene import Scene

#: The higher the lighter, and apart for every common kind of colour vision.
REWARD_MAP = colormaps["cividis"].with_extremes(bad=(0, 0, 0, 0))
#: Cells with fewer expected visits than this stay as the paper: one path in a thousand passes there.
LEAST_VISITS = 1e-3
#: Cells with this many are likely: a cropped map ends beyond them.
LIKELY_VISITS = 3e-2
#: Colours of the reward span its values this near to the nominal path and to people, m: about personal distance (Hall).
REACH_M = 1.2
#: Thickness of a colour bar and its distance from the map, in shares of the map's longer side.
_BAR, _GAP = 0.03, 0.02
#: A map flatter than this has its colour bar above it, because the label is longer than the map is high.
_FLAT = 0.5
#: Width of what stands beside a map and its colour bar, and of a letter of the bar's label, inches.
_BESIDE_IN, _LETTER_IN = 1.05, 0.056
#: Letters in a line of the bar's label at least.
_SHORTEST = 21
#: Pointed ends of a colour bar, by whether shown cells lie below and above its range.
EXTEND = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}


class CellOptions(TypedDict, total=False):
    """What every figure of a scene takes besides its numbers."""

    #: Draws the robot at its start to scale, m.
    robot_radius_m: float | None
    #: Borders of what is shown, m; None: around the paths, or the whole map where it is not much larger.
    window_m: Window | None
    #: Paths over the map.
    overlays: Sequence[Overlay]
    #: Title of the panel.
    title: str
    #: Whether to put a legend below: so it is unless said otherwise.
    legend: bool


@dataclass(frozen=True)
class DrawnCells:
    """What a figure of numbers by cell put on the axes."""

    axes: Axes
    #: What is shown; hand it to another figure of the same scene so that both show the same.
    window_m: Window
    #: Its array is (rows, columns), masked where the robot cannot be.
    image: AxesImage
    obstacles: AxesImage
    nominal: Line2D
    people: list[Circle]
    colour_bar: Colorbar
    marks: Marks
    #: One for each path over the map.
    overlays: list[Line2D]


@house_style()
def draw_policy(axes: Axes, scene: Scene, visits: FloatArray, **options: Unpack[CellOptions]) -> DrawnCells:
    """Draw where a policy leads: expected visits of every cell, on a logarithmic scale (Fig. 8 left).

    Args:
        axes: Where to draw.
        scene: The scene.
        visits: (n,) expected visits by state, from the scene's start.
        options: As in :class:`CellOptions`.

    Returns:
        The artists.

    Raises:
        ValueError: There is not one number for each state.
    """
    check_states(scene, visits)
    window = options.get("window_m") or scene_window(scene, visits >= LEAST_VISITS)
    norm = LogNorm(LEAST_VISITS, max(1.0, float(visits.max())))
    # Cells of no weight are as the paper, so that the likely paths stand out and print well.
    colours = colormaps[look().intensity].with_extremes(under=look().paper, bad=(0, 0, 0, 0))
    image = draw_image(axes, scene, visits, norm, colours)
    bar = draw_bar(axes, image, window, "expected visits", extend="min")
    return draw_scene(image, bar, scene, window, **options)


@house_style()
def draw_reward(axes: Axes, scene: Scene, reward_by_cell: FloatArray, **options: Unpack[CellOptions]) -> DrawnCells:
    """Draw the part of the reward that belongs to the cell (Fig. 8 right).

    Colours span the values within REACH_M of the nominal path and of people, so that far corners of the map do not wash
    them out; the colour bar has a pointed end where shown cells lie beyond. The cost of the way belongs to the move and
    is not in it.

    Args:
        axes: Where to draw.
        scene: The scene.
        reward_by_cell: (n,) dimensionless reward of a step in every state.
        options: As in :class:`CellOptions`.

    Returns:
        The artists.

    Raises:
        ValueError: There is not one number for each state.
    """
    check_states(scene, reward_by_cell)
    window = options.get("window_m") or scene_window(scene, scene.nominal)
    shown = shown_states(scene, window)
    near = shown & _within_reach(scene)
    spanned, seen = reward_by_cell[near if near.any() else shown], reward_by_cell[shown]
    image = draw_image(axes, scene, reward_by_cell, Normalize(spanned.min(), spanned.max()), REWARD_MAP)
    ends = bool(seen.min() < spanned.min()), bool(seen.max() > spanned.max())
    bar = draw_bar(axes, image, window, "state reward per step (without cost of way)", extend=EXTEND[ends])
    return draw_scene(image, bar, scene, window, **options)


def check_states(scene: Scene, values: FloatArray) -> None:
    """Refuse numbers that are not one for each state."""
    if values.shape != (scene.lattice.size,):
        raise ValueError(f"one number for each of {scene.lattice.size} states is needed, found shape {values.shape}")


def scene_window(scene: Scene, shown: BoolArray) -> Window:
    """What to show of a scene: its nominal path, the (n,) cells that matter, and the surroundings."""
    return window_around([scene.lattice.grid], scene.lattice.xy_m[shown | scene.nominal])


def likely_window(scene: Scene, visits: FloatArray, lines_m: Sequence[FloatArray] = ()) -> Window:
    """A scene cropped to where its policy leads.

    Args:
        scene: The scene.
        visits: (n,) expected visits by state.
        lines_m: (k, 2) paths, m, map frame, that are drawn over it.
    """
    ends = np.isin(np.arange(scene.lattice.size), (scene.start, scene.goal))
    likely = scene.lattice.xy_m[(visits >= LIKELY_VISITS) | ends]
    return cropped_to([scene.lattice.grid], np.concatenate([likely, *lines_m]), scene.people_m)


def shown_states(scene: Scene, window: Window) -> BoolArray:
    """(n,) cells that a window shows; all where it shows none."""
    shown = inside(window, scene.lattice.xy_m)
    return shown if shown.any() else np.ones_like(shown)


def _within_reach(scene: Scene) -> BoolArray:
    """(n,) cells within REACH_M of the nominal path or of a person."""
    near: BoolArray = scene.deviation_m <= REACH_M
    for person in scene.people_m:
        near |= np.hypot(*(scene.lattice.xy_m - person).T) <= REACH_M
    return near


def draw_image(axes: Axes, scene: Scene, values: FloatArray, norm: Normalize, colours: Colormap) -> AxesImage:
    """An image of (n,) numbers by state."""
    extent = scene.lattice.grid.extent_m
    style: dict[str, Any] = {"interpolation": "nearest", "rasterized": True, "zorder": 0}
    return axes.imshow(table_of(scene, values), cmap=colours, norm=norm, extent=extent, origin="lower", **style)


def table_of(scene: Scene, values: FloatArray) -> np.ma.MaskedArray[Any, Any]:
    """(n,) numbers by state as (rows, columns), masked where there is no state."""
    columns, rows = scene.lattice.cells.T
    table = np.full(scene.lattice.grid.shape, np.nan)
    table[rows, columns] = values
    return np.ma.masked_invalid(table)


def draw_bar(axes: Axes, image: ScalarMappable, window: Window, label: str, extend: str) -> Colorbar:
    """A colour bar exactly as high as the map, or as wide, above a flat one."""
    shape = (window[3] - window[2]) / (window[1] - window[0])
    above = shape < _FLAT
    longer = max(1.0, shape)
    beside = (1 + _GAP * longer, 0.0, _BAR * longer, 1.0)
    place = (0.0, 1 + _GAP / shape, 1.0, _BAR / shape) if above else beside
    bar = axes.figure.colorbar(
        image, cax=axes.inset_axes(place), orientation="horizontal" if above else "vertical", extend=extend
    )
    length_in = (panel_width_in(axes) - _BESIDE_IN) * (1.0 if above else shape)
    bar.set_label(fill(label, max(_SHORTEST, int(length_in / _LETTER_IN))))
    bar.outline.set_linewidth(0.5)
    if isinstance(image.norm, LogNorm):
        bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
        bar.minorformatter = NullFormatter()
    if above:
        bar.ax.xaxis.set_ticks_position("top")
        bar.ax.xaxis.set_label_position("top")
    return bar


def draw_scene(
    image: AxesImage, bar: Colorbar, scene: Scene, window: Window, **options: Unpack[CellOptions]
) -> DrawnCells:
    """Everything that stands on the cells, and the frame around them."""
    obstacles, nominal, marks, lines = draw_over(image.axes, scene, window, **options)
    return DrawnCells(image.axes, window, image, obstacles, nominal, marks.people, bar, marks, lines)


def draw_over(
    axes: Axes, scene: Scene, window: Window, **options: Unpack[CellOptions]
) -> tuple[AxesImage, Line2D, Marks, list[Line2D]]:
    """Obstacles, nominal path, people, start and goal, and paths of a scene, with the frame around them."""
    ends, overlays = scene.lattice.xy_m[[scene.start, scene.goal]], options.get("overlays", ())
    obstacles = draw_obstacles(axes, scene.lattice.grid)
    lines = draw_overlays(axes, overlays)
    nominal = draw_nominal(axes, scene.nominal_line_m())
    places = Places(ends[:1], ends[1:], scene.people_m, options.get("robot_radius_m"))
    marks = draw_marks(axes, window, places, nominal=nominal, title=options.get("title", ""))
    if options.get("legend", True):
        legend_below(axes, [*overlay_handles(overlays), *marks.handles()])
    return obstacles, nominal, marks, lines
