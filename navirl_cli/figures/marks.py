"""Marks on every map: people, robot, start, goal, nominal path, and their entries in the legend."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.figures.ground import Window, frame, inside
from navirl_cli.figures.scale import draw_scale_bar
from navirl_cli.figures.style import look

#: Opacity where the discs of all people overlap.
_OPACITY = 0.9
#: Width of a person's outline on a plain map, and on colours, where it must differ from the robot's, points.
_OUTLINE_PT, _OUTLINE_ON_COLOURS_PT, _ROBOT_PT = 0.8, 1.2, 0.6


@dataclass(frozen=True, eq=False)
class Places:
    """Places to be marked on a map, each (k, 2) m, map frame."""

    starts_m: FloatArray
    goals_m: FloatArray
    people_m: FloatArray
    #: Radius of the robot, which is drawn at its starts to scale, m; None for no robot.
    robot_radius_m: float | None


@dataclass(frozen=True)
class Marks:
    """The artists of :func:`draw_marks`."""

    #: Outlines of people and of the robot at its starts.
    people: list[Circle]
    robots: list[Circle]
    #: Goals within the view, and a marker for each goal outside of it.
    goals: Line2D | None
    beyond: list[Line2D]
    nominal: Line2D | None
    #: None where a narrow panel has no room for it.
    scale_bar: Line2D | None
    #: People of whom at least a part is visible.
    seen: list[Circle]
    #: Whether people are those of several trials, not all present at once.
    filled: bool
    #: Whether people are filled discs.
    discs: bool

    def handles(self) -> list[Artist]:
        """Legend entries of the marks, including obstacles."""
        handles: list[Artist] = [] if self.nominal is None else [Line2D([], [], **_nominal())]
        handles.append(Line2D([], [], **_start()))
        if self.goals is not None:
            handles.append(Line2D([], [], **_goal()))
        if self.beyond:
            handles.append(Line2D([], [], **_beyond(0.0)))
        if self.robots:
            handles.append(_disc("robot", look().paper, _ROBOT_PT))
        if self.seen:
            alike = len({str(one.get_linestyle()) for one in self.seen}) == 1
            label = f"person ({len(self.seen)} places)" if alike else "person (outlined like its paths)"
            label = label if self.filled and len(self.seen) > 1 else "person"
            handles.append(_disc(label, look().person if self.discs else "none", self.seen[0].get_linewidth()))
        return [*handles, Patch(facecolor=look().obstacle, edgecolor="none", label="obstacle, inflated")]


def draw_marks(
    axes: Axes,
    window: Window,
    places: Places,
    *,
    nominal: Line2D | None = None,
    lines: Sequence[Any] = (),
    title: str = "",
    opaque: bool = False,
) -> Marks:
    """Draw the marks of a map, its frame and a scale bar.

    Args:
        axes: Those of the map, with paths or colours already drawn.
        window: Limits of the view, m.
        places: What to mark. Goals outside of the window are arrows at its border.
        nominal: The nominal path of a map with colours; None on a plain map, where people are filled discs.
        lines: Line styles of the people's outlines, one for each; empty for solid lines.
        title: Title of the panel.
        opaque: Whether people on colours are filled discs too.

    Returns:
        The artists.
    """
    people = draw_people(axes, places.people_m, filled=nominal is None or opaque, on_colours=nominal is not None)
    for outline, line in zip(people, lines, strict=False):
        outline.set_linestyle(line)
    robots = draw_starts(axes, places.starts_m, places.robot_radius_m, on_colours=nominal is not None)[1]
    goals, beyond = draw_goals(axes, places.goals_m, window)
    frame(axes, window, title)
    bar = draw_scale_bar(axes, window)
    seen = [one for one in people if inside(window, np.array([one.center]), PERSON_RADIUS_M).all()]
    return Marks(people, robots, goals, beyond, nominal, bar, seen, nominal is None, nominal is None or opaque)


def draw_people(axes: Axes, people_m: FloatArray, *, filled: bool, on_colours: bool = False) -> list[Circle]:
    """Draw (p, 2) people, m, map frame, as circles to scale.

    Filled discs are below the paths. Their opacity falls with the number of people, because people of several trials
    overlap. Outlines without fill leave the colours below visible.

    Returns:
        The outlines.
    """
    opacity = 1 - (1 - _OPACITY) ** (1 / max(1, len(people_m)))
    fill = {"facecolor": (look().person, opacity), "linewidth": 0, "zorder": 2}
    for x, y in people_m if filled else ():
        axes.add_patch(Circle((x, y), PERSON_RADIUS_M, **fill))
    line: dict[str, Any] = {"fill": False, "edgecolor": look().ink, "linewidth": _OUTLINE_PT, "zorder": 4}
    if on_colours or not filled:
        halo = (withStroke(linewidth=2.4, foreground=look().paper),)
        line |= {"linewidth": _OUTLINE_ON_COLOURS_PT, "path_effects": halo}
    outlines = [Circle((x, y), PERSON_RADIUS_M, **line) for x, y in people_m]
    for outline in outlines:
        axes.add_patch(outline)
    return outlines


def draw_starts(
    axes: Axes, starts_m: FloatArray, robot_radius_m: float | None, *, on_colours: bool = False
) -> tuple[Line2D, list[Circle]]:
    """Mark (k, 2) starts, m, map frame, with the robot's outline to scale if its radius is known.

    Starts within a radius of each other share an outline, which is visible on any colour where that is wanted.

    Returns:
        The markers and the outlines.
    """
    outlines: list[Circle] = []
    line: dict[str, Any] = {"fill": False, "edgecolor": look().ink, "linewidth": _ROBOT_PT, "zorder": 5}
    if on_colours:
        line["path_effects"] = (withStroke(linewidth=1.8, foreground=look().paper),)
    for x, y in starts_m if robot_radius_m else ():
        if all(np.hypot(x - o.center[0], y - o.center[1]) >= robot_radius_m for o in outlines):
            outlines.append(Circle((x, y), robot_radius_m or 0.0, **line))
            axes.add_patch(outlines[-1])
    (markers,) = axes.plot(*starts_m.T, zorder=6, **_start())
    return markers, outlines


def draw_goals(axes: Axes, goals_m: FloatArray, window: Window) -> tuple[Line2D | None, list[Line2D]]:
    """Mark (k, 2) goals, m, map frame: stars, or arrows at the window's border towards goals outside of it.

    Returns:
        The stars, or None without a goal in the window, and the arrows.
    """
    shown = inside(window, goals_m)
    stars = axes.plot(*goals_m[shown].T, zorder=6, **_goal())[0] if shown.any() else None
    low, high = np.array(window[::2]), np.array(window[1::2])
    inset = 0.02 * (high - low).max()
    arrows = []
    for goal in goals_m[~shown]:
        at = np.clip(goal, low + inset, high - inset)
        away = np.arctan2(*(goal - at)[::-1])
        arrows += axes.plot(*at[:, None], zorder=6, **_beyond(float(away)))
    return stars, arrows


def draw_nominal(axes: Axes, line_m: FloatArray) -> Line2D:
    """Draw the nominal path, a (k, 2) line, m, map frame, visible on any colour."""
    halo = (withStroke(linewidth=2.2, foreground=look().paper),)
    (line,) = axes.plot(*line_m.T, zorder=3, path_effects=halo, **_nominal())
    return line


def merged_handles(marks: Sequence[Marks]) -> list[Artist]:
    """Legend entries of the marks of several maps, each once."""
    handles: dict[str, Artist] = {}
    for one in sorted(marks, key=lambda one: len(one.seen)):  # the last one counts: the most places of people
        handles = {_kind(handle): handle for handle in [*handles.values(), *one.handles()]}
    order = ["nominal path", "start", "goal", "goal outside", "robot", "person", "obstacle, inflated"]
    return [handles[kind] for kind in order if kind in handles]


def _kind(handle: Artist) -> str:
    """An entry's label without its number."""
    return str(handle.get_label()).split(" (")[0]


