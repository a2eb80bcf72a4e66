"""Properties of paths by group, as points with their intervals, or as bars (Fig. 7)."""

import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.container import BarContainer
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import MaxNLocator

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.compare import DRIVEN, LEARNT, ON_GRID
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metric import Metric, Values
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.figures.style import colour_of, house_style, look, panel_width_in

#: Notes below the panels.
NOTE = "points: mean, thick lines: its 95 % interval, thin lines: standard deviation"
BARS_NOTE = "bars: mean, whiskers: standard deviation"
#: An axis of points includes 0 where the lowest end is below this share of the highest.
_NEAR_ZERO = 0.4
#: Diameter of a point, and width of its interval and of the standard deviation, points.
_POINT_PT, _THICK_PT, _THIN_PT = 5.0, 3.2, 0.8
#: Largest share of a figure's width for the bars' labels, and where panels are stacked; width of a letter, inches.
_LABELLED, _LABELLED_ALONE, _LETTER_IN = 0.25, 0.4, 0.055
#: Height of a line of text, and distance between two bars, inches.
_LINE_IN, _BETWEEN_IN = 0.125, 0.06
#: Height of the labels below the bars; panels narrower than this, inches, have labels in lines of so many letters.
_BELOW_IN, _NARROW_IN, _SHORT = 0.58, 1.8, 13
#: Largest number of intervals between ticks; share of a panel's width for them; least distance between numbers, inches.
_INTERVALS, _TICKED, _APART_IN = 4, 0.68, 0.04
#: Half a 95 % interval of a normal distribution, standard errors.
_NORMAL = 1.959964
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
    #: Half the 95 % interval of the mean; nothing where there is none.
    half: Values = field(default_factory=dict)


@dataclass(frozen=True)
class DrawnProperties:
    """The artists of :func:`draw_properties`, by panel."""

    axes: list[Axes]
    #: Either bars, or points with the intervals of their means and standard deviations.
    bars: list[BarContainer]
    points: list[PathCollection]
    intervals: list[LineCollection]
    spreads: list[LineCollection]


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
            bars.append(PropertyBar(row.group, row.group, row.mean, row.std, row.count, _half(row)))
        elif row.path_type in {ON_GRID, LEARNT} and (learnt_from is None or row.group in learnt_from):
            name, key = ("learnt", LEARNT) if row.path_type == LEARNT else ("on grid", row.group)
            bars.append(PropertyBar(f"{row.group}, {name}", key, row.mean, row.std, row.count, _half(row)))
    return bars


def _half(row: GroupMetrics) -> Values:
    """Half the 95 % interval of each mean: of drawn paths by the Monte Carlo error, of others by participants."""
    return row.half_interval or {name: _NORMAL * error for name, error in row.error.items()}


def property_layout(bars: Sequence[PropertyBar], width_in: float, *, stacked: bool = False) -> dict[str, Any]:
    """Panels, columns and height of a figure of these bars in which no labels overlap.

    Args:
        bars: The bars.
        width_in: Width of the figure, inches.
        stacked: Whether the panels are one above the other, each with the labels of the bars.
    """
    columns = 1 if stacked else len(PAPER_METRICS)
    most = max((_label(bar, width_in, columns).count("\n") + 1 for bar in bars), default=1)
    below = _BELOW_IN + (_LINE_IN if width_in / columns < _NARROW_IN else 0.0)
    rows = len(PAPER_METRICS) // columns
    height_in = rows * (below + len(bars) * (most * _LINE_IN + _BETWEEN_IN))
    return {"panels": len(PAPER_METRICS), "columns": columns, "height_in": height_in}


@house_style()
def draw_properties(axes: Sequence[Axes], bars: Sequence[PropertyBar], *, as_bars: bool = False) -> DrawnProperties:
    """Draw mean, interval and standard deviation of every metric, one panel for each.

    Points have axes that need not begin at 0, so that small differences of long paths are visible. Bars start at 0,
    with the standard deviation alone. A note below explains them. A mean that does not exist, such as the distance to
    people in scenes without people, is marked "n/a".

    Args:
        axes: One for each of PAPER_METRICS, of a figure as of :func:`property_layout`. The first of each row has the
            labels of the bars.
        bars: From top to bottom.
        as_bars: Draw bars in place of points.

    Returns:
        The artists.

    Raises:
        DemonstrationError: Nothing to draw.
    """
    if not bars:
        raise DemonstrationError("no path properties to draw")
    drawn = DrawnProperties(list(axes), [], [], [], [])
    for panel, metric in zip(axes, PAPER_METRICS, strict=True):
        if as_bars:
            drawn.bars.append(_draw_bars(panel, metric, bars))
        else:
            point, interval, spread = _draw_points(panel, metric, bars)
            drawn.points.append(point)
            drawn.intervals.append(interval)
            drawn.spreads.append(spread)
    spec = axes[0].get_subplotspec()
    columns = len(axes) if spec is None else spec.get_gridspec().ncols
    width_in = panel_width_in(axes[0]) * columns
    for panel in axes[::columns]:
        panel.set_yticks(range(len(bars)), [_label(bar, width_in, columns) for bar in bars])
    axes[0].figure.supxlabel(fill(BARS_NOTE if as_bars else NOTE, int(width_in / _LETTER_IN)), fontsize="small")
    return drawn


