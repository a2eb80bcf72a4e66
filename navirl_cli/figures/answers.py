"""Answers to a questionnaire as diverging stacked bars (Figs. 4 and 6)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import ceil
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from matplotlib.font_manager import FontProperties
from matplotlib.legend import Legend
from matplotlib.patches import Patch
from matplotlib.text import Annotation
from matplotlib.textpath import text_to_path

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.sheet import common_legend
from navirl_cli.figures.style import house_style, level_colours, look, panel_width_in
from navirl_cli.study.questionnaire import Shares

#: Ends of the scale.
DISAGREE, AGREE = "strongly disagree", "strongly agree"
#: Largest shares of a figure's width for questions and for modalities; mean width of a letter, inches.
_ASKED, _NAMED, _LETTER_IN = 0.32, 0.2, 0.055
#: Height of a line of text and of a bar; distance between bars and between questions, inches.
_LINE_IN, _BAR_IN, _APART_IN, _BETWEEN_IN = 0.125, 0.13, 0.04, 0.12
#: Height of the axis below the bars and of a row of the legend; width of a legend's entry without its text, inches.
_BELOW_IN, _ROW_IN, _ENTRY_IN = 0.45, 0.15, 0.33
#: Distance between question, modality and bar, points.
_GAP_PT = 6.0
#: The axis ends at multiples of this share, %; least distance between its numbers, inches.
_ROUND, _TICK_IN = 25, 0.3


@dataclass(frozen=True)
class DrawnAnswers:
    """The artists of :func:`draw_answers`."""

    axes: Axes
    #: By level, a bar for each given one.
    levels: list[BarContainer]
    #: One for each question.
    questions: list[Annotation]
    #: One for each bar.
    counts: list[Annotation]
    legend: Legend


def height_for(bars: Sequence[Shares], width_in: float) -> float:
    """Height of a figure of these bars in which no labels overlap, inches.

    Args:
        bars: The bars.
        width_in: Width of the figure, inches.
    """
    levels = max((len(bar.counts) for bar in bars), default=0)
    legend_in = levels * _ENTRY_IN + len(DISAGREE + AGREE) * _LETTER_IN
    return sum(_heights(bars, width_in)) + _BELOW_IN + _ROW_IN * ceil(legend_in / width_in)


@house_style()
def draw_answers(axes: Axes, bars: Sequence[Shares]) -> DrawnAnswers:
    """Draw the shares of answers from "strongly disagree" on the left to "strongly agree" on the right.

    With an odd number of levels, half of the neutral answers are on either side of 0. With an even number, half of the
    levels are on either side. Bars of one question are together. A legend below names the levels.

    Args:
        axes: Where to draw: the only axes of a figure that is :func:`height_for` inches high.
        bars: From top to bottom, grouped by question.

    Returns:
        The artists.

    Raises:
        DemonstrationError: No bars, a bar without answers, or bars with different scales.
    """
    _check(bars)
    width_in = panel_width_in(axes)
    at, middles, height_in = _places(bars, width_in)
    counts = np.array([bar.counts for bar in bars])
    share = 100 * counts / counts.sum(axis=1, keepdims=True)
    levels = share.shape[1]
    disagreement = share[:, : levels // 2].sum(axis=1) + (share[:, levels // 2] / 2 if levels % 2 else 0.0)
    left = np.cumsum(share, axis=1) - share - disagreement[:, None]
    edge: dict[str, Any] = {"edgecolor": look().ink, "linewidth": 0.5, "clip_on": False}
    drawn = [
        axes.barh(at, share[:, level], _BAR_IN, left[:, level], color=colour, **edge)
        for level, colour in enumerate(level_colours(levels))
    ]
    axes.axvline(0.0, color=look().ink, linewidth=0.8, zorder=0)
    axes.set_ylim(height_in, 0.0)
    beside_pt = _name_modalities(axes, at, bars)
    questions = _name_questions(axes, middles, bars, beside_pt)
    numbers = [
        axes.annotate(f"n = {bar.count}", (1.0, y), (_GAP_PT / 2, 0), **_beside(axes, fontsize="small"))
        for bar, y in zip(bars, at, strict=True)
    ]
    _scale(axes, left.min(), (left + share).max(), width_in)
    names = [f"1 {DISAGREE}", *map(str, range(2, levels)), f"{levels} {AGREE}"]
    patches = [
        Patch(facecolor=colour, label=name, **edge) for colour, name in zip(level_colours(levels), names, strict=True)
    ]
    return DrawnAnswers(axes, drawn, questions, numbers, common_legend([axes], patches))


def _check(bars: Sequence[Shares]) -> None:
    """Refuse bars without answers, and bars with different scales."""
    if not bars:
        raise DemonstrationError("no answers to draw")
    for bar in bars:
        if not bar.count:
            raise DemonstrationError(f"no answers to {bar.question!r} to draw")
        if len(bar.counts) != len(bars[0].counts):
            raise DemonstrationError(
                f"answers to {bar.question!r}: need {len(bars[0].counts)} levels as the first, found {len(bar.counts)}"
            )


def _by_question(bars: Iterable[Shares]) -> list[tuple[str, list[Shares]]]:
    """Questions and their bars."""
    return [(question, list(members)) for question, members in groupby(bars, lambda bar: bar.question)]


def _wrapped(text: str, share: float, width_in: float) -> str:
    """A text in lines that are at most a share of the figure's width long."""
    return fill(text, int(share * width_in / _LETTER_IN))


