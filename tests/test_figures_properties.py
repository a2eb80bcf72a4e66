"""The figure of path properties, and the colours of groups."""

from itertools import pairwise

import numpy as np
import pytest
from figure_checks import layouts
from matplotlib.colors import to_hex

from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.compare import AVOIDANCE, DRIVEN, LEARNT, ON_GRID
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.figures.properties import PropertyBar, bars_of, draw_properties, property_layout
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN, PAGE_IN, colour_of

#: Every mean in either width.
WIDTHS = 2 * [COLUMN_IN, PAGE_IN] + 2 * [PAGE_IN, COLUMN_IN]
MEANS = [(6.7, 0.6, 2.1), (9.4, 0.95, 0.3), (11.8, 1.3, 4.9), (24.0, -0.15, 7.9)]


def values(three):
    return dict(zip((metric.name for metric in PAPER_METRICS), three, strict=True))


def bar(label="force, cycle 1", key="force, cycle 1", mean=(6.5, 0.5, 2.0), std=(0.1, 0.2, 0.5), count=12, half=()):
    return PropertyBar(label, key, values(mean), values(std), count, values(half) if half else {})


def properties(bars, width_in=PAGE_IN, *, as_bars=False):
    figure, axes = new_figure(width_in, **property_layout(bars, width_in))
    return figure, draw_properties(axes, bars, as_bars=as_bars)


def ends(lines):
    return [tuple(np.reshape(segment, (-1, 2))[:, 0]) for segment in lines.get_segments()]


def test_points_are_means_with_intervals_and_standard_deviations():
    bars = [bar(half=(0.05, 0.3, 0.2)), bar("learnt", "learnt", (7.0, 0.4, 2.5), (0.3, 0.1, 0.25), 100)]
    _, drawn = properties(bars)
    assert not drawn.bars
    for panel, mean, std, half in zip(range(3), (6.5, 0.5, 2.0), (0.1, 0.2, 0.5), (0.05, 0.3, 0.2), strict=True):
        assert drawn.points[panel].get_offsets()[0].tolist() == [mean, 0.0]
        assert ends(drawn.spreads[panel])[0] == pytest.approx((mean - std, mean + std))
        assert ends(drawn.intervals[panel])[0] == pytest.approx((mean - half, mean + half))
        low, high = drawn.axes[panel].get_xlim()
        assert low <= mean - half < mean + half < high
    assert [to_hex(colour) for colour in drawn.points[0].get_facecolors()] == ["#56b4e9", "#cc79a7"]
    assert [axes.get_xlim()[0] > 0 for axes in drawn.axes] == [True, False, True], "0 is shown where it is near"


def test_learnt_paths_have_the_interval_of_their_monte_carlo_error():
    row = GroupMetrics("joystick", LEARNT, 3, values((1, 2, 3)), values((4, 5, 6)), error=values((0.1, 0.2, 0.3)))
    driven = GroupMetrics("joystick", DRIVEN, 3, values((1, 2, 3)), values((4, 5, 6)), half_interval=values((7, 8, 9)))
    assert bars_of([row])[0].half == pytest.approx(values((0.196, 0.392, 0.588)), rel=1e-3)
    assert bars_of([driven])[0].half == values((7, 8, 9))


def whiskers(container):
    (segments,) = [bar.get_segments() for bar in container.errorbar[2]]
    return [tuple(segment[:, 0]) for segment in segments]


