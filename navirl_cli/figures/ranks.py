"""Ranks of demonstrations among paths of a policy, compared with uniform ranks."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.ground import legend_below
from navirl_cli.figures.style import colour_of, house_style, look

#: Opacity of the band.
_OPACITY = 0.18


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
def draw_ranks(axes: Axes, ranks: FloatArray, p_value: float, level: float = 0.95) -> DrawnRanks:
    """Draw the distribution of ranks and the uniform one, which demonstrations from the policy have.

    Steps above the diagonal at low ranks are demonstrations that are improbable under the policy. Steps far below it
    are demonstrations that are more typical than the policy's own paths. The band contains all steps together
    (Kolmogorov and Smirnov).

    Args:
        axes: Where to draw.
        ranks: (n,) shares of the policy's paths that are less likely than each demonstration, in [0, 1].
        p_value: Of the Kolmogorov-Smirnov test for uniform ranks.
        level: Probability of the band.

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
    axes.set_box_aspect(0.6)
    shown = "p < 0.001" if p_value < 1e-3 else f"p = {p_value:.2g}"
    axes.set_title(f"n = {count}, {shown} (Kolmogorov-Smirnov)")
    legend_below(axes, [steps, uniform, band])
    return DrawnRanks(axes, steps, uniform, band, reach)
