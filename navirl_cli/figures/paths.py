"""All driven paths over their map (Fig. 3)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Contact, Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.groups import by_group
from navirl_cli.figures.ground import Window, cropped_to, draw_obstacles, legend_below, window_around
from navirl_cli.figures.marks import Marks, Places, draw_marks
from navirl_cli.figures.style import colour_of, house_style

#: Widths of a path and of its sections in contact, points; and those of one of many, with its opacity.
_PATH_PT, _CONTACT_PT = 0.7, 1.7
_MANY, _MANY_PT, _MANY_CONTACT_PT, _MANY_OPACITY = 20, 0.4, 1.1, 0.8
#: People nearer to each other than this are at the same place, m.
_SAME_M = 0.02
#: Line styles of paths by the places of people; with more places than styles, all are solid.
_LINES: tuple[Any, ...] = ("-", (0, (5, 1.2)), (0, (1.2, 0.9)), (0, (5, 1.2, 1.2, 1.2)))


@dataclass(frozen=True)
class DrawnPaths:
    """The artists of :func:`draw_paths`."""

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
    marks: Marks


@house_style()
def draw_paths(
    axes: Axes,
    demonstrations: Sequence[Demonstration],
    *,
    window_m: Window | None = None,
    crop: bool = False,
    title: str = "",
    legend: bool = True,
    among: Sequence[Demonstration] = (),
) -> DrawnPaths:
    """Draw the driven paths of demonstrations, in one colour for each group, thicker in contact.

    Where trials have people at different places, a path and the people of its trial have the same line style.

    Args:
        axes: Where to draw.
        demonstrations: All in the same map frame.
        window_m: Limits of the view, m; None: the paths' surroundings, or all of a map that is not much larger.
        crop: Show only the paths' surroundings, if no window is given.
        title: Title of the panel.
        legend: Whether to put a legend below.
        among: The demonstrations of all panels side by side: a line style then means the same place in all of them.

    Returns:
        The artists.

    Raises:
        DemonstrationError: No demonstration.
    """
    if not demonstrations:
        raise DemonstrationError("no demonstration to draw")
    grids = _maps(demonstrations)
    obstacles = [draw_obstacles(axes, grid) for grid in grids]
    groups, line_of = by_group(demonstrations), _lines_of([*among, *demonstrations])
    lines, contacts, many = [], [], len(demonstrations) > _MANY
    for group, members in groups.items():
        for one in members:
            contacts.extend(_contacts(axes, one, colour_of(group), many=many))
            lines.append(_path(axes, one, colour_of(group), line_of[_places(one)], many=many))
    window = window_of(demonstrations, crop=crop) if window_m is None else window_m
    people = _distinct(np.concatenate([one.people_m for one in demonstrations]))
    starts = np.array([one.xy_m[0] for one in demonstrations])
    goals = np.unique([one.goal_m for one in demonstrations], axis=0)
    places = Places(starts, goals, people, max(one.robot_radius_m for one in demonstrations))
    same = [_line_of_person(person, line_of) for person in people]
    marks = draw_marks(axes, window, places, lines=same, title=title)
    if legend:
        contact = [contact_handle()] if contacts else []
        counts = {group: len(members) for group, members in groups.items()}
        legend_below(axes, [*group_handles(groups, counts), *contact], marks.handles())
    return DrawnPaths(axes, obstacles, lines, contacts, marks.people, marks.robots, marks)


def window_of(demonstrations: Sequence[Demonstration], *, crop: bool) -> Window:
    """Limits of the view of demonstrations: their paths and goals with a margin.

    Args:
        demonstrations: All in the same map frame.
        crop: Show only the paths' surroundings.

    Returns:
        Limits, m, map frame.
    """
    grids, paths = _maps(demonstrations), np.concatenate([one.xy_m for one in demonstrations])
    if crop:
        return cropped_to(grids, paths, np.concatenate([one.people_m for one in demonstrations]))
    return window_around(grids, np.concatenate([paths, [one.goal_m for one in demonstrations]]))


def _maps(demonstrations: Iterable[Demonstration]) -> list[Grid]:
    """The maps of demonstrations. On a shared map, cells through which any of them drove are free."""
    maps: dict[object, Grid] = {}
    for grid in (one.grid for one in demonstrations):
        place = grid.shape, grid.resolution_m, grid.origin_m
        known = maps.get(place, grid)
        maps[place] = Grid(known.occupied & grid.occupied, grid.resolution_m, grid.origin_m)
    return list(maps.values())


def _distinct(points_m: FloatArray) -> FloatArray:
    """(k, 2) of (n, 2) points, m, without repeated places."""
    _, first = np.unique(np.round(points_m / _SAME_M), axis=0, return_index=True)
    return points_m[np.sort(first)]


def _places(one: Demonstration) -> tuple[tuple[int, int], ...]:
    """Places of the people of a trial: equal for trials with people at the same places."""
    return tuple(sorted((int(x), int(y)) for x, y in np.round(one.people_m / _SAME_M)))


def _lines_of(demonstrations: Iterable[Demonstration]) -> dict[tuple[tuple[int, int], ...], Any]:
    """Line styles by the places of people; all solid if there are too many places."""
    known = dict.fromkeys(_places(one) for one in demonstrations)
    peopled = [places for places in known if places]
    lines = _LINES if len(peopled) <= len(_LINES) else _LINES[:1] * len(peopled)
    return {**dict.fromkeys(known, _LINES[0]), **dict(zip(peopled, lines, strict=False))}


def _line_of_person(person_m: FloatArray, line_of: dict[tuple[tuple[int, int], ...], Any]) -> Any:
    """Line style of a (2,) person, m: that of its trials, or solid if trials of several styles share the place."""
    x, y = np.round(person_m / _SAME_M)
    lines = [line for places, line in line_of.items() if (int(x), int(y)) in places]
    return lines[0] if len(lines) == 1 else _LINES[0]


def _path(axes: Axes, one: Demonstration, colour: str, style: Any, *, many: bool) -> Line2D:
    """Draw one driven path, thinner as one of many."""
    width: dict[str, Any] = {"linewidth": _MANY_PT, "alpha": _MANY_OPACITY} if many else {"linewidth": _PATH_PT}
    (line,) = axes.plot(*one.xy_m.T, color=colour, linestyle=style, zorder=3, **width)
    return line


def _contacts(axes: Axes, one: Demonstration, colour: str, *, many: bool) -> list[Line2D]:
    """Draw the sections of a path in contact."""
    width = _MANY_CONTACT_PT if many else _CONTACT_PT
    band: dict[str, Any] = {"color": colour, "linewidth": width, "solid_capstyle": "butt", "zorder": 3}
    return [axes.plot(*_section(one, contact).T, **band)[0] for contact in one.contacts or ()]


def _section(one: Demonstration, contact: Contact) -> FloatArray:
    """(k, 2) m: the path between the first and the last instant of a contact."""
    inside = one.t_s[(one.t_s > contact.start_s) & (one.t_s < contact.end_s)]
    at = np.concatenate([[contact.start_s], inside, [contact.end_s]])
    return np.stack([np.interp(at, one.t_s, axis) for axis in one.xy_m.T], axis=1)


def group_handles(groups: Iterable[str], counts: Mapping[str, int] | None = None) -> list[Artist]:
    """Legend entries of groups, with their numbers of paths if given."""
    labels = {group: group if counts is None else f"{group} (n = {counts[group]})" for group in groups}
    return [Line2D([], [], color=colour_of(group), linewidth=1.0, label=label) for group, label in labels.items()]


def contact_handle() -> Artist:
    """Legend entry of sections in contact, for all groups."""
    return Line2D([], [], color="0.5", linewidth=_CONTACT_PT, label="in contact")