def test_bars_are_means_from_zero_and_whiskers_standard_deviations():
    bars = [bar(), bar("learnt", "learnt", (7.0, 0.4, 2.5), (0.3, 0.1, 0.25), 100)]
    figure, drawn = properties(bars, as_bars=True)
    assert figure.get_supxlabel() == "bars: mean, whiskers: standard deviation"
    for panel, means, stds in zip(
        drawn.bars, [(6.5, 7.0), (0.5, 0.4), (2.0, 2.5)], [(0.1, 0.3), (0.2, 0.1), (0.5, 0.25)], strict=True
    ):
        assert [patch.get_width() for patch in panel.patches] == pytest.approx(means)
        assert {patch.get_x() for patch in panel.patches} == {0.0}
        expected = [(mean - std, mean + std) for mean, std in zip(means, stds, strict=True)]
        np.testing.assert_allclose(whiskers(panel), expected)
        assert [to_hex(patch.get_facecolor()) for patch in panel.patches] == ["#56b4e9", "#cc79a7"]
    for axes in drawn.axes:
        low, high = axes.get_xlim()
        assert low == 0.0
        assert high > max(end for panel in [drawn.bars[drawn.axes.index(axes)]] for _, end in whiskers(panel))


def test_panels_name_metric_and_unit_and_rows_group_and_count():
    _, drawn = properties([bar(), bar("joystick", "joystick", count=3)])
    assert [axes.get_xlabel() for axes in drawn.axes] == [
        "path length [m]",
        "min. distance [m]",
        "area under path [m²]",
    ]
    rows = [label.get_text().replace("\N{NO-BREAK SPACE}", " ") for label in drawn.axes[0].get_yticklabels()]
    assert rows == ["force, cycle 1 (n = 12)", "joystick (n = 3)"]
    assert {label.get_text() for axes in drawn.axes[1:] for label in axes.get_yticklabels()} == {""}
    bottom, top = drawn.axes[0].get_ylim()
    assert bottom > top  # the first row stands at the top


def test_bars_are_named_by_group_and_type_of_path_and_baselines_have_none():
    kinds = (DRIVEN, ON_GRID, LEARNT, AVOIDANCE)
    rows = [
        GroupMetrics("joystick", kind, count, values((1, 2, 3)), values((4, 5, 6))) for count, kind in enumerate(kinds)
    ]
    bars = bars_of(rows)
    assert [one.label for one in bars] == ["joystick", "joystick, on grid", "joystick, learnt"]
    assert [one.key for one in bars] == ["joystick", "joystick", LEARNT]
    assert [(one.mean, one.std, one.count) for one in bars] == [(row.mean, row.std, row.count) for row in rows[:3]]
    assert bars_of(rows, learnt_from={"joystick"}) == bars
    assert bars_of(rows, learnt_from={"force"}) == bars[:1]


def test_a_note_explains_points_and_lines():
    figure, _ = properties([bar()])
    assert figure.get_supxlabel() == "points: mean, thick lines: its 95 % interval, thin lines: standard deviation"


def test_labels_of_narrow_panels_break_once():
    _, drawn = properties([bar()], COLUMN_IN)
    assert [axes.get_xlabel() for axes in drawn.axes] == [
        "path length\n[m]",
        "min. distance\n[m]",
        "area under\npath [m²]",
    ]


@pytest.mark.parametrize(("width_in", "mean"), layouts(*zip(WIDTHS, 2 * MEANS, strict=True)))
def test_an_axis_of_bars_has_three_ticks_at_least_and_one_of_points_two(mean, width_in):
    both = [properties([bar(mean=mean, std=(0.2, 0.1, 0.1))], width_in, as_bars=bars)[1] for bars in (True, False)]
    for axes, least in [(axes, 3) for axes in both[0].axes] + [(axes, 2) for axes in both[1].axes]:
        low, high = axes.get_xlim()
        at = axes.get_xticks()
        assert len(at) >= least
        assert low <= at.min() < at.max() <= high
        texts = [label.get_text().replace("\N{MINUS SIGN}", "-") for label in axes.get_xticklabels()]
        np.testing.assert_allclose([float(text) for text in texts], at)


def test_numbers_too_long_for_three_ticks_have_fewer():
    figure, drawn = properties([bar(mean=(6543210.0, 0.00123, 2.0), std=(1.0, 0.0001, 0.5))], COLUMN_IN, as_bars=True)
    assert [len(axes.get_xticks()) for axes in drawn.axes] == [2, 2, 3]
    assert_labels_apart(figure, drawn)


