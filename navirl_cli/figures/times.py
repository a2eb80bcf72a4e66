"""Completion times of the obstacle course by modality (Fig. 2)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator, NullLocator

from navirl_cli.arrays import FloatArray
from navirl_cli.documents.numbers import evenly
from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.style import colour_of, house_style, look, panel_width_in

#: Note below the boxes.
NOTE = "box: median and quartiles, whiskers: within 1.5 IQR, dots: all times"
#: The scale is logarithmic where the longest time is more than so many times the median of all.
_LONG = 2.5
#: Ticks of a logarithmic scale in every power of ten: the first of these of which there are not more than so many.
_TICKS, _MOST_TICKS = ((1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0), (1.0, 2.0, 5.0), (1.0,)), 8
#: Middles of box and dots beside the middle of a modality, as shares of its width.
_LEFT, _RIGHT = -0.17, 0.2
#: Least width of a modality with the number of its median, inches.
_NUMBERED_IN = 0.8
#: Height of the figure, inches.
HEIGHT_IN = 2.3
#: Largest width of a box, inches and as a share of a modality's width; largest share of this width for dots.
_BOX_IN, _BOXED, _DOTTED = 0.4, 0.3, 0.45
#: Diameter of a dot, points; distance of dots side by side, inches, and one above the other, as a share of the axis.
_DOT_PT, _BESIDE_IN, _ABOVE = 3.2, 0.055, 0.035
#: Opacity of a box, low enough for the median to stand out.
_OPACITY = 0.55
#: Width of a letter below the boxes, and of the axis beside them, inches.
_LETTER_IN, _AXIS_IN = 0.055, 0.45
_LINE_PT = 0.8


@dataclass(frozen=True)
class DrawnTimes:
    """The artists of :func:`draw_completion_times`, by modality."""

    axes: Axes
    #: Values of the medians, beside the boxes where there is room.
    numbers: list[Annotation]
    boxes: list[PathPatch]
    medians: list[Line2D]
    #: Two for each modality, the lower one first.
    whiskers: list[Line2D]
    #: One marker for each time, from the shortest to the longest.
    dots: list[Line2D]


@house_style()
def draw_completion_times(axes: Axes, times_s: Mapping[str, Sequence[float]]) -> DrawnTimes:
    """Draw completion times as box plots, with every time as a dot beside its box.

    A box spans the quartiles; its median is named. Whiskers reach to the farthest times within 1.5 times its height
    (Tukey). Dots that would overlap are moved sideways. The scale is logarithmic where a few long times would leave
    little of a linear one for all others.

    Args:
        axes: Where to draw, at least HEIGHT_IN high with its labels.
        times_s: Times by modality, s. Modalities without times are left out.

    Returns:
        The artists.

    Raises:
        DemonstrationError: No times, or one that is not above 0.
    """
    times = {modality: np.sort(np.asarray(values, dtype=float)) for modality, values in times_s.items() if len(values)}
    if not times:
        raise DemonstrationError("no completion times to draw")
    for modality, values in times.items():
        if not (np.isfinite(values) & (values > 0)).all():
            raise DemonstrationError(
                f"completion times of {modality}: expected seconds above 0, found {values.tolist()}"
            )
    room_in = (panel_width_in(axes) - _AXIS_IN) / len(times)
    drawn = _boxes(axes, times, room_in)
    everything = np.concatenate(list(times.values()))
    highest, lowest = float(everything.max()), float(everything.min())
    logarithmic = highest > _LONG * float(np.median(everything))
    span = np.log(highest / lowest) if logarithmic else highest
    dots = [
        _dots(axes, at, values, span, room_in, np.log if logarithmic else np.asarray)
        for at, values in enumerate(times.values())
    ]
    medians = [float(np.median(values)) for values in times.values()] if room_in >= _NUMBERED_IN else []
    written = zip(medians, evenly(medians), strict=True)
    numbers = [_number(axes, at, median, text) for at, (median, text) in enumerate(written)]
    _label(axes, times, room_in)
    if logarithmic:
        _logarithmic(axes, lowest, highest)
    else:
        axes.set_ylim(0.0, 1.06 * highest)
    return DrawnTimes(axes, numbers, drawn["boxes"], drawn["medians"], drawn["whiskers"], dots)


def _boxes(axes: Axes, times: Mapping[str, FloatArray], room_in: float) -> dict[str, Any]:
    """Draw a box with whiskers for each modality, left of its middle; the artists by kind."""
    ink = look().ink
    box = {"edgecolor": ink, "linewidth": _LINE_PT}
    line = {"color": ink, "linewidth": _LINE_PT, "solid_capstyle": "butt"}
    drawn: dict[str, Any] = axes.boxplot(
        list(times.values()),
        positions=[at + _LEFT for at in range(len(times))],
        widths=min(_BOXED, _BOX_IN / room_in),
        patch_artist=True,
        showfliers=False,
        manage_ticks=False,
        boxprops=box,
        whiskerprops=line,
        capprops=line,
        medianprops={**line, "linewidth": 2.0},
    )
    for patch, modality in zip(drawn["boxes"], times, strict=True):
        patch.set_facecolor((colour_of(modality), _OPACITY))
    return drawn


def _number(axes: Axes, at: int, median: float, text: str) -> Annotation:
    """Write a median left of its box."""
    place: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "center", "fontsize": "small"}
    return axes.annotate(text, (at + _LEFT - _BOXED / 2, median), (-2.0, 0.0), **place)


def _logarithmic(axes: Axes, lowest: float, highest: float) -> None:
    """A logarithmic axis with round numbers."""
    axes.set_yscale("log")
    axes.set_ylim(lowest / 1.15, 1.1 * highest)
    powers = 10.0 ** np.arange(np.floor(np.log10(lowest)) - 1, np.ceil(np.log10(highest)) + 1)
    for steps in _TICKS:
        every = [float(power * step) for power in powers for step in steps]
        at = [value for value in every if lowest / 1.15 <= value <= 1.1 * highest]
        if len(at) <= _MOST_TICKS:
            break
    axes.set_yticks(at, [f"{value:g}" for value in at])
    axes.yaxis.set_minor_locator(NullLocator())


def _dots(
    axes: Axes, at: int, times: FloatArray, span: float, room_in: float, scale: Callable[[FloatArray], FloatArray]
) -> Line2D:
    """Draw all sorted times of one modality right of its box, in a line where no other dot is near on the axis."""
    ranks = _ranks(scale(times), _ABOVE * span)
    beside = min(_BESIDE_IN / room_in, _DOTTED / max(1, int(np.ptp(ranks))))
    edge: dict[str, Any] = {"markerfacecolor": look().paper, "markeredgecolor": look().ink, "markeredgewidth": 0.6}
    (drawn,) = axes.plot(
        at + _RIGHT + beside * ranks, times, linestyle="none", marker="o", markersize=_DOT_PT, zorder=4, **edge
    )
    return drawn


def _ranks(times: FloatArray, near: float) -> FloatArray:
    """(n,) sideways places of sorted times: the nearest to the middle that no time closer than near occupies."""
    places = [0, *(side * step for step in range(1, len(times)) for side in (1, -1))]
    ranks: list[int] = []
    for number, time in enumerate(times):
        taken = {ranks[other] for other in range(number) if time - times[other] < near}
        ranks.append(next(place for place in places if place not in taken))
    return np.array(ranks, dtype=float)


def _label(axes: Axes, times: Mapping[str, FloatArray], room_in: float) -> None:
    """Label the axes, and the modalities with their numbers of times."""
    letters = max(1, int(room_in / _LETTER_IN))
    names = [f"{fill(modality, letters)}\n(n = {len(values)})" for modality, values in times.items()]
    axes.set_xticks(range(len(times)), names)
    axes.set_xlim(-0.5, len(times) - 0.5)
    axes.tick_params(axis="x", length=0)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))  # of a linear axis
    axes.set_ylabel("completion time [s]")
    axes.set_xlabel(fill(NOTE, int(room_in * len(times) / _LETTER_IN)), fontsize="small")
    axes.spines[["top", "right"]].set_visible(False)
