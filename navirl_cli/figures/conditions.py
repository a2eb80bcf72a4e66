"""Driven paths by condition, one panel for each (Figs. 3 and 5)."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.groups import by_group
from navirl_cli.figures.ground import Window
from navirl_cli.figures.marks import merged_handles
from navirl_cli.figures.paths import DrawnPaths, contact_handle, draw_paths, group_handles, window_of
from navirl_cli.figures.sheet import common_legend, outer_labels
from navirl_cli.figures.style import house_style, panel_width_in

#: More paths than these have a panel for each group.
MANY = 40
#: Mean width of a letter of a title, including a share of the labels beside the map, inches.
_LETTER_IN = 0.08


@dataclass(frozen=True)
class DrawnPanels:
    """The artists of :func:`draw_path_panels`."""

    #: One for each condition.
    panels: list[DrawnPaths]
    #: Limits of the view of every panel.
    window_m: Window
    legend: Legend


def panels_of(demonstrations: Sequence[Demonstration]) -> list[tuple[str, Sequence[Demonstration]]]:
    """The panels in which demonstrations are legible: one for each group of more than MANY; none for one map of all."""
    groups = by_group(demonstrations)
    return list(groups.items()) if len(demonstrations) > MANY and len(groups) > 1 else []


@house_style()
def draw_path_panels(
    axes: Sequence[Axes], panels: Sequence[tuple[str, Sequence[Demonstration]]], *, crop: bool = False
) -> DrawnPanels:
    """Draw the driven paths of several conditions, one panel for each, with the same view of the map.

    Only the outermost panels have labels on their axes. One legend is below all.

    Args:
        axes: One for each panel, as :func:`navirl_cli.figures.sheet.new_figure` gives them.
        panels: Titles and demonstrations, all in the same map frame. Titles get the number of paths.
        crop: Show only the paths' surroundings.

    Returns:
        The artists.

    Raises:
        DemonstrationError: No panel, or a panel without demonstrations.
    """
    if not panels:
        raise DemonstrationError("no condition to draw")
    for title, members in panels:
        if not members:
            raise DemonstrationError(f"no demonstration to draw for the panel {title!r}")
    everyone = [one for _, members in panels for one in members]
    shared: dict[str, Any] = {"window_m": window_of(everyone, crop=crop), "among": everyone, "legend": False}
    drawn = [
        draw_paths(panel, members, title=_title(panel, title, len(members)), **shared)
        for panel, (title, members) in zip(axes, panels, strict=True)
    ]
    outer_labels(axes)
    return DrawnPanels(drawn, shared["window_m"], common_legend(axes, _handles(drawn, panels)))


def _title(axes: Axes, title: str, count: int) -> str:
    """A panel's title with the number of paths, in lines at most as wide as the panel."""
    paths = f"(n\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}{count})"
    return fill(f"{title} {paths}", int(panel_width_in(axes) / _LETTER_IN))


def _handles(drawn: Sequence[DrawnPaths], panels: Sequence[tuple[str, Sequence[Demonstration]]]) -> list[Artist]:
    """Legend entries of groups that are not the titles, of contact if there was any, and of the maps' marks."""
    known = [(title, list(by_group(members))) for title, members in panels]
    groups = [name for title, own in known if own != [title] for name in own]
    contact = [contact_handle()] if any(one.contacts for one in drawn) else []
    return [*group_handles(dict.fromkeys(groups)), *contact, *merged_handles([one.marks for one in drawn])]
