"""Values by cell over the map: the propagated policy and the state reward (Fig. 8)."""

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
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.figures.ground import Window, cropped_to, draw_obstacles, inside, legend_below, window_around
from navirl_cli.figures.marks import Marks, Places, draw_marks, draw_nominal
from navirl_cli.figures.overlay import Overlay, draw_overlays, overlay_handles
from navirl_cli.figures.style import house_style, look, panel_width_in
from navirl_cli.irl.scene import Scene

#: Lighter is higher; distinct for every common type of colour vision.
REWARD_MAP = colormaps["cividis"].with_extremes(bad=(0, 0, 0, 0))
#: Cells with fewer expected visits have the background's colour: at most one path in a thousand passes there.
LEAST_VISITS = 1e-3
#: Cells with at least so many expected visits are likely: a cropped map includes them.
LIKELY_VISITS = 3e-2
#: Colours of the reward span its values within this distance of the nominal path and of people, m: about the outer
#: border of Hall's personal zone.
REACH_M = 1.2
#: Thickness of a colour bar and its distance from the map, as shares of the map's longer side.
_BAR, _GAP = 0.03, 0.02
#: A map with a smaller ratio of height to width has its colour bar above, because the label is longer than it is high.
_FLAT = 0.5
#: Width of labels beside a map and its colour bar, and of a letter of the bar's label, inches.
_BESIDE_IN, _LETTER_IN = 1.05, 0.056
#: Least number of letters in a line of the bar's label.
_SHORTEST = 21
#: Labels of the colour bars.
VISITS, REWARD = "expected visits", "state reward per step (without path length)"
#: Pointed ends of a colour bar, by whether values of shown cells are below and above its range.
EXTEND = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}


class CellOptions(TypedDict, total=False):
    """Options of every figure of a scene."""

    #: Radius of the robot, which is drawn at its start to scale, m.
    robot_radius_m: float | None
    #: Limits of the view, m; None: the paths' surroundings, or all of a map that is not much larger.
    window_m: Window | None
    #: Paths over the map.
    overlays: Sequence[Overlay]
    #: Title of the panel.
    title: str
    #: Whether to put a legend below; default True.
    legend: bool
    #: Whether to put a colour bar beside or above; default True.
    scale: bool
    #: Whether people hide the colours below them; by default those of the policy where no visits are.
    opaque_people: bool


@dataclass(frozen=True)
class DrawnCells:
    """The artists of a figure of values by cell."""

    axes: Axes
    #: Limits of the view, for another figure of the same scene with the same view.
    window_m: Window
    #: Its array is (rows, columns), masked where the robot cannot be.
    image: AxesImage
    obstacles: AxesImage
    nominal: Line2D
    people: list[Circle]
    #: None where another map has it.
    colour_bar: Colorbar | None
    marks: Marks
    #: One for each path over the map.
    overlays: list[Line2D]


@house_style()
def draw_policy(axes: Axes, scene: Scene, visits: FloatArray, **options: Unpack[CellOptions]) -> DrawnCells:
    """Draw the propagated policy: expected visits of every cell, on a logarithmic scale (Fig. 8, left).

    Args:
        axes: Where to draw.
        scene: The scene.
        visits: (n,) expected visits by state, from the scene's start.
        options: As in :class:`CellOptions`.

    Returns:
        The artists.

    Raises:
        ValueError: The number of values is not the number of states.
    """
    check_states(scene, visits)
    window = options.get("window_m") or scene_window(scene, visits >= LEAST_VISITS)
    norm = LogNorm(LEAST_VISITS, max(1.0, float(visits.max())))
    # Unlikely cells have the background's colour. Likely paths stand out and print well.
    colours = colormaps[look().intensity].with_extremes(under=look().paper, bad=(0, 0, 0, 0))
    image = draw_image(axes, scene, visits, norm, colours)
    bar = draw_bar(axes, image, window, VISITS, extend="min") if options.get("scale", True) else None
    # People are filled where that hides no visits.
    inside_people = np.zeros(len(visits), dtype=bool)
    for person in scene.people_m:
        inside_people |= np.hypot(*(scene.lattice.xy_m - person).T) < PERSON_RADIUS_M
    options.setdefault("opaque_people", not (visits[inside_people] >= LEAST_VISITS).any())
    return draw_scene(image, bar, scene, window, **options)


@house_style()
def draw_reward(axes: Axes, scene: Scene, reward_by_cell: FloatArray, **options: Unpack[CellOptions]) -> DrawnCells:
    """Draw the state reward: the part of the reward that depends on the cell (Fig. 8, right).

    Colours span the values within REACH_M of the nominal path and of people: far corners of the map would leave few
    colours for them. The colour bar has a pointed end where values of shown cells are outside of this span. The cost of
    path length depends on the move and is not included.

    Args:
        axes: Where to draw.
        scene: The scene.
        reward_by_cell: (n,) dimensionless reward of a step in every state.
        options: As in :class:`CellOptions`.

    Returns:
        The artists.

    Raises:
        ValueError: The number of values is not the number of states.
    """
    check_states(scene, reward_by_cell)
    window = options.get("window_m") or scene_window(scene, scene.nominal)
    shown = shown_states(scene, window)
    near = shown & _within_reach(scene)
    spanned, seen = reward_by_cell[near if near.any() else shown], reward_by_cell[shown]
    image = draw_image(axes, scene, reward_by_cell, Normalize(spanned.min(), spanned.max()), REWARD_MAP)
    ends = bool(seen.min() < spanned.min()), bool(seen.max() > spanned.max())
    bar = draw_bar(axes, image, window, REWARD, extend=EXTEND[ends]) if options.get("scale", True) else None
    return draw_scene(image, bar, scene, window, **options)


