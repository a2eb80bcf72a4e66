"""All demonstrated paths over their map (Fig. 3)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from navirl_cli.demos.demonstration import Contact, Demonstration
from navirl_cli.demos.grid import FloatArray, Grid
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.compare import by_group
from navirl_cli.figures.ground import (
    Window,
    draw_goals,
    draw_obstacles,
    draw_people,
    draw_starts,
    frame,
    ground_handles,
    legend_below,
    window_around,
)
from navirl_cli.figures.style import colour_of, house_style

#: Widths of a path and of its stretches in contact, points.
_PATH_PT, _CONTACT_PT = 0.7, 1.7
#: People nearer to each other than this are one, m.
_SAME_M = 0.02


@dataclass(frozen=True)
class DrawnPaths:
    """What :func:`draw_paths` put on the axes."""

    axes: Axes
    #: One for each map; demonstrations on the same cells share one.
    obstacles: list[AxesImage]
    #: One for each demonstration, in the order of the legend's groups.
    lines: list[Line2D]
    #: One for each interval of contact.
    contacts: list[Line2D]
    #: Outlines of people, one for each distinct place.
    people: list[Circle]
    #: Outlines of the robot where paths start.
    robots: list[Circle]


@house_style()
def draw_paths(
    axes: Axes,
    demonstrations: Sequence[Demonstration],
    *,
    window_m: Window | None = None,
    title: str = "",
    legend: bool = True,
) -> DrawnPaths:
    """Draw the driven paths of demonstrations, one colour a group, thicker where the person pushed.

    Args:
        axes: Where to draw.
        demonstrations: All in the same map frame.
        window_m: Borders of what is shown, m; None: around the paths, or the whole map where it is not much larger.
        title: Title of the panel.
        legend: Whether to put a legend below.

    Returns:
        The artists.

    Raises:
        DemonstrationError: There is no demonstration.
    """
    if not demonstrations:
        raise DemonstrationError("no demonstration to draw")
    grids = _maps(demonstrations)
    obstacles = [draw_obstacles(axes, grid) for grid in grids]
    groups = by_group(demonstrations)
    lines, contacts = [], []
    for group, members in groups.items():
        for one in members:
            contacts.extend(_contacts(axes, one, colour_of(group)))
            lines.append(_path(axes, one, colour_of(group)))
    people = draw_people(axes, _distinct(np.concatenate([one.people_m for one in demonstrations])), filled=True)
    starts = np.array([one.xy_m[0] for one in demonstrations])
    _, robots = draw_starts(axes, starts, max(one.robot_radius_m for one in demonstrations))
    goals = np.unique([one.goal_m for one in demonstrations], axis=0)
    draw_goals(axes, goals)
    seen = np.concatenate([*(one.xy_m for one in demonstrations), goals])
    frame(axes, window_around(grids, seen) if window_m is None else window_m, title)
    if legend:
        marks = ground_handles(people, robots, nominal=False, filled=True)
        legend_below(axes, [*_group_handles(groups, in_contact=bool(contacts)), *marks])
    return DrawnPaths(axes, obstacles, lines, contacts, people, robots)


def _maps(demonstrations: Iterable[Demonstration]) -> list[Grid]:
    """The maps of demonstrations; where several share cells, what one of them drove through is free."""
    maps: dict[object, Grid] = {}
    for grid in (one.grid for one in demonstrations):
        place = grid.shape, grid.resolution_m, grid.origin_m
        known = maps.get(place, grid)
        maps[place] = Grid(known.occupied & grid.occupied, grid.resolution_m, grid.origin_m)
    return list(maps.values())


def _distinct(points_m: FloatArray) -> FloatArray:
    """(k, 2) of (n, 2) points, m, without those that stand where another stands."""
    _, first = np.unique(np.round(points_m / _SAME_M), axis=0, return_index=True)
    return points_m[np.sort(first)]


def _path(axes: Axes, one: Demonstration, colour: str) -> Line2D:
    """One driven path."""
    (line,) = axes.plot(*one.xy_m.T, color=colour, linewidth=_PATH_PT, zorder=3)
    return line


def _contacts(axes: Axes, one: Demonstration, colour: str) -> list[Line2D]:
    """The stretches of a path on which the person pushed."""
    band: dict[str, Any] = {"color": colour, "linewidth": _CONTACT_PT, "solid_capstyle": "butt", "zorder": 3}
    return [axes.plot(*_stretch(one, contact).T, **band)[0] for contact in one.contacts or ()]


def _stretch(one: Demonstration, contact: Contact) -> FloatArray:
    """(k, 2) m: the path between the first and the last instant of a contact."""
    inside = one.t_s[(one.t_s > contact.start_s) & (one.t_s < contact.end_s)]
    at = np.concatenate([[contact.start_s], inside, [contact.end_s]])
    return np.stack([np.interp(at, one.t_s, axis) for axis in one.xy_m.T], axis=1)


def _group_handles(groups: dict[str, list[Demonstration]], *, in_contact: bool) -> list[Artist]:
    """Legend entries of the groups with their numbers of paths, and of contact."""
    handles: list[Artist] = [
        Line2D([], [], color=colour_of(group), linewidth=1.0, label=f"{group} (n = {len(members)})")
        for group, members in groups.items()
    ]
    if in_contact:
        grey: dict[str, Any] = {"color": "0.3", "linewidth": _CONTACT_PT}
        handles.append(Line2D([], [], label="in contact", **grey))
    return handles
