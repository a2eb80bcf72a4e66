"""Ranks of demonstrations among paths of a policy, compared with uniform ranks."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.ranks import GroupRanks
from navirl_cli.figures.ground import legend_below
from navirl_cli.figures.sheet import common_legend
from navirl_cli.figures.style import PAGE_IN, colour_of, house_style, look

#: From this p on, two decimals are enough.
_TWO_DIGITS = 0.095
#: Opacity of the band.
_OPACITY = 0.18
#: Height over width of a panel.
_ASPECT = 0.6


@dataclass(frozen=True)
class DrawnRanks:
    """The artists of :func:`draw_ranks`."""

    axes: Axes
    #: Share of demonstrations up to each rank.
    steps: Line2D
    uniform: Line2D
    #: Contains all steps with the level's probability, if ranks are uniform.
    band: PolyCollection
    #: Half of the band's height, as a share.
    reach: float


@house_style()
def draw_ranks(
    axes: Axes, ranks: FloatArray, p_value: float, level: float = 0.95, group: str = "", *, legend: bool = True
) -> DrawnRanks:
    """Draw the distribution of ranks and the uniform one, which demonstrations from the policy have.

    Steps above the diagonal at low ranks are demonstrations that are improbable under the policy. Steps far below it
    are demonstrations that are more typical than the policy's own paths. The band contains all steps together
    (Kolmogorov and Smirnov).

    Args:
        axes: Where to draw.
        ranks: (n,) shares of the policy's paths that are less likely than each demonstration, in [0, 1].
        p_value: Of the Kolmogorov-Smirnov test for uniform ranks.
        level: Probability of the band.
        group: Of the demonstrations, for the title.
        legend: Whether to put a legend below.

    Returns:
        The artists.

    Raises:
        DemonstrationError: No ranks, or one outside of [0, 1].
    """
    from scipy.stats import kstwo

    if not len(ranks):
        raise DemonstrationError("no ranks to draw")
    if not ((ranks >= 0) & (ranks <= 1)).all():
        raise DemonstrationError(f"ranks: expected shares from 0 to 1, found {ranks.min():g} to {ranks.max():g}")
    count, ends = len(ranks), np.array([0.0, 1.0])
    reach = float(kstwo.ppf(level, count))
    corners = np.array([0.0, reach, 1 - reach, 1.0])  # where the band meets 0 and 1
    low, high = np.clip(corners - reach, 0, 1), np.clip(corners + reach, 0, 1)
    name = f"{100 * level:g} % band of uniform ranks"
    band = axes.fill_between(corners, low, high, color=look().ink, alpha=_OPACITY, linewidth=0, label=name)
    (uniform,) = axes.plot(ends, ends, color=look().ink, linewidth=0.8, linestyle=(0, (4, 2)), label="uniform")
    x = np.concatenate([[0.0], np.sort(ranks), [1.0]])
    y = np.concatenate([[0.0], np.arange(1, count + 1) / count, [1.0]])
    colour, label = colour_of("learnt"), "demonstrations"
    (steps,) = axes.step(x, y, where="post", color=colour, linewidth=1.4, label=label, zorder=3)
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel="rank among the policy's paths", ylabel="share of demonstrations")
    axes.set_box_aspect(_ASPECT)
    shown = "p < 0.001" if p_value < 1e-3 else f"p = {p_value:.{2 if p_value >= _TWO_DIGITS else 3}f}"
    above = f"{group}\n" if group else ""
    axes.set_title(f"{above}n = {count}, {shown} (Kolmogorov-Smirnov)")
    if legend:
        legend_below(axes, [steps, uniform, band])
    return DrawnRanks(axes, steps, uniform, band, reach)


def rank_layout(panels: int, width_in: float) -> dict[str, Any]:
    """Panels, columns and height of a figure of ranks, for a number of groups and a width in inches."""
    return {"panels": panels, "columns": 2 if width_in >= PAGE_IN and panels > 1 else 1, "height_in": None}


def draw_rank_panels(axes: Sequence[Axes], groups: Sequence[GroupRanks]) -> list[DrawnRanks]:
    """A panel for each group, with one legend for all: conditions are never pooled.

    Args:
        axes: One for each group.
        groups: Ranks by group.

    Returns:
        The artists of each panel.
    """
    alone = len(groups) == 1
    drawn = [
        draw_ranks(one, np.array([rank.rank for rank in own.ranks]), own.uniformity()[1], group=own.name, legend=alone)
        for one, own in zip(axes, groups, strict=True)
    ]
    if not alone:
        widest = min(drawn, key=lambda one: one.reach)
        common_legend(axes, [widest.steps, widest.uniform, widest.band])
    return drawn