def check_states(scene: Scene, values: FloatArray) -> None:
    """Refuse values that are not one for each state."""
    if values.shape != (scene.lattice.size,):
        raise ValueError(f"expected one value for each of {scene.lattice.size} states, found shape {values.shape}")


def scene_window(scene: Scene, shown: BoolArray) -> Window:
    """Limits of the view of a scene: its nominal path and the (n,) chosen cells, with a margin."""
    return window_around([scene.lattice.grid], scene.lattice.xy_m[shown | scene.nominal])


def likely_window(scene: Scene, visits: FloatArray, lines_m: Sequence[FloatArray] = ()) -> Window:
    """Limits of the view of a scene cropped to where its policy leads.

    Args:
        scene: The scene.
        visits: (n,) expected visits by state.
        lines_m: Paths drawn over it, each (k, 2), m, map frame.

    Returns:
        Limits, m, map frame.
    """
    ends = np.isin(np.arange(scene.lattice.size), (scene.start, scene.goal))
    likely = scene.lattice.xy_m[(visits >= LIKELY_VISITS) | ends]
    return cropped_to([scene.lattice.grid], np.concatenate([likely, *lines_m]), scene.people_m)


def sight_of(
    scene: Scene, visits: FloatArray, robot_radius_m: float, overlays: Sequence[Overlay], *, crop: bool
) -> CellOptions:
    """Options that all figures of a scene share, so that cropped ones have the same view.

    Args:
        scene: The scene.
        visits: (n,) expected visits by state.
        robot_radius_m: Radius of the robot, m.
        overlays: Paths over the map.
        crop: Show only where the policy leads, and the overlays.
    """
    lines = [line for one in overlays for line in one.lines_m]
    window = likely_window(scene, visits, lines) if crop else None
    return {"robot_radius_m": robot_radius_m, "window_m": window, "overlays": overlays}


def shown_states(scene: Scene, window: Window) -> BoolArray:
    """(n,) cells within a window; all cells if none is."""
    shown = inside(window, scene.lattice.xy_m)
    return shown if shown.any() else np.ones_like(shown)


def _within_reach(scene: Scene) -> BoolArray:
    """(n,) cells within REACH_M of the nominal path or of a person."""
    near: BoolArray = scene.deviation_m <= REACH_M
    for person in scene.people_m:
        near |= np.hypot(*(scene.lattice.xy_m - person).T) <= REACH_M
    return near


def draw_image(axes: Axes, scene: Scene, values: FloatArray, norm: Normalize, colours: Colormap) -> AxesImage:
    """Draw (n,) values by state as an image."""
    extent = scene.lattice.grid.extent_m
    style: dict[str, Any] = {"interpolation": "nearest", "rasterized": True, "zorder": 0}
    return axes.imshow(table_of(scene, values), cmap=colours, norm=norm, extent=extent, origin="lower", **style)


def table_of(scene: Scene, values: FloatArray) -> np.ma.MaskedArray[Any, Any]:
    """(rows, columns) table of (n,) values by state, masked where no state is."""
    columns, rows = scene.lattice.cells.T
    table = np.full(scene.lattice.grid.shape, np.nan)
    table[rows, columns] = values
    return np.ma.masked_invalid(table)


def draw_bar(axes: Axes, image: ScalarMappable, window: Window, label: str, extend: str) -> Colorbar:
    """Draw a colour bar exactly as high as the map; above a flat map, exactly as wide."""
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
    plain_numbers(bar)
    if above:
        bar.ax.xaxis.set_ticks_position("top")
        bar.ax.xaxis.set_label_position("top")
    return bar


def plain_numbers(bar: Colorbar) -> None:
    """Write the numbers of a logarithmic colour bar without powers."""
    if isinstance(bar.norm, LogNorm):
        bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
        bar.minorformatter = NullFormatter()


def draw_scene(
    image: AxesImage, bar: Colorbar | None, scene: Scene, window: Window, **options: Unpack[CellOptions]
) -> DrawnCells:
    """Draw everything over an image of cells, and the frame around it."""
    obstacles, nominal, marks, lines = draw_over(image.axes, scene, window, **options)
    return DrawnCells(image.axes, window, image, obstacles, nominal, marks.people, bar, marks, lines)


def draw_over(
    axes: Axes, scene: Scene, window: Window, **options: Unpack[CellOptions]
) -> tuple[AxesImage, Line2D, Marks, list[Line2D]]:
    """Draw obstacles, nominal path, people, start, goal and paths of a scene, and the frame around them."""
    ends, overlays = scene.lattice.xy_m[[scene.start, scene.goal]], options.get("overlays", ())
    obstacles = draw_obstacles(axes, scene.lattice.grid)
    lines = draw_overlays(axes, overlays)
    nominal = draw_nominal(axes, scene.nominal_line_m())
    places = Places(ends[:1], ends[1:], scene.people_m, options.get("robot_radius_m"))
    opaque = options.get("opaque_people", False)
    marks = draw_marks(axes, window, places, nominal=nominal, title=options.get("title", ""), opaque=opaque)
    if options.get("legend", True):
        legend_below(axes, overlay_handles(overlays), marks.handles())
    return obstacles, nominal, marks, lines