def test_labels_of_bars_break_between_words_and_leave_room_for_the_panels():
    bars = [bar(), bar("force, cycle 2, on grid"), bar("learnt from force, cycle 2", count=600), bar("joystick")]
    figure, drawn = properties(bars, COLUMN_IN)
    figure.draw_without_rendering()
    labels = [label.get_text().replace("\N{NO-BREAK SPACE}", " ") for label in drawn.axes[0].get_yticklabels()]
    assert labels == [
        "force, cycle 1\n(n = 12)",
        "force, cycle 2,\non grid\n(n = 12)",
        "learnt from\nforce, cycle 2\n(n = 600)",
        "joystick\n(n = 12)",
    ]
    panels = sum(axes.get_window_extent().width for axes in drawn.axes)
    assert panels > 0.7 * figure.bbox.width


def test_a_mean_that_does_not_exist_is_marked():
    nan = float("nan")
    figure, drawn = properties([bar(), bar("alone", "autonomous", (6.0, nan, 0.1), (nan, nan, nan), 1)])
    figure.draw_without_rendering()
    assert [[text.get_text() for text in axes.texts] for axes in drawn.axes] == [[], ["n/a"], []]
    assert drawn.axes[1].texts[0].xy == (drawn.axes[1].get_xlim()[0], 1)


def test_negative_distances_are_within_the_axis():
    _, drawn = properties([bar(mean=(6.0, -0.2, 1.0), std=(0.1, 0.1, 0.1))])
    low, high = drawn.axes[1].get_xlim()
    assert low < -0.3
    assert high > 0.0


@pytest.mark.parametrize(("width_in", "rows"), layouts((COLUMN_IN, 20), (PAGE_IN, 1), (COLUMN_IN, 1), (PAGE_IN, 20)))
def test_no_labels_overlap(width_in, rows):
    bars = [bar(f"force, cycle {n}: driven, on the grid of the map", count=10 * n) for n in range(rows)]
    assert_labels_apart(*properties(bars, width_in))


def assert_labels_apart(figure, drawn):
    figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in drawn.axes[0].get_yticklabels()]
    assert all(upper.y0 > lower.y1 for upper, lower in pairwise(boxes))
    labels = [axes.xaxis.label.get_window_extent() for axes in drawn.axes]
    assert all(left.x1 < right.x0 for left, right in pairwise(labels))
    (note,) = figure.texts
    assert note.get_window_extent().y1 < min(label.y0 for label in labels)
    labels.append(note.get_window_extent())
    paper = figure.bbox
    assert all(box.x0 >= 0 and box.x1 <= paper.x1 and box.y0 >= 0 for box in [*boxes, *labels])
    numbers = [label.get_window_extent() for axes in drawn.axes for label in axes.get_xticklabels()]
    assert all(left.x1 < right.x0 for left, right in pairwise(numbers))  # within a panel and from one to the next


def test_no_bar_is_refused():
    with pytest.raises(DemonstrationError, match=r"^no path properties to draw$"):
        draw_properties(new_figure(panels=3)[1], [])


@pytest.mark.parametrize(
    ("key", "colour"),
    [
        ("force", "#0072B2"),
        ("force, cycle 1", "#56B4E9"),
        ("force, cycle 2", "#0072B2"),
        ("force, cycle 7", "#00304D"),
        ("joystick, cycle 2", "#D55E00"),
        ("force, obstacle course", "#544C00"),
        ("force, cycle 2, obstacle course", "#544C00"),
        ("force, cycle 2, no people", "#0072B2"),
        ("force, no cycle, main task", "#0072B2"),
        ("autonomous", "#009E73"),
        ("driven, on grid", "#7A7A7A"),
        ("unknown", "#8C8C8C"),
    ],
)
def test_a_group_has_one_colour(key, colour):
    assert colour_of(key) == colour
