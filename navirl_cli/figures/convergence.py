"""Convergence of a fit: log-likelihood and parameters over the iterations."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from navirl_cli.arrays import FloatArray
from navirl_cli.figures.profile import symbol_of
from navirl_cli.figures.style import PAGE_IN, colour_of, house_style
from navirl_cli.irl.terms.term import Parameter

#: Height of a row of panels with its labels, inches; largest number of iterations with a marker each.
ROW_IN, _MARKED = 1.3, 40


@dataclass(frozen=True)
class DrawnConvergence:
    """The artists of :func:`draw_convergence`."""

    axes: list[Axes]
    #: The log-likelihood's, then one for every parameter.
    lines: list[Line2D]


def columns_for(width_in: float) -> int:
    """Number of panels in a row of a figure of a width, inches."""
    return 3 if width_in >= PAGE_IN else 2


@house_style()
def draw_convergence(
    axes: Sequence[Axes], log_likelihood: FloatArray, theta: FloatArray, parameters: Sequence[Parameter]
) -> DrawnConvergence:
    """Draw log-likelihood and parameters over the iterations of a search. Titles give the final values.

    Args:
        axes: One for the log-likelihood and one for each parameter, row by row.
        log_likelihood: (m,) nats, from the start on.
        theta: (m, k) parameters in their units.
        parameters: Their names and units.

    Returns:
        The artists.
    """
    lines = [_panel(axes[0], log_likelihood, "log-likelihood", "nats")]
    for panel, values, parameter in zip(axes[1:], theta.T, parameters, strict=True):
        symbol = symbol_of(parameter.name)
        lines.append(_panel(panel, values, symbol, parameter.unit.replace("^2", "²")))
    spec = axes[0].get_subplotspec()
    columns = 1 if spec is None else spec.get_gridspec().ncols
    for panel in axes[-columns:]:  # the lowest of each column
        panel.set_xlabel("iteration")
    return DrawnConvergence(list(axes), lines)


def _panel(axes: Axes, values: FloatArray, symbol: str, unit: str) -> Line2D:
    """One quantity over the iterations."""
    marker = "o" if len(values) <= _MARKED else ""
    look: dict[str, Any] = {"color": colour_of("learnt"), "linewidth": 1.0, "marker": marker, "markersize": 2.4}
    (line,) = axes.plot(np.arange(len(values)), values, **look)
    last = f"{values[-1]:.4g}".replace("-", "\N{MINUS SIGN}")
    axes.set_title(f"{symbol} = {last}{unit and ' ' + unit}", parse_math=True)
    axes.set_xlim(-0.5, max(len(values) - 0.5, 1.0))
    if np.ptp(values) == 0:
        axes.set_ylim(values[0] - max(abs(values[0]) / 10, 0.1), values[0] + max(abs(values[0]) / 10, 0.1))
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.ticklabel_format(axis="y", scilimits=(-3, 4), useOffset=False)
    return line
