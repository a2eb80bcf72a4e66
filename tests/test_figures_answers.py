"""The figure of a questionnaire's answers."""

from itertools import pairwise

import numpy as np
import pytest
from figure_checks import assert_no_overlap, layouts
from matplotlib.colors import to_hex

from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.answers import draw_answers, height_for
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN, PAGE_IN, level_colours
from navirl_cli.study.questionnaire import Shares

LONG = "I felt safe while the robot passed me and kept the distance that I had taught to it before."


REPLAYS = ["replay of the learnt policy", "replay of the joystick", "obstacle avoidance"]


def share(counts, question="Was it easy?", modality="force"):
    return Shares(question, modality, np.array(counts))


def asked(bars, width_in=PAGE_IN):
    figure, (axes,) = new_figure(width_in, height_for(bars, width_in))
    return figure, draw_answers(axes, bars)


def spans(drawn, bar):
    """Left and right end of every level of one bar, %."""
    patches = [level.patches[bar] for level in drawn.levels]
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in patches]


def test_neutral_answers_are_centred_on_0_and_levels_follow_each_other_from_the_left():
    _, drawn = asked(
        [share([1, 2, 4, 2, 1]), share([0, 0, 0, 0, 3], modality="joystick"), share([0, 5, 5, 0, 0], "B?")]
    )
    np.testing.assert_allclose(spans(drawn, 0), [(-50, -40), (-40, -20), (-20, 20), (20, 40), (40, 50)])
    np.testing.assert_allclose(spans(drawn, 1)[4], (0, 100))
    np.testing.assert_allclose(spans(drawn, 2), [(-75, -75), (-75, -25), (-25, 25), (25, 25), (25, 25)])
    low, high = drawn.axes.get_xlim()
    assert (low, high) == (-75, 100)


def test_an_even_number_of_levels_has_no_middle():
    _, drawn = asked([share([1, 2, 1, 0])])
    np.testing.assert_allclose(spans(drawn, 0), [(-75, -50), (-50, 0), (0, 25), (25, 25)])


@pytest.mark.parametrize("levels", layouts(5, 4, 2, 7))
def test_levels_have_their_colours_and_the_legend_names_the_ends(levels):
    _, drawn = asked([share([1] * levels)], COLUMN_IN)
    for level, colour in zip(drawn.levels, level_colours(levels), strict=True):
        assert [to_hex(patch.get_facecolor()) for patch in level.patches] == [colour]
    entries = {
        text.get_text(): handle
        for text, handle in zip(drawn.legend.get_texts(), drawn.legend.legend_handles, strict=True)
    }
    names = ["1 strongly disagree", *map(str, range(2, levels)), f"{levels} strongly agree"]
    assert set(entries) == set(names)
    assert [to_hex(entries[name].get_facecolor()) for name in names] == level_colours(levels)


def test_bars_are_named_counted_and_grouped_by_question():
    bars = [share([1, 0, 2, 0, 1], modality=modality) for modality in ("force", "joystick")]
    bars += [share([0, 0, 13, 0, 0], "Was it fun?")]
    figure, drawn = asked(bars)
    figure.draw_without_rendering()
    assert [label.get_text() for label in drawn.axes.get_yticklabels()] == ["force", "joystick", "force"]
    assert [number.get_text() for number in drawn.counts] == ["n = 4", "n = 4", "n = 13"]
    assert [question.get_text() for question in drawn.questions] == ["Was it easy?", "Was it fun?"]
    middles = [patch.get_y() + patch.get_height() / 2 for patch in drawn.levels[0].patches]
    assert [question.xy[1] for question in drawn.questions] == pytest.approx([np.mean(middles[:2]), middles[2]])
    assert [number.xy[1] for number in drawn.counts] == pytest.approx(middles)
    assert middles[1] - middles[0] < middles[2] - middles[1]
    bottom, top = drawn.axes.get_ylim()
    assert bottom > middles[2] > middles[0] > top  # the first stands at the top
    for question, label in zip(drawn.questions, [drawn.axes.get_yticklabels()[at] for at in (1, 2)], strict=True):
        assert question.get_window_extent().x1 < label.get_window_extent().x0
    assert drawn.counts[0].get_window_extent().x0 > drawn.axes.get_window_extent().x1


def test_the_axis_counts_percent_to_both_sides():
    _, drawn = asked([share([1, 2, 4, 2, 1])])
    labels = [label.get_text() for label in drawn.axes.get_xticklabels()]
    assert drawn.axes.get_xlabel() == "share of answers [%]"
    assert labels == ["50", "25", "0", "25", "50"]
    assert drawn.axes.get_xticks().tolist() == [-50, -25, 0, 25, 50]
    _, narrow = asked([share([9, 0, 0, 0, 1]), share([1, 0, 0, 0, 9])], COLUMN_IN)
    labels = [label.get_text() for label in narrow.axes.get_xticklabels()]
    assert labels == ["100", "50", "0", "50", "100"]  # fewer where room is short


@pytest.mark.parametrize(
    ("levels", "width_in", "questions", "modalities"),
    layouts(
        (5, PAGE_IN, [LONG, "Fun?", LONG + LONG], ["force", "joystick"]),
        (7, COLUMN_IN, ["Fun?", LONG], REPLAYS),
        (5, PAGE_IN, ["Was it fun?"], [""]),
        (5, PAGE_IN, ["Fun?", LONG], REPLAYS),
        (7, COLUMN_IN, ["Was it fun?"], [""]),
        (7, COLUMN_IN, [LONG, "Fun?", LONG + LONG], ["force", "joystick"]),
    ),
)
def test_no_texts_overlap_and_bars_keep_their_height(questions, modalities, levels, width_in):
    rng = np.random.default_rng(0)
    bars = [share(rng.integers(0, 100, levels), question, one) for question in questions for one in modalities]
    figure, drawn = asked(bars, width_in)
    assert_no_overlap(figure)
    assert drawn.axes.get_window_extent().width > 0.3 * figure.bbox.width
    heights = [patch.get_window_extent().height / figure.dpi for patch in drawn.levels[0].patches]
    assert 0.11 < min(heights) <= max(heights) < 0.16  # inches, as planned, whatever the number of bars
    ends = [patch.get_window_extent() for patch in drawn.levels[0].patches]
    assert all(upper.y0 > lower.y1 for upper, lower in pairwise(ends))


def test_the_height_grows_with_the_bars():
    one, two = [share([1, 1, 1, 1, 1])], [share([1, 1, 1, 1, 1]), share([1, 1, 1, 1, 1], modality="joystick")]
    apart = [*one, share([1, 1, 1, 1, 1], LONG)]
    assert (
        height_for(one, PAGE_IN) < height_for(two, PAGE_IN) < height_for(apart, PAGE_IN) < height_for(apart, COLUMN_IN)
    )


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(DemonstrationError, match=r"^no answers to draw$"):
        draw_answers(new_figure()[1][0], [])
    with pytest.raises(DemonstrationError, match=r"^no answers to 'B\?' to draw$"):
        asked([share([1, 0]), share([0, 0], "B?")])
    with pytest.raises(DemonstrationError, match=r"answers to 'B\?': need 2 levels as the first, found 3"):
        asked([share([1, 0]), share([1, 0, 0], "B?")])
