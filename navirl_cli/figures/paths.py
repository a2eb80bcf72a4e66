"""All demonstrated paths over their map (Fig. 3)."""

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

#: Widths of a path and of its stretches in contact, points.
_PATH_PT, _CONTACT_PT = 0.7, 1.7
#: People nearer to each other than this are one, m.
_SAME_M = 0.02
#: Lines of paths with people at one place, at another, and so on; of more places than this all are alike.
_LINES: tuple[Any, ...] = ("-", (0, (5, 1.2)), (0, (1.2, 0.9)), (0, (5, 1.2, 1.2, 1.2)))


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
    """Draw the driven paths of demonstrations, one colour a group, thicker where the person pushed.

    Where trials have people at different places, paths and the people of their trials have the same kind of line.

    Args:
        axes: Where to draw.
        demonstrations: All in the same map frame.
        window_m: Borders of what is shown, m; None: around the paths, or the whole map where it is not much larger.
        crop: Show no more than the paths' surroundings, where no window is given.
        title: Title of the panel.
        legend: Whether to put a legend below.
        among: Those of all panels beside each other, so that one kind of line means one place in all of them.

    Returns:
        The artists.

    Raises:
        DemonstrationError: There is no demonstration.
    """
    if not demonstrations:
        raise DemonstrationError("no demonstration to draw")
    grids = _maps(demonstrations)
    obstacles = [draw_obstacles(axes, grid) for grid in grids]
    groups, line_of = by_group(demonstrations), _lines_of([*among, *demonstrations])
    lines, contacts = [], []
    for group, members in groups.items():
        for one in members:
            contacts.extend(_contacts(axes, one, colour_of(group)))
            lines.append(_path(axes, one, colour_of(group), line_of[_places(one)]))
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
        legend_below(axes, [*group_handles(groups, counts), *contact, *marks.handles()])
    return DrawnPaths(axes, obstacles, lines, contacts, marks.people, marks.robots, marks)


def window_of(demonstrations: Sequence[Demonstration], *, crop: bool) -> Window:
    """What to show of demonstrations: their paths and goals, and the surroundings.

    Args:
        demonstrations: All in the same map frame.
        crop: Whether to show no more than the paths' surroundings.

    Returns:
        Borders, m.
    """
    grids, paths = _maps(demonstrations), np.concatenate([one.xy_m for one in demonstrations])
    if crop:
        return cropped_to(grids, paths, np.concatenate([one.people_m for one in demonstrations]))
    return window_around(grids, np.concatenate([paths, [one.goal_m for one in demonstrations]]))


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


def _places(one: Demonstration) -> tuple[tuple[int, int], ...]:
    """Where the people of a trial stand; equal for trials with people at the same places."""
    return tuple(sorted((int(x), int(y)) for x, y in np.round(one.people_m / _SAME_M)))


def _lines_of(demonstrations: Iterable[Demonstration]) -> dict[tuple[tuple[int, int], ...], Any]:
    """Kinds of line by the places of people; all alike where there are too many of them."""
    known = dict.fromkeys(_places(one) for one in demonstrations)
    peopled = [places for places in known if places]
    lines = _LINES if len(peopled) <= len(_LINES) else _LINES[:1] * len(peopled)
    return {**dict.fromkeys(known, _LINES[0]), **dict(zip(peopled, lines, strict=False))}


def _line_of_person(person_m: FloatArray, line_of: dict[tuple[tuple[int, int], ...], Any]) -> Any:
    """The line of the only trials in which a (2,) person stands there, m; the plain one of who stands in several."""
    x, y = np.round(person_m / _SAME_M)
    lines = [line for places, line in line_of.items() if (int(x), int(y)) in places]
    return lines[0] if len(lines) == 1 else _LINES[0]


def _path(axes: Axes, one: Demonstration, colour: str, kind: Any) -> Line2D:
    """One driven path."""
    (line,) = axes.plot(*one.xy_m.T, color=colour, linewidth=_PATH_PT, linestyle=kind, zorder=3)
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


def group_handles(groups: Iterable[str], counts: Mapping[str, int] | None = None) -> list[Artist]:
    """Legend entries of groups, with their numbers of paths where told."""
    labels = {group: group if counts is None else f"{group} (n = {counts[group]})" for group in groups}
    return [Line2D([], [], color=colour_of(group), linewidth=1.0, label=label) for group, label in labels.items()]


def contact_handle() -> Artist:
    """Legend entry of the stretches in contact, whatever their group."""
    return Line2D([], [], color="0.5", linewidth=_CONTACT_PT, label="in contact")
