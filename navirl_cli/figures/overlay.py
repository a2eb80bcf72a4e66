"""Thin paths over the values of a map: demonstrated ones, and ones sampled from a policy."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import Number, counted
from navirl_cli.evaluation.compare import LEARNT
from navirl_cli.evaluation.groups import by_group
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.figures.style import colour_of, look

#: Width of a path and of the light border around it, points; and of more paths than so many, with their opacity.
_PATH_PT, _HALO_PT = 0.9, 2.1
_MANY, _MANY_PT, _MANY_HALO_PT, _OPACITY = 10, 0.7, 1.3, 0.6
#: Starts farther from each other than this are different tasks, m.
SAME_START_M = 0.25


@dataclass(frozen=True, eq=False)
class Overlay:
    """Paths of one type."""

    #: Label in the legend, and key of the colour, as ``style.colour_of`` takes it.
    label: str
    key: str
    #: Each (k, 2) m, map frame.
    lines_m: Sequence[FloatArray]


def overlays_of(demonstrations: Iterable[Demonstration], sampled_m: Sequence[FloatArray] = ()) -> list[Overlay]:
    """Driven paths by group and, above them, paths sampled from a policy.

    Args:
        demonstrations: Those to draw.
        sampled_m: Paths sampled from the policy, each (k, 2), m, map frame.
    """
    overlays = [Overlay(group, group, [one.xy_m for one in own]) for group, own in by_group(demonstrations).items()]
    return [*overlays, *([Overlay("sampled from the policy", LEARNT, sampled_m)] if len(sampled_m) else [])]


def alike(demonstrations: Iterable[Demonstration], one: Demonstration) -> list[Demonstration]:
    """Demonstrations of the same task as one, including itself: same map, people, start and goal.

    Starts may differ by SAME_START_M, ends by the robot's radius, people by a person's radius.
    """
    return [other for other in demonstrations if _same_task(other, one)]


def driven(
    demonstrations: Sequence[Demonstration], one: Demonstration, *, everywhere: bool = False
) -> tuple[list[Demonstration], str]:
    """Demonstrations to draw over the scene of one, and in one line what is left out.

    Args:
        demonstrations: To choose from.
        one: Gives scene and participant.
        everywhere: All on its map, whatever the scene and the participant.
    """
    if everywhere:
        shown = [other for other in demonstrations if _map_of(other) == _map_of(one)]
        left = len(demonstrations) - len(shown)
        return (
            shown,
            f"`overlay` all: {left} path{Number(left):|s} on other maps {Number(left):is|are} left out" if left else "",
        )
    shown = [other for other in alike(demonstrations, one) if other.participant == one.participant]
    left = len(demonstrations) - len(shown)
    note = (
        f"`overlay` demos: {len(shown)} of {counted(len(demonstrations), 'path')}, those of {one.participant} "
        f"in the scene of "
        f"{one.id}; `overlay` all draws the others too"
    )
    return shown, note if left else ""


def _map_of(one: Demonstration) -> tuple[object, ...]:
    """What maps are compared by."""
    return one.grid.shape, one.grid.resolution_m, one.grid.origin_m


def _same_task(one: Demonstration, other: Demonstration) -> bool:
    """Whether two demonstrations are of the same task."""
    if _map_of(one) != _map_of(other) or len(one.people_m) != len(other.people_m):
        return False
    start, end = np.hypot(*(one.xy_m[[0, -1]] - other.xy_m[[0, -1]]).T)
    away = np.hypot(*(one.people_m[:, None] - other.people_m[None]).T)  # (p, p)
    alone = away.size and max(away.min(axis=0).max(), away.min(axis=1).max()) > PERSON_RADIUS_M
    return bool(start <= SAME_START_M and end <= other.robot_radius_m and not alone)


def draw_overlays(axes: Axes, overlays: Iterable[Overlay]) -> list[Line2D]:
    """Draw thin paths over a map; many paths of one type are partly transparent.

    Returns:
        A line for each path.
    """
    lines = []
    for one in overlays:
        few = len(one.lines_m) <= _MANY
        opacity, width, border = (1.0, _PATH_PT, _HALO_PT) if few else (_OPACITY, _MANY_PT, _MANY_HALO_PT)
        halo = withStroke(linewidth=border, foreground=look().paper, alpha=0.8 if few else opacity / 2)
        for line_m in one.lines_m:
            lines += axes.plot(*line_m.T, color=colour_of(one.key), linewidth=width, alpha=opacity, zorder=3.5)
            lines[-1].set_path_effects([halo])
    return lines


def overlay_handles(overlays: Iterable[Overlay]) -> list[Artist]:
    """Legend entries with the numbers of paths."""
    return [
        Line2D([], [], color=colour_of(one.key), linewidth=1.0, label=f"{one.label} (n = {len(one.lines_m)})")
        for one in overlays
    ]
