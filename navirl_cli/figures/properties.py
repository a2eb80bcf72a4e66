"""Properties of paths by group, as bars (Fig. 7)."""

import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import MaxNLocator

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.compare import DRIVEN, LEARNT, ON_GRID
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metrics import PAPER_METRICS, Metric, Values
from navirl_cli.figures.style import colour_of, house_style, look, panel_width_in

#: Note below the panels.
NOTE = "bars: mean, whiskers: standard deviation"
#: Largest share of a figure's width for the bars' labels; mean width of a letter, inches.
_LABELLED, _LETTER_IN = 0.25, 0.055
#: Height of a line of text, and distance between two bars, inches.
_LINE_IN, _BETWEEN_IN = 0.125, 0.06
#: Height of the labels below the bars; panels narrower than this, inches, have labels in lines of so many letters.
_BELOW_IN, _NARROW_IN, _SHORT = 0.58, 1.8, 13
#: Largest number of intervals between ticks; share of a panel's width for them; least distance between numbers, inches.
_INTERVALS, _TICKED, _APART_IN = 4, 0.68, 0.04
_WHISKER: dict[str, Any] = {"elinewidth": 0.8, "capsize": 1.8, "capthick": 0.8}


@dataclass(frozen=True)
class PropertyBar:
    """One bar of every panel: paths of one group and type."""

    label: str
    #: Key of its colour, as :func:`navirl_cli.figures.style.colour_of` takes it.
    key: str
    mean: Values
    #: Standard deviations; NaN for a single path.
    std: Values
    #: Number of paths.
    count: int


@dataclass(frozen=True)
class DrawnProperties:
    """The artists of :func:`draw_properties`, by panel."""

    axes: list[Axes]
    bars: list[BarContainer]


def bars_of(rows: Iterable[GroupMetrics], learnt_from: Container[str] | None = None) -> list[PropertyBar]:
    """Bars of driven and learnt paths.

    Learnt paths go from cell to cell. They are compared with driven paths through the centres of cells.

    Args:
        rows: Metrics by group and type of path, from top to bottom. Baselines have no bars.
        learnt_from: Groups with bars of learnt paths and of driven paths through the centres of cells; None for all.

    Returns:
        The bars. Those of driven paths have the name of their group; others add the type of path. Learnt paths have
        their own colour, all others that of their group.
    """
    bars = []
    for row in rows:
        if row.path_type == DRIVEN:
            bars.append(PropertyBar(row.group, row.group, row.mean, row.std, row.count))
        elif row.path_type in {ON_GRID, LEARNT} and (learnt_from is None or row.group in learnt_from):
            name, key = ("learnt", LEARNT) if row.path_type == LEARNT else ("on grid", row.group)
            bars.append(PropertyBar(f"{row.group}, {name}", key, row.mean, row.std, row.count))
    return bars


def height_for(bars: Sequence[PropertyBar], width_in: float) -> float:
    """Height of a figure of these bars in which no labels overlap, inches.

    Args:
        bars: The bars.
        width_in: Width of the figure, inches.
    """
    most = max((_label(bar, width_in).count("\n") + 1 for bar in bars), default=1)
    below = _BELOW_IN + (_LINE_IN if width_in / len(PAPER_METRICS) < _NARROW_IN else 0.0)
    return below + len(bars) * (most * _LINE_IN + _BETWEEN_IN)


@house_style()
def draw_properties(axes: Sequence[Axes], bars: Sequence[PropertyBar]) -> DrawnProperties:
    """Draw mean and standard deviation of every metric as horizontal bars, one panel for each.

    Bars start at 0. A note below explains bars and whiskers. A mean that does not exist, such as the distance to people
    in scenes without people, is marked "n/a".

    Args:
        axes: One for each of PAPER_METRICS, side by side, :func:`height_for` inches high with labels. The first has the
            labels of the bars.
        bars: From top to bottom.

    Returns:
        The artists.

    Raises:
        DemonstrationError: No bars.
    """
    if not bars:
        raise DemonstrationError("no path properties to draw")
    drawn = [_draw_panel(panel, metric, bars) for panel, metric in zip(axes, PAPER_METRICS, strict=True)]
    width_in = panel_width_in(axes[0]) * len(axes)
    axes[0].set_yticks(range(len(bars)), [_label(bar, width_in) for bar in bars])
    axes[0].figure.supxlabel(NOTE, fontsize="small")
    return DrawnProperties(list(axes), drawn)


def _label(bar: PropertyBar, width_in: float) -> str:
    """A bar's label with its number of paths, in lines that leave room for the panels.

    A number stays on the line of its word: "cycle 2".
    """
    label = re.sub(r"(?<=\w) (?=\d)|(?<=n) (?==)|(?<==) ", "\N{NO-BREAK SPACE}", f"{bar.label} (n = {bar.count})")
    letters = int(_LABELLED * width_in / _LETTER_IN)
    return fill(label, letters, break_long_words=False, break_on_hyphens=False)


def _draw_panel(axes: Axes, metric: Metric, bars: Sequence[PropertyBar]) -> BarContainer:
    """Draw one metric."""
    at = np.arange(len(bars))
    mean = np.array([bar.mean[metric.name] for bar in bars], dtype=float)
    std = np.array([bar.std[metric.name] for bar in bars], dtype=float)
    colours = [colour_of(bar.key) for bar in bars]
    ink = look().ink
    whisker = {**_WHISKER, "ecolor": ink}
    drawn = axes.barh(at, mean, 0.7, xerr=std, color=colours, edgecolor=ink, linewidth=0.5, error_kw=whisker)
    for y in at[np.isnan(mean)]:
        axes.annotate("n/a", (0.0, y), (3.0, 0.0), textcoords="offset points", va="center", fontsize="small")
    narrow = panel_width_in(axes) < _NARROW_IN
    label = f"{metric.label} [{metric.unit}]"
    axes.set_xlabel(fill(label, _SHORT) if narrow else label)
    axes.set_ylim(len(bars) - 0.4, -0.6)
    low, high = _limits(mean, std)
    axes.set_xlim(low, high)
    axes.set_xticks(*_ticks(low, high, _TICKED * panel_width_in(axes)))
    axes.axvline(0.0, color=ink, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.set_yticks(at, [""] * len(bars))
    return drawn


def _limits(mean: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Limits of the metric's axis: from 0, or below the lowest whisker, to above the highest whisker."""
    spread = np.nan_to_num(std)
    ends = np.concatenate([[0.0], (mean - spread)[~np.isnan(mean)], (mean + spread)[~np.isnan(mean)]])
    low, high = float(ends.min()), float(ends.max())
    room = 0.06 * (high - low) or 1.0
    return (low - room if low < 0 else 0.0), high + room


def _ticks(low: float, high: float, width_in: float) -> tuple[FloatArray, list[str]]:
    """Ticks of an axis of a width, and their texts: at least three if they fit."""
    font = FontProperties(size=rcParams["xtick.labelsize"])
    for intervals in range(_INTERVALS, 0, -1):
        locator = MaxNLocator(intervals, steps=[1, 2, 4, 5, 10], min_n_ticks=min(3, intervals))
        at: FloatArray = np.asarray(locator.tick_values(low, high))
        at = at[(at >= low) & (at <= high)]
        texts = [f"{value:g}".replace("-", "\N{MINUS SIGN}") for value in at]
        wide_in = np.array([text_to_path.get_text_width_height_descent(text, font, False)[0] for text in texts]) / 72
        between_in = np.diff(at) / (high - low) * width_in
        if (between_in >= (wide_in[1:] + wide_in[:-1]) / 2 + _APART_IN).all():
            break
    return at, texts