def _start() -> dict[str, Any]:
    """Look of a start."""
    colours = {"markerfacecolor": look().paper, "markeredgecolor": look().ink}
    return {"linestyle": "none", "marker": "o", "markersize": 3.5, "markeredgewidth": 0.8, "label": "start", **colours}


def _goal() -> dict[str, Any]:
    """Look of a goal."""
    colours = {"markerfacecolor": look().ink, "markeredgecolor": look().paper}
    return {"linestyle": "none", "marker": "*", "markersize": 8, "markeredgewidth": 0.5, "label": "goal", **colours}


def _beyond(direction_rad: float) -> dict[str, Any]:
    """Look of a goal outside of the view, in a direction from the x axis."""
    along = np.array([np.cos(direction_rad), np.sin(direction_rad)])
    aside = np.array([-along[1], along[0]])
    head = np.stack([along, 0.5 * aside - along, -0.5 * aside - along, along])
    return {**_goal(), "marker": head, "markersize": 9, "label": "goal outside"}


def _nominal() -> dict[str, Any]:
    """Look of the nominal path."""
    return {"color": look().ink, "linewidth": 1.0, "linestyle": (0, (4, 2)), "label": "nominal path"}


def _disc(label: str, colour: str, edge_pt: float) -> Line2D:
    """Legend entry of a person or the robot."""
    line: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 7, "markeredgecolor": look().ink}
    return Line2D([], [], label=label, markerfacecolor=colour, markeredgewidth=edge_pt, **line)