def _pitches(bars: Iterable[Shares], width_in: float) -> FloatArray:
    """Heights of bars, or of their modalities' names if those are higher, with the space around them, inches."""
    lines = [_wrapped(bar.modality, _NAMED, width_in).count("\n") + 1 for bar in bars]
    return np.array([max(_BAR_IN, count * _LINE_IN) + _APART_IN for count in lines])


def _heights(bars: Iterable[Shares], width_in: float) -> list[float]:
    """Heights of the questions, each with the space around it, inches."""
    heights = []
    for question, members in _by_question(bars):
        lines = _wrapped(question, _ASKED, width_in).count("\n") + 1
        heights.append(max(float(_pitches(members, width_in).sum()), lines * _LINE_IN) + _BETWEEN_IN)
    return heights


def _places(bars: Sequence[Shares], width_in: float) -> tuple[FloatArray, FloatArray, float]:
    """Middles of bars and of questions from the top, and the total height, inches."""
    heights = np.array(_heights(bars, width_in))
    middles = np.cumsum(heights) - heights / 2
    at = []
    for middle, (_, members) in zip(middles, _by_question(bars), strict=True):
        pitches = _pitches(members, width_in)
        at.append(middle - pitches.sum() / 2 + np.cumsum(pitches) - pitches / 2)
    return np.concatenate(at), middles, float(heights.sum())


def _beside(axes: Axes, **others: Any) -> dict[str, Any]:
    """Placement of a text beside the axes: x as a share of their width, y in data, shifted by points."""
    place = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points", "annotation_clip": False}
    return {**place, "va": "center", **others}


def _name_modalities(axes: Axes, at: FloatArray, bars: Sequence[Shares]) -> float:
    """Write the modality left of every bar; the width of these texts, points."""
    names = [_wrapped(bar.modality, _NAMED, panel_width_in(axes)) for bar in bars]
    axes.set_yticks(at, names, linespacing=1.1)
    axes.tick_params(axis="y", length=0, pad=_GAP_PT / 2)
    return _width_pt(names)


def _name_questions(axes: Axes, middles: FloatArray, bars: Sequence[Shares], beside_pt: float) -> list[Annotation]:
    """Write every question left of the modalities."""
    texts = [_wrapped(question, _ASKED, panel_width_in(axes)) for question, _ in _by_question(bars)]
    shift = -(_width_pt(texts) + beside_pt + _GAP_PT * (1.5 if beside_pt else 0.5))
    place = _beside(axes, fontsize=rcParams["ytick.labelsize"], ha="left", linespacing=1.1)
    return [axes.annotate(text, (0.0, y), (shift, 0.0), **place) for text, y in zip(texts, middles, strict=True)]


def _width_pt(texts: Iterable[str]) -> float:
    """Width of the longest line of texts left of the axes, points."""
    font = FontProperties(size=rcParams["ytick.labelsize"])
    lines = [line for text in texts for line in text.split("\n")]
    return max(float(text_to_path.get_text_width_height_descent(line, font, ismath=False)[0]) for line in lines)


def _scale(axes: Axes, low: float, high: float, width_in: float) -> None:
    """An axis in percent that counts up from 0 to both sides."""
    low = min(-_ROUND, np.floor(low / _ROUND + 1e-9) * _ROUND)
    high = max(_ROUND, np.ceil(high / _ROUND - 1e-9) * _ROUND)
    axes.set_xlim(low, high)
    room_in = (1 - 1.5 * _ASKED) * width_in
    step = _ROUND if (high - low) / _ROUND * _TICK_IN <= room_in else 2 * _ROUND
    at = [value for value in range(-100, 101, step) if low <= value <= high]
    axes.set_xticks(at, [f"{abs(value)}" for value in at])
    axes.set_xlabel("share of answers [%]")
    axes.spines[["top", "right", "left"]].set_visible(False)
