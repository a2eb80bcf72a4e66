"""Propagated policy and state reward, one row for each scene (Figs. 8 and 9)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.legend import Legend

from navirl_cli.errors import SceneError
from navirl_cli.figures.cells import EXTEND, REWARD, VISITS, DrawnCells, draw_policy, draw_reward, plain_numbers
from navirl_cli.figures.ground import Window
from navirl_cli.figures.layout import PAD_IN
from navirl_cli.figures.marks import merged_handles
from navirl_cli.figures.sheet import common_legend, outer_labels
from navirl_cli.figures.style import house_style, panel_width_in
from navirl_cli.irl.solved import SolvedScene

#: A title, and a scene under a reward.
TitledScene = tuple[str, SolvedScene]
#: Mean width of a letter, width of the labels beside a map, and thickness of a colour bar, inches.
_LETTER_IN, _BESIDE_IN, _BAR_IN = 0.055, 0.35, 0.08


@dataclass(frozen=True)
class DrawnPolicies:
    """The artists of :func:`draw_policy_and_reward`, by scene."""

    #: All share one colour bar.
    policies: list[DrawnCells]
    #: All share another.
    rewards: list[DrawnCells]
    legend: Legend


@house_style()
def draw_policy_and_reward(
    axes: Sequence[Axes], scenes: Sequence[TitledScene], robot_radius_m: float, window_m: Window | None = None
) -> DrawnPolicies:
    """Draw the propagated policy and the state reward side by side, one row for each scene.

    Equal colours are equal values in all scenes. One colour bar is above all policies and one above all rewards.

    Args:
        axes: Two for each scene, in rows of two, as :func:`navirl_cli.figures.sheet.new_figure` gives them.
        scenes: Several scenes under one reward, or one scene under several, with their titles.
        robot_radius_m: Radius of the robot, which is drawn at its start to scale, m.
        window_m: Limits of the view of every map, m; None: the surroundings of each scene's paths.

    Returns:
        The artists.

    Raises:
        SceneError: No scene.
        ValueError: The number of values is not the number of states.
    """
    if not scenes:
        raise SceneError("no scene to draw")
    policies, rewards = [], []
    look: dict[str, Any] = {"robot_radius_m": robot_radius_m, "legend": False, "scale": False, "opaque_people": False}
    for (title, one), left, right in zip(scenes, axes[::2], axes[1::2], strict=True):
        policies.append(draw_policy(left, one.scene, one.visits, window_m=window_m, **look))
        rewards.append(draw_reward(right, one.scene, one.reward_by_cell, window_m=policies[-1].window_m, **look))
        # The title is that of the row: it may extend over the panel on the right.
        left.set_title(fill(title, int(2 * (panel_width_in(left) - _BESIDE_IN) / _LETTER_IN)), loc="left")
    alike = len({drawn.window_m for drawn in policies}) == 1
    for rows in [axes] if alike else [axes[at : at + 2] for at in range(0, len(axes), 2)]:
        outer_labels(rows)
    handles = merged_handles([drawn.marks for drawn in policies])
    return DrawnPolicies(share_colours(policies, VISITS), share_colours(rewards, REWARD), common_legend(axes, handles))


def share_colours(drawn: Sequence[DrawnCells], label: str) -> list[DrawnCells]:
    """Give maps without colour bars the same range of colours, and one common colour bar above them.

    Args:
        drawn: Maps of one quantity, in one or in several columns.
        label: Of the colour bar.

    Returns:
        The maps, each with the colour bar.
    """
    clims = [one.image.get_clim() for one in drawn]
    low, high = min(clim[0] for clim in clims), max(clim[1] for clim in clims)
    tables = [table for one in drawn if (table := one.image.get_array()) is not None]
    ends = any(table.min() < low for table in tables), any(table.max() > high for table in tables)
    panels, window = [one.axes for one in drawn], drawn[0].window_m
    for one in drawn:
        one.image.set_clim(low, high)
    specs = [spec for panel in panels if (spec := panel.get_subplotspec()) is not None]
    columns = max(1, len({spec.colspan.start for spec in specs}))
    width_in = columns * panel_width_in(panels[0])
    map_in = panel_width_in(panels[0]) - _BESIDE_IN
    height_in = ceil(len(drawn) / columns) * map_in * (window[3] - window[2]) / (window[1] - window[0])
    place: dict[str, Any] = {"location": "top", "pad": PAD_IN / height_in, "aspect": width_in / _BAR_IN}
    look: dict[str, Any] = {"extend": EXTEND[ends], "extendfrac": 0.03}
    bar = panels[0].figure.colorbar(drawn[0].image, ax=panels, **place, **look)
    plain_numbers(bar)
    bar.outline.set_linewidth(0.5)
    bar.set_label(fill(label, int((width_in - _BESIDE_IN) / _LETTER_IN)), labelpad=4.0)
    return [replace(one, colour_bar=bar) for one in drawn]
