"""Figures of a study: completion times, paths by condition, policies in several scenes."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from figure_checks import assert_no_overlap, labelled, layouts
from figure_factory import demonstration, room
from matplotlib.colors import to_hex

from navirl_cli.demos.demonstration import Condition
from navirl_cli.errors import DemonstrationError, SceneError
from navirl_cli.figures import times
from navirl_cli.figures.cells import LEAST_VISITS, draw_reward
from navirl_cli.figures.conditions import draw_path_panels
from navirl_cli.figures.layout import settle
from navirl_cli.figures.policies import draw_policy_and_reward
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN
from navirl_cli.irl.scene import scenes_of
from navirl_cli.irl.solved import SolvedScene

FORCE_S, JOYSTICK_S = (41.0, 35.5, 38.0, 50.0, 36.0), (25.0, 25.0, 26.0, 27.0)
LONG_NAMES = {"the joystick in the left hand": FORCE_S, "force": [30], "joystick": [1e4]}


def completion(times_s, width_in=COLUMN_IN):
    figure, (axes,) = new_figure(width_in, times.HEIGHT_IN)
    return figure, times.draw_completion_times(axes, times_s)


def plain(text):
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_boxes_are_quartiles_and_whiskers_end_within_one_and_a_half_of_their_range():
    _, drawn = completion({"force": FORCE_S, "joystick": JOYSTICK_S})
    for box, median, values in zip(drawn.boxes, drawn.medians, (FORCE_S, JOYSTICK_S), strict=True):
        low, middle, high = np.percentile(values, [25, 50, 75])
        assert (box.get_path().vertices[:, 1].min(), box.get_path().vertices[:, 1].max()) == pytest.approx((low, high))
        assert set(median.get_ydata()) == {middle}
    assert [whisker.get_ydata()[1] for whisker in drawn.whiskers] == [35.5, 41.0, 25.0, 27.0]  # 50 s is farther
    assert [to_hex(box.get_facecolor()) for box in drawn.boxes] == ["#0072b2", "#d55e00"]


def test_every_time_is_a_dot_above_its_modality_and_the_axis_starts_at_0():
    _, drawn = completion({"force": FORCE_S, "joystick": JOYSTICK_S, "walking": ()})
    assert [dots.get_ydata().tolist() for dots in drawn.dots] == [sorted(FORCE_S), sorted(JOYSTICK_S)]
    for at, dots in enumerate(drawn.dots):
        assert np.abs(dots.get_xdata() - at).max() < 0.45
    assert drawn.axes.get_ylim()[0] == 0.0
    assert drawn.axes.get_ylim()[1] > max(FORCE_S)
    assert [label.get_text() for label in drawn.axes.get_xticklabels()] == ["force\n(n = 5)", "joystick\n(n = 4)"]
    assert drawn.axes.get_ylabel() == "completion time [s]"
    assert drawn.axes.get_xlabel().replace("\n", " ") == times.NOTE


def test_medians_are_named_and_visible_beside_the_dots():
    _, drawn = completion({"force": FORCE_S, "joystick": JOYSTICK_S})
    for at, (number, values) in enumerate(zip(drawn.numbers, (FORCE_S, JOYSTICK_S), strict=True)):
        assert number.get_text() == f"{np.median(values):.1f}"
        assert max(drawn.medians[at].get_xdata()) < min(drawn.dots[at].get_xdata())


def test_a_few_long_times_leave_room_for_all_others_on_a_logarithmic_axis():
    _, drawn = completion({"force": FORCE_S, "joystick": [17.0, 18.0, 19.0, 180.0]})
    assert drawn.axes.get_yscale() == "log"
    assert [dots.get_ydata().max() for dots in drawn.dots] == [max(FORCE_S), 180.0]
    assert len(drawn.axes.get_yticks()) >= 4
    assert {label.get_text() for label in drawn.axes.get_yticklabels()} >= {"20", "40", "100"}
    assert completion({"force": FORCE_S})[1].axes.get_yscale() == "linear"


@pytest.mark.parametrize("values", [[30.0], [30.0] * 3, [30.0] * 50, np.linspace(28, 32, 50)])
def test_dots_that_would_overlap_are_moved_sideways_always_in_the_same_manner(values):
    figure, drawn = completion({"force": values, "joystick": [10.0, 50.0]})
    figure.draw_without_rendering()
    places = drawn.axes.transData.transform(drawn.dots[0].get_xydata()) / figure.dpi
    apart = [np.hypot(*(one - other)) for one, other in combinations(places, 2)]
    dot_in = drawn.dots[0].get_markersize() / 72
    assert min(apart, default=1.0) > (0.3 if len(values) == 50 else 1.0) * dot_in
    again = completion({"force": values, "joystick": [10.0, 50.0]})[1]
    np.testing.assert_array_equal(again.dots[0].get_xydata(), drawn.dots[0].get_xydata())
    assert len(set(drawn.dots[1].get_xdata())) == 1  # no dots overlap them


@pytest.mark.parametrize(
    ("width_in", "times_s"),
    layouts(
        (COLUMN_IN, LONG_NAMES),
        (PAGE_IN, {"force": FORCE_S}),
        (COLUMN_IN, {"force": FORCE_S}),
        (COLUMN_IN, {"force": [31.4]}),
        (PAGE_IN, {"force": [31.4]}),
        (PAGE_IN, LONG_NAMES),
    ),
)
def test_no_labels_of_completion_times_overlap(width_in, times_s):
    figure, drawn = completion(times_s, width_in)
    assert_no_overlap(figure)
    assert len(drawn.boxes) == len(times_s)
    widths = [np.ptp(drawn.axes.transData.transform(box.get_path().vertices)[:, 0]) for box in drawn.boxes]
    assert max(widths) / figure.dpi < 0.8


def test_no_times_and_impossible_times_are_refused():
    for nothing in ({}, {"force": []}):
        with pytest.raises(DemonstrationError, match=r"^no completion times to draw$"):
            completion(nothing)
    for wrong in (0.0, -3.0, np.nan, np.inf):
        with pytest.raises(
            DemonstrationError, match=r"completion times of joystick: expected seconds above 0, found \["
        ):
            completion({"force": [3.0], "joystick": [wrong, 2.0]})


FIRST = [demonstration(Condition.FORCE, 1, aside) for aside in (0.3, 0.6)]
SECOND = [demonstration(Condition.FORCE, 2, aside) for aside in (0.4, 0.5, -0.5)]
JOYSTICK = [demonstration(Condition.JOYSTICK, aside_m=0.9)]
REPLAYS = [
    replace(demonstration(Condition.AUTONOMOUS, aside_m=aside), set=part)
    for aside, part in ((0.4, "replay of the learnt policy"), (0.1, "obstacle avoidance"))
]
PANELS = [("cycle 1", FIRST), ("cycle 2", SECOND), ("joystick", JOYSTICK), ("by itself", REPLAYS)]


def conditions(panels, columns=2, width_in=PAGE_IN):
    figure, axes = new_figure(width_in, panels=len(panels), columns=columns)
    return figure, draw_path_panels(axes, panels)


def test_every_condition_has_a_panel_of_its_own():
    _, drawn = conditions(PANELS)
    titles = [plain(panel.axes.get_title()) for panel in drawn.panels]
    assert titles == ["cycle 1 (n = 2)", "cycle 2 (n = 3)", "joystick (n = 1)", "by itself (n = 2)"]
    for panel, (_, members) in zip(drawn.panels, PANELS, strict=True):
        expected = sorted(tuple(one.xy_m[50]) for one in members)
        assert sorted(tuple(line.get_xydata()[50]) for line in panel.lines) == expected
        assert (*panel.axes.get_xlim(), *panel.axes.get_ylim()) == drawn.window_m
        assert panel.axes.get_legend() is None
    assert [panel.axes.get_xlabel() for panel in drawn.panels] == ["", "", "x [m]", "x [m]"]
    assert [panel.axes.get_ylabel() for panel in drawn.panels] == ["y [m]", "", "y [m]", ""]
    colours = [{line.get_color() for line in panel.lines} for panel in drawn.panels]
    replayed = {COLOURS["replay of the learnt policy"], COLOURS["obstacle avoidance"]}
    assert colours == [{COLOURS["force, cycle 1"]}, {COLOURS["force, cycle 2"]}, {COLOURS["joystick"]}, replayed]


def test_one_legend_names_what_is_in_any_panel_and_is_not_its_title():
    _, drawn = conditions(PANELS)
    groups = ["force, cycle 1", "force, cycle 2", "obstacle avoidance", "replay of the learnt policy"]
    marks = ["start", "goal", "robot", "person", "obstacle, inflated"]
    entries = dict(
        zip([text.get_text() for text in drawn.legend.get_texts()], drawn.legend.legend_handles, strict=True)
    )
    assert set(entries) == {*groups, *marks}
    assert [entries[group].get_color() for group in groups] == [COLOURS[group] for group in groups]


def test_the_legend_explains_contact_and_unknown_contact_is_not_drawn():
    pushed = replace(FIRST[0], contacts=demonstration(contacts=[(2.0, 4.0)]).contacts)
    _, drawn = conditions([("cycle 1", [pushed]), ("cycle 2", [replace(SECOND[0], contacts=None)])])
    assert [len(panel.contacts) for panel in drawn.panels] == [1, 0]
    assert "in contact" in [text.get_text() for text in drawn.legend.get_texts()]


def test_all_panels_show_what_the_widest_needs():
    wide = replace(FIRST[0], grid=room(rows=40, columns=120, origin_m=(-6.0, -2.0)))
    _, drawn = conditions([("wide", [wide]), ("narrow", SECOND)])
    assert drawn.window_m == pytest.approx(room(40, 120, (-6.0, -2.0)).extent_m)
    assert {(*panel.axes.get_xlim(), *panel.axes.get_ylim()) for panel in drawn.panels} == {drawn.window_m}


@pytest.mark.parametrize(
    ("count", "columns", "width_in"),
    layouts((2, 2, COLUMN_IN), (3, 2, PAGE_IN), (4, 2, PAGE_IN), (2, 1, COLUMN_IN)),
)
def test_panels_are_of_one_size_and_no_texts_overlap(count, columns, width_in):
    panels = [(f"{title} with the participants' hands", members) for title, members in PANELS[:count]]
    figure, drawn = conditions(panels, columns, width_in)
    settle(figure)
    assert_no_overlap(figure)
    boxes = [panel.axes.get_window_extent() for panel in drawn.panels]
    assert np.ptp([box.width for box in boxes]) < 1.0
    assert sum(box.width for box in boxes[:columns]) > (0.75 if width_in == COLUMN_IN else 0.85) * figure.bbox.width
    assert not any(drawn.legend.get_window_extent().overlaps(panel.axes.get_tightbbox()) for panel in drawn.panels)


def test_panels_without_paths_are_refused():
    with pytest.raises(DemonstrationError, match=r"^no condition to draw$"):
        draw_path_panels([], [])
    with pytest.raises(DemonstrationError, match=r"^no demonstration to draw for the panel 'joystick'$"):
        conditions([("force", FIRST), ("joystick", [])])


@cache
def scenes():
    """Two scenes on one map, with made up numbers: visits up to 3, rewards of two ranges."""
    found = []
    for title, people_m, span in (("one person", [(0.0, 0.1)], 4.0), ("two people", [(-1.0, 0.4), (1.0, -0.3)], 7.0)):
        scene = scenes_of([demonstration(people_m=people_m)])[0]
        x, y = scene.lattice.xy_m.T
        visits, reward = 0.4 * span * np.exp(-((y / 0.2) ** 2)), -span * np.exp(-(x**2) - y**2)
        found.append((title, SolvedScene(scene, visits, reward)))
    return found


def policies(entries, width_in=PAGE_IN):
    figure, axes = new_figure(width_in, panels=2 * len(entries), columns=2)
    return figure, draw_policy_and_reward(axes, entries, 0.3)


@cache
def both_scenes():
    return policies(scenes())


def test_every_scene_is_a_row_of_policy_and_reward_over_the_same_window():
    figure, drawn = both_scenes()
    for (title, one), policy, of_reward in zip(scenes(), drawn.policies, drawn.rewards, strict=True):
        scene = one.scene
        columns, rows = scene.lattice.cells.T
        np.testing.assert_array_equal(policy.image.get_array()[rows, columns], one.visits)
        np.testing.assert_array_equal(of_reward.image.get_array()[rows, columns], one.reward_by_cell)
        assert policy.window_m == of_reward.window_m
        assert (*of_reward.axes.get_xlim(), *of_reward.axes.get_ylim()) == policy.window_m
        assert (policy.axes.get_title(loc="left"), of_reward.axes.get_title()) == (title, "")
        assert [len(one.people) for one in (policy, of_reward)] == [len(scene.people_m)] * 2
        assert labelled(policy.axes, "start").get_xydata().tolist() == [scene.lattice.xy_m[scene.start].tolist()]
        robots = [circle for circle in policy.axes.patches if circle not in policy.people]
        assert [circle.radius for circle in robots] == [0.3]
    names = [text.get_text() for text in drawn.legend.get_texts()]
    assert names == ["nominal path", "start", "goal", "robot", "person", "obstacle, inflated"]
    assert [axes.get_legend() for axes in figure.axes] == [None] * len(figure.axes)


def test_a_large_map_is_cropped_alike_in_both_panels_to_where_the_policy_leads():
    scene = scenes_of([demonstration(grid=room(150, 150, (-7.5, -7.5)))])[0]
    visits = np.where(np.hypot(*(scene.lattice.xy_m - (0.0, 3.0)).T) < 0.1, 1.0, 0.0)
    _, drawn = policies([("large", SolvedScene(scene, visits, np.zeros(scene.lattice.size)))])
    assert drawn.policies[0].window_m[3] == pytest.approx(4.5, abs=0.11)  # 1.5 m beyond the visits
    assert drawn.rewards[0].window_m == drawn.policies[0].window_m


def test_equal_numbers_have_equal_colours_in_all_scenes():
    _, drawn = both_scenes()
    alone = [draw_reward(new_figure()[1][0], one.scene, one.reward_by_cell) for _, one in scenes()]
    low, high = (limit([one.image.get_clim()[end] for one in alone]) for end, limit in ((0, min), (1, max)))
    assert low < min(alone[0].image.get_clim())
    assert {one.image.get_clim() for one in drawn.rewards} == {(low, high)}
    most = max(one.visits.max() for _, one in scenes())
    assert {one.image.get_clim() for one in drawn.policies} == {(LEAST_VISITS, most)}


def test_one_colour_bar_stands_above_each_column():
    figure, drawn = both_scenes()
    figure.draw_without_rendering()
    for column, label in (
        (drawn.policies, "expected visits"),
        (drawn.rewards, "state reward per step (without path length)"),
    ):
        (bar,) = {one.colour_bar for one in column}
        assert bar.ax.get_xlabel() == label
        of_bar, of_map = bar.outline.get_window_extent(), column[0].axes.get_window_extent()
        assert of_bar.y0 > of_map.y1
        assert (of_bar.x0, of_bar.x1) == pytest.approx((of_map.x0, of_map.x1), abs=1.0)
        assert (bar.vmin, bar.vmax) == pytest.approx(column[0].image.get_clim())
    assert len(figure.axes) == 2 * len(scenes()) + 2
    assert [child for axes in figure.axes for child in axes.child_axes] == []
    numbers = [label.get_text() for label in drawn.policies[0].colour_bar.ax.get_xticklabels()]
    assert [number for number in numbers if 0.001 <= float(number) <= 1] == ["0.001", "0.01", "0.1", "1"]
    assert [drawn.policies[0].colour_bar.extend, drawn.rewards[0].colour_bar.extend] == ["min", "max"]


def test_the_bar_of_rewards_is_pointed_where_a_scene_has_more():
    title, one = scenes()[0]
    far = np.where(np.abs(one.scene.lattice.xy_m[:, 1]) > 1.45, -100.0, one.reward_by_cell)
    _, drawn = policies([(title, replace(one, reward_by_cell=far)), scenes()[1]])
    assert drawn.rewards[0].colour_bar.extend == "both"
    assert drawn.rewards[0].image.get_clim()[0] > -10


def test_rows_of_different_places_keep_their_numbers():
    shifted = scenes_of([demonstration(grid=room(44, 80, (-4.0, -2.2)))])[0]
    zeros = np.zeros(shifted.lattice.size)
    _, drawn = policies([scenes()[0], ("elsewhere", SolvedScene(shifted, zeros, zeros))])
    assert [one.axes.get_xlabel() for one in (*drawn.policies, *drawn.rewards)] == ["x [m]"] * 4
    assert [one.axes.get_ylabel() for one in (*drawn.policies, *drawn.rewards)] == ["y [m]"] * 2 + [""] * 2


@pytest.mark.parametrize(("count", "width_in"), [(1, PAGE_IN), (2, COLUMN_IN)])
def test_no_texts_in_rows_of_policies_overlap(count, width_in):
    entries = [
        (f"{title} beside an obstacle that is in none of the demonstrations at all, only here", one)
        for title, one in scenes()[:count]
    ]
    figure, drawn = policies(entries, width_in)
    settle(figure)
    assert_no_overlap(figure)
    boxes = [one.axes.get_window_extent() for one in (*drawn.policies, *drawn.rewards)]
    assert np.ptp([box.width for box in boxes]) < 1.0
    assert boxes[0].width > (0.38 if width_in == COLUMN_IN else 0.43) * figure.bbox.width


def test_scenes_that_cannot_be_drawn_are_refused():
    with pytest.raises(SceneError, match=r"^no scene to draw$"):
        draw_policy_and_reward([], [], 0.3)
    title, one = scenes()[0]
    with pytest.raises(ValueError, match=r"expected one value for each of \d+ states, found shape \(3,\)"):
        policies([(title, replace(one, reward_by_cell=np.zeros(3)))])
