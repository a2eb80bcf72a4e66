"""Rows of panels with one legend, and distinct colours."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from figure_checks import SIGHTS, lab, layouts
from matplotlib.lines import Line2D

from navirl_cli.figures.layout import trim_height
from navirl_cli.figures.sheet import common_legend, new_figure, outer_labels
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN, colour_of, level_colours


def test_panels_are_ordered_row_by_row():
    _, axes = new_figure(PAGE_IN, panels=5, columns=2)
    places = [(panel.get_subplotspec().rowspan.start, panel.get_subplotspec().colspan.start) for panel in axes]
    assert places == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)]
    assert {panel.get_subplotspec().get_gridspec().ncols for panel in new_figure(panels=3)[1]} == {3}


@pytest.mark.parametrize(
    ("panels", "columns", "x", "y"),
    layouts((4, 2, {2, 3}, {0, 2}), (3, 2, {0, 1, 2}, {0, 2}), (5, 2, {2, 3, 4}, {0, 2, 4}), (3, 1, {2}, {0, 1, 2})),
)
def test_only_the_outermost_panels_have_labels(panels, columns, x, y):
    figure, axes = new_figure(PAGE_IN, panels=panels, columns=columns)
    for panel in axes:
        panel.set(xlabel="x [m]", ylabel="y [m]")
    outer_labels(axes)
    figure.draw_without_rendering()
    assert {number for number, panel in enumerate(axes) if panel.get_xlabel()} == x
    assert {number for number, panel in enumerate(axes) if panel.get_ylabel()} == y
    numbered = [any(tick.label1.get_visible() for tick in panel.xaxis.get_major_ticks()) for panel in axes]
    assert {number for number, seen in enumerate(numbered) if seen} == x


def legend_of(count, panels=1, width_in=COLUMN_IN):
    figure, axes = new_figure(width_in, panels=panels, columns=min(2, panels))
    handles = [Line2D([], [], label=f"entry {number}") for number in range(count)]
    legend = common_legend(axes, handles)
    figure.draw_without_rendering()
    return figure, axes, legend


def test_a_legend_below_is_read_row_by_row_and_no_wider_than_the_figure():
    figure, (axes,), legend = legend_of(7)
    at = {text.get_text(): text.get_window_extent() for text in legend.get_texts()}
    ordered = [name for name, _ in sorted(at.items(), key=lambda item: (-round(item[1].y0), item[1].x0))]
    assert ordered == [f"entry {number}" for number in range(7)]
    assert len({round(box.y0) for box in at.values()}) == 2
    assert legend.get_window_extent().width <= figure.bbox.width
    assert legend.get_window_extent().y1 < axes.get_tightbbox().y0


def test_a_free_place_takes_the_legend():
    _, axes, legend = legend_of(5, panels=3, width_in=PAGE_IN)
    box = legend.get_window_extent()
    assert box.x0 > axes[2].get_tightbbox().x1
    assert box.y1 < axes[1].get_tightbbox().y0
    assert [text.get_text() for text in legend.get_texts()] == [f"entry {number}" for number in range(5)]


@pytest.mark.parametrize("panels", [1, 2])
def test_no_height_of_rows_of_maps_is_empty_and_their_width_stays(panels):
    figure, axes = new_figure(PAGE_IN, panels=panels, columns=1)
    for panel in axes:
        panel.imshow(np.zeros((10, 20)))
        panel.set_title("title")
    common_legend(axes, [Line2D([], [], label="entry")])
    figure.draw_without_rendering()
    before = axes[0].get_window_extent().width
    trim_height(figure)
    assert axes[0].get_window_extent().width == pytest.approx(before, rel=1e-3)
    edges = sorted([(box.y0, box.y1) for box in (part.get_tightbbox() for part in (*axes, *figure.legends))])
    gaps = [upper[0] - lower[1] for lower, upper in pairwise(edges)]
    assert max(gaps) < 0.1 * figure.dpi
    assert figure.bbox.height - edges[-1][1] < 0.1 * figure.dpi


@pytest.mark.parametrize(
    ("key", "colour"),
    [
        ("obstacle avoidance", COLOURS["avoidance"]),
        ("force, obstacle course", COLOURS["set 1"]),
        ("force, cycle 1, obstacle course", COLOURS["set 1"]),
        ("joystick, cycle 1, obstacle course", COLOURS["set 1"]),
        ("joystick, corridor", COLOURS["set 3"]),
        ("unknown, obstacle course", "#8C8C8C"),
    ],
)
def test_special_sets_have_colours_of_their_own(key, colour):
    assert colour_of(key) == colour


def test_the_study_s_groups_are_distinct_for_every_colour_vision():
    groups = ["force, cycle 1", "force, cycle 2", "joystick", "obstacle avoidance"]
    groups += ["replay of the learnt policy", "replay of the joystick"]
    for one, other in combinations(groups, 2):
        for sight, matrix in SIGHTS.items():
            apart = np.linalg.norm(lab(colour_of(one), matrix) - lab(colour_of(other), matrix))
            assert apart > 18, (one, other, sight)
    replays = [lab(colour_of(group))[0] for group in groups[3:]]
    assert min(abs(one - other) for one, other in combinations(replays, 2)) > 15  # Fig. 5 in grey print


@pytest.mark.parametrize("levels", range(2, 11))
def test_levels_darken_away_from_the_middle_on_both_sides(levels):
    lightness = [lab(colour)[0] for colour in level_colours(levels)]
    assert (np.diff(lightness[: (levels + 1) // 2]) > 0).all()
    assert (np.diff(lightness[levels // 2 :]) < 0).all()
    if levels % 2:
        assert lightness[levels // 2] > 95


@pytest.mark.parametrize("levels", [2, 3, 4, 5])
def test_up_to_five_levels_differ_in_grey_print(levels):
    lightness = [lab(colour)[0] for colour in level_colours(levels)]
    assert min(abs(one - other) for one, other in combinations(lightness, 2)) > 8
