"""Properties of paths by group as bars (Fig. 7)."""

import re
from collections.abc import Iterable, Sequence
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

#: What the figure says of itself.
NOTE = "bars: mean, whiskers: standard deviation"
#: Share of a figure's width that the bars' labels may take, and the mean width of one of their letters, inches.
_LABELLED, _LETTER_IN = 0.25, 0.055
#: Height of a line of text and of the space between two bars, inches.
_LINE_IN, _BETWEEN_IN = 0.125, 0.06
#: Height of what stands below the bars, inches; panels narrower than this have labels in two lines of so many letters.
_BELOW_IN, _NARROW_IN, _SHORT = 0.58, 1.8, 13
#: Most intervals between ticks; the share of a panel's width in which they stand, and room between numbers, inches.
_INTERVALS, _TICKED, _APART_IN = 4, 0.68, 0.04
_WHISKER: dict[str, Any] = {"elinewidth": 0.8, "capsize": 1.8, "capthick": 0.8}


@dataclass(frozen=True)
class PropertyBar:
    """One bar of every panel: the paths of one group, or of one kind."""

    label: str
    #: Key of its colour, as :func:`navirl_cli.figures.style.colour_of` takes it.
    key: str
    mean: Values
    #: Standard deviations; NaN where one path has none.
    std: Values
    #: Number of paths.
    count: int


@dataclass(frozen=True)
class DrawnProperties:
    """What :func:`draw_properties` put on the axes, by panel."""

    axes: list[Axes]
    bars: list[BarContainer]


def bars_of(rows: Iterable[GroupMetrics]) -> list[PropertyBar]:
    """Bars of measured paths, one for each row.

    Args:
        rows: Metrics by group and type of path, from top to bottom.

    Returns:
        The bars. Those of driven paths have the name of their group; others add the type of path. Learnt paths have a
        colour of their own, all others that of their group.
    """
    suffix = {DRIVEN: "", ON_GRID: ", on grid"}
    return [
        PropertyBar(
            row.group + suffix.get(row.kind, f", {row.kind}"),
            LEARNT if row.kind.split(", ")[0] == LEARNT else row.group,
            row.mean,
            row.std,
            row.count,
        )
        for row in rows
    ]


def height_for(bars: Sequence[PropertyBar], width_in: float) -> float:
    """Height of a figure of these bars in which no two labels touch, inches.

    Args:
        bars: The bars.
        width_in: Width of the figure, inches.
    """
    most = max((_label(bar, width_in).count("\n") + 1 for bar in bars), default=1)
    below = _BELOW_IN + (_LINE_IN if width_in / len(PAPER_METRICS) < _NARROW_IN else 0.0)
    return below + len(bars) * (most * _LINE_IN + _BETWEEN_IN)


@house_style()
def draw_properties(axes: Sequence[Axes], bars: Sequence[PropertyBar]) -> DrawnProperties:
    """Draw mean and standard deviation of every metric, a panel each; bars lie, so that long labels stay readable.

    Bars start at 0; a note below says what bars and whiskers are. A mean that does not exist (the distance to people
    where there is nobody) is said to be missing.

    Args:
        axes: One for each of PAPER_METRICS, side by side, :func:`height_for` inches high with labels. The first names
            the bars and their numbers of paths.
        bars: From top to bottom.

    Returns:
        The artists.

    Raises:
        DemonstrationError: There is no bar.
    """
    if not bars:
        raise DemonstrationError("no paths to compare")
    drawn = [_draw_panel(panel, metric, bars) for panel, metric in zip(axes, PAPER_METRICS, strict=True)]
    width_in = panel_width_in(axes[0]) * len(axes)
    axes[0].set_yticks(range(len(bars)), [_label(bar, width_in) for bar in bars])
    axes[0].figure.supxlabel(NOTE, fontsize="small")
    return DrawnProperties(list(axes), drawn)


def _label(bar: PropertyBar, width_in: float) -> str:
    """A bar's name and number of paths, in lines that leave the panels their share of the figure's width.

    A number stays on the line of its word: "cycle 2".
    """
    label = re.sub(r"(?<=\w) (?=\d)|(?<=n) (?==)|(?<==) ", "\N{NO-BREAK SPACE}", f"{bar.label} (n = {bar.count})")
    letters = int(_LABELLED * width_in / _LETTER_IN)
    return fill(label, letters, break_long_words=False, break_on_hyphens=False)


def _draw_panel(axes: Axes, metric: Metric, bars: Sequence[PropertyBar]) -> BarContainer:
    """One metric."""
    at = np.arange(len(bars))
    mean = np.array([bar.mean[metric.name] for bar in bars], dtype=float)
    std = np.array([bar.std[metric.name] for bar in bars], dtype=float)
    colours = [colour_of(bar.key) for bar in bars]
    ink = look().ink
    whisker = {**_WHISKER, "ecolor": ink}
    drawn = axes.barh(at, mean, 0.7, xerr=std, color=colours, edgecolor=ink, linewidth=0.5, error_kw=whisker)
    for y in at[np.isnan(mean)]:
        axes.annotate("none", (0.0, y), (3.0, 0.0), textcoords="offset points", va="center", fontsize="small")
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
    """Borders of the metric's axis: from 0, or from below the lowest whisker, to a little above the highest."""
    spread = np.nan_to_num(std)
    ends = np.concatenate([[0.0], (mean - spread)[~np.isnan(mean)], (mean + spread)[~np.isnan(mean)]])
    low, high = float(ends.min()), float(ends.max())
    room = 0.06 * (high - low) or 1.0
    return (low - room if low < 0 else 0.0), high + room


def _ticks(low: float, high: float, width_in: float) -> tuple[FloatArray, list[str]]:
    """Numbers below an axis of a width, and their texts: three or more where they fit, fewer where not."""
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
