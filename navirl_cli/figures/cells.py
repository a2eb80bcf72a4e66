"""Numbers by cell over the map: the propagated policy and the state reward (Fig. 8)."""

from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import FuncFormatter, NullFormatter

from navirl_cli.demos.grid import BoolArray, FloatArray
from navirl_cli.figures.ground import (
    Window,
    draw_goals,
    draw_nominal,
    draw_obstacles,
    draw_people,
    draw_starts,
    frame,
    ground_handles,
    legend_below,
    window_around,
)
from navirl_cli.figures.style import house_style, panel_width_in
from navirl_cli.irl.scene import Scene

#: Free cells without colour are white, so that the likely paths stand out and print well; low numbers are light.
VISITS_MAP = colormaps["viridis_r"].with_extremes(under="white", bad=(0, 0, 0, 0))
REWARD_MAP = colormaps["cividis"].with_extremes(bad=(0, 0, 0, 0))
#: Cells with fewer expected visits than this stay white: one path in a thousand passes there.
LEAST_VISITS = 1e-3
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
_EXTEND = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}


@dataclass(frozen=True)
class DrawnCells:
    """What :func:`draw_policy` and :func:`draw_reward` put on the axes."""

    axes: Axes
    #: What is shown; hand it to another figure of the same scene so that both show the same.
    window_m: Window
    #: Its array is (rows, columns), masked where the robot cannot be.
    image: AxesImage
    obstacles: AxesImage
    nominal: Line2D
    people: list[Circle]
    colour_bar: Colorbar


@house_style()
def draw_policy(
    axes: Axes,
    scene: Scene,
    visits: FloatArray,
    *,
    robot_radius_m: float | None = None,
    window_m: Window | None = None,
    title: str = "",
    legend: bool = True,
) -> DrawnCells:
    """Draw where a policy leads: expected visits of every cell, on a logarithmic scale (Fig. 8 left).

    Args:
        axes: Where to draw.
        scene: The scene.
        visits: (n,) expected visits by state, from the scene's start.
        robot_radius_m: Draws the robot at its start to scale, m.
        window_m: Borders of what is shown, m; None: around the paths, or the whole map where it is not much larger.
        title: Title of the panel.
        legend: Whether to put a legend below.

    Returns:
        The artists.

    Raises:
        ValueError: There is not one number for each state.
    """
    _check(scene, visits)
    window = _window(scene, visits >= LEAST_VISITS) if window_m is None else window_m
    image = _draw_cells(axes, scene, visits, LogNorm(LEAST_VISITS, max(1.0, float(visits.max()))), VISITS_MAP)
    bar = _draw_bar(axes, image, window, "expected visits", extend="min")
    return _draw_scene(image, bar, scene, window, robot_radius_m, title=title, legend=legend)


@house_style()
def draw_reward(
    axes: Axes,
    scene: Scene,
    reward_by_cell: FloatArray,
    *,
    robot_radius_m: float | None = None,
    window_m: Window | None = None,
    title: str = "",
    legend: bool = True,
) -> DrawnCells:
    """Draw the part of the reward that belongs to the cell (Fig. 8 right).

    Colours span the values within REACH_M of the nominal path and of people, so that far corners of the map do not wash
    them out; the colour bar has a pointed end where shown cells lie beyond. The cost of the way belongs to the move and
    is not in it.

    Args:
        axes: Where to draw.
        scene: The scene.
        reward_by_cell: (n,) dimensionless reward of a step in every state.
        robot_radius_m: Draws the robot at its start to scale, m.
        window_m: Borders of what is shown, m; None: around the paths, or the whole map where it is not much larger.
        title: Title of the panel.
        legend: Whether to put a legend below.

    Returns:
        The artists.

    Raises:
        ValueError: There is not one number for each state.
    """
    _check(scene, reward_by_cell)
    window = _window(scene, scene.nominal) if window_m is None else window_m
    shown = _inside(scene, window)
    near = shown & _within_reach(scene)
    spanned, seen = reward_by_cell[near if near.any() else shown], reward_by_cell[shown]
    image = _draw_cells(axes, scene, reward_by_cell, Normalize(spanned.min(), spanned.max()), REWARD_MAP)
    ends = bool(seen.min() < spanned.min()), bool(seen.max() > spanned.max())
    bar = _draw_bar(axes, image, window, "state reward per step (without cost of way)", extend=_EXTEND[ends])
    return _draw_scene(image, bar, scene, window, robot_radius_m, title=title, legend=legend)


def _check(scene: Scene, values: FloatArray) -> None:
    """Refuse numbers that are not one for each state."""
    if values.shape != (scene.lattice.size,):
        raise ValueError(f"one number for each of {scene.lattice.size} states is needed, found shape {values.shape}")


def _window(scene: Scene, shown: BoolArray) -> Window:
    """What to show of a scene: its nominal path, the (n,) cells that matter, and the surroundings."""
    return window_around([scene.lattice.grid], scene.lattice.xy_m[shown | scene.nominal])


def _inside(scene: Scene, window: Window) -> BoolArray:
    """(n,) cells that a window shows; all where it shows none."""
    x, y = scene.lattice.xy_m.T
    inside: BoolArray = (x > window[0]) & (x < window[1]) & (y > window[2]) & (y < window[3])
    return inside if inside.any() else np.ones_like(inside)


def _within_reach(scene: Scene) -> BoolArray:
    """(n,) cells within REACH_M of the nominal path or of a person."""
    near: BoolArray = scene.deviation_m <= REACH_M
    for person in scene.people_m:
        near |= np.hypot(*(scene.lattice.xy_m - person).T) <= REACH_M
    return near


def _draw_cells(axes: Axes, scene: Scene, values: FloatArray, norm: Normalize, colours: Colormap) -> AxesImage:
    """An image of (n,) numbers by state."""
    columns, rows = scene.lattice.cells.T
    table = np.full(scene.lattice.grid.shape, np.nan)
    table[rows, columns] = values
    cells = np.ma.masked_invalid(table)
    extent = scene.lattice.grid.extent_m
    look: dict[str, Any] = {"interpolation": "nearest", "rasterized": True, "zorder": 0}
    return axes.imshow(cells, cmap=colours, norm=norm, extent=extent, origin="lower", **look)


def _draw_bar(axes: Axes, image: AxesImage, window: Window, label: str, extend: str) -> Colorbar:
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


def _draw_scene(
    image: AxesImage,
    bar: Colorbar,
    scene: Scene,
    window: Window,
    robot_radius_m: float | None,
    *,
    title: str,
    legend: bool,
) -> DrawnCells:
    """Everything that stands on the cells, and the frame around them."""
    axes, ends = image.axes, scene.lattice.xy_m[[scene.start, scene.goal]]
    obstacles = draw_obstacles(axes, scene.lattice.grid)
    nominal = draw_nominal(axes, scene.nominal_line_m())
    people = draw_people(axes, scene.people_m, filled=False)
    _, robots = draw_starts(axes, ends[:1], robot_radius_m)
    draw_goals(axes, ends[1:])
    frame(axes, window, title)
    if legend:
        legend_below(axes, ground_handles(people, robots, nominal=True, filled=False))
    return DrawnCells(axes, window, image, obstacles, nominal, people, bar)