def _label(bar: PropertyBar, width_in: float, columns: int) -> str:
    """A bar's label with its number of paths, in lines that leave room for the panels.

    A number stays on the line of its word: "cycle 2".
    """
    label = re.sub(r"(?<=\w) (?=\d)|(?<=n) (?==)|(?<==) ", "\N{NO-BREAK SPACE}", f"{bar.label} (n = {bar.count})")
    letters = int((_LABELLED if columns > 1 else _LABELLED_ALONE) * width_in / _LETTER_IN)
    return fill(label, letters, break_long_words=False, break_on_hyphens=False)


def _draw_bars(axes: Axes, metric: Metric, bars: Sequence[PropertyBar]) -> BarContainer:
    """Draw one metric as bars."""
    at, mean, std, ink = np.arange(len(bars)), _values(bars, metric, "mean"), _values(bars, metric, "std"), look().ink
    whisker = {**_WHISKER, "ecolor": ink}
    colours = [colour_of(bar.key) for bar in bars]
    drawn = axes.barh(at, mean, 0.7, xerr=std, color=colours, edgecolor=ink, linewidth=0.5, error_kw=whisker)
    _finish(axes, metric, mean, *_limits(mean, std))
    axes.axvline(0.0, color=ink, linewidth=0.6)
    return drawn


def _draw_points(
    axes: Axes, metric: Metric, bars: Sequence[PropertyBar]
) -> tuple[PathCollection, LineCollection, LineCollection]:
    """Draw one metric as points: the points, the intervals of their means, and the standard deviations."""
    at, mean, std = np.arange(len(bars)), _values(bars, metric, "mean"), _values(bars, metric, "std")
    half, colours = _values(bars, metric, "half"), [colour_of(bar.key) for bar in bars]
    spread = axes.hlines(at, mean - std, mean + std, color=look().ink, linewidth=_THIN_PT, zorder=3)
    interval = axes.hlines(at, mean - half, mean + half, color=colours, linewidth=_THICK_PT, zorder=2)
    edge: dict[str, Any] = {"edgecolor": look().ink, "linewidths": 0.5}
    point = axes.scatter(mean, at, s=_POINT_PT**2, c=colours, zorder=4, **edge)
    ends = np.fmax(np.nan_to_num(std), np.nan_to_num(half))
    _finish(axes, metric, mean, *_limits(mean, ends, from_zero=False))
    axes.grid(axis="x", color=look().obstacle, linewidth=0.4)
    return point, interval, spread


def _values(bars: Sequence[PropertyBar], metric: Metric, kind: str) -> FloatArray:
    """(n,) of every row; NaN where there is none."""
    return np.array([getattr(bar, kind).get(metric.name, np.nan) for bar in bars], dtype=float)


def _finish(axes: Axes, metric: Metric, mean: FloatArray, low: float, high: float) -> None:
    """Mark what does not exist, and write labels and ticks."""
    for y in np.flatnonzero(np.isnan(mean)):
        axes.annotate("n/a", (low, y), (3.0, 0.0), textcoords="offset points", va="center", fontsize="small")
    label = f"{metric.label} [{metric.unit}]"
    axes.set_xlabel(fill(label, _SHORT) if panel_width_in(axes) < _NARROW_IN else label)
    axes.set_ylim(len(mean) - 0.4, -0.6)
    axes.set_xlim(low, high)
    axes.set_xticks(*_ticks(low, high, _TICKED * panel_width_in(axes)))
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.set_yticks(range(len(mean)), [""] * len(mean))


def _limits(mean: FloatArray, spread: FloatArray, *, from_zero: bool = True) -> tuple[float, float]:
    """Limits of the metric's axis: around the ends, and from 0 where that is wanted or near."""
    known, wide = mean[~np.isnan(mean)], np.nan_to_num(spread)[~np.isnan(mean)]
    ends = np.concatenate([known - wide, known + wide]) if len(known) else np.zeros(1)
    low, high = float(ends.min()), float(ends.max())
    if from_zero or low < _NEAR_ZERO * high:
        low, high = min(low, 0.0), max(high, 0.0)
    room = 0.06 * (high - low) or 0.05 * abs(high) or 1.0
    return (0.0 if low == 0 else low - room), high + room


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
