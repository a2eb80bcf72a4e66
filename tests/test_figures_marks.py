"""Marks on every map: scale bar, goals outside of the view, people, paths over values."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from figure_checks import assert_no_overlap, legend_texts
from figure_factory import PUBLISHED, demonstration, one_axes, room, scene, scene_and_visits

from navirl_cli.demos.demonstration import Condition
from navirl_cli.figures.cells import LIKELY_VISITS, draw_policy, draw_reward, likely_window
from navirl_cli.figures.conditions import draw_path_panels
from navirl_cli.figures.ground import CROPPED_M, cropped_to, inside
from navirl_cli.figures.layout import settle
from navirl_cli.figures.overlay import Overlay, alike
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.policies import draw_policy_and_reward
from navirl_cli.figures.scale import length_m
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN
from navirl_cli.irl.solved import SolvedScene


@pytest.mark.parametrize(
    ("width_m", "expected"),
    [
        (0.9, 0.2),
        (2.6, 0.5),
        (4.0, 1.0),
        (8.0, 1.0),
        (12.0, 1.0),
        (13.0, 2.0),
        (60.0, 10.0),
        (900.0, 200.0),
        (1.2, 0.2),
    ],
)
def test_a_scale_bar_is_one_metre_or_a_round_number_that_fits(width_m, expected):
    assert length_m(width_m) == pytest.approx(expected)


@pytest.mark.parametrize("width_in", [COLUMN_IN, PAGE_IN])
def test_the_scale_bar_is_to_scale_and_labelled_below_the_map(width_in):
    drawn = draw_paths(one_axes(width_in), [demonstration(aside_m=-1.2)])
    settle(drawn.axes.figure)
    bar = drawn.marks.scale_bar
    assert np.ptp(bar.get_xdata()) == pytest.approx(1.0)
    assert max(bar.get_xdata()) == pytest.approx(drawn.axes.get_xlim()[1])
    (number,) = drawn.axes.texts
    assert number.get_text() == "1 m"
    drawn.axes.figure.draw_without_rendering()
    label = drawn.axes.xaxis.label.get_window_extent()
    for mark in (number.get_window_extent(), bar.get_window_extent()):
        assert mark.y1 < drawn.axes.bbox.y0
        assert mark.x0 > label.x1
        assert label.y0 < (mark.y0 + mark.y1) / 2 < label.y1
    assert number.get_window_extent().x1 < bar.get_window_extent().x0
    assert bar.get_label() not in legend_texts(drawn.axes)
    assert_no_overlap(drawn.axes.figure)


def test_a_scale_bar_without_room_beside_the_label_is_left_out():
    _, axes = new_figure(COLUMN_IN, panels=3)
    drawn = draw_paths(axes[0], [demonstration()])
    assert drawn.marks.scale_bar is None
    assert not drawn.axes.texts


def test_maps_with_one_view_have_the_scale_bar_where_the_label_is():
    _, axes = new_figure(PAGE_IN, panels=4, columns=2)
    drawn = draw_path_panels(axes, [(name, [demonstration()]) for name in "abcd"])
    shown = [one.marks.scale_bar.get_visible() for one in drawn.panels]
    assert shown == [bool(panel.get_xlabel()) for panel in axes] == [False, False, True, True]
    assert [[text.get_visible() for text in panel.texts] for panel in axes] == [[one] for one in shown]


def test_a_goal_outside_of_the_map_is_an_arrow_at_its_border():
    far = replace(demonstration(), goal_m=(50.0, 30.0))
    drawn = draw_paths(one_axes(), [demonstration(), far])
    assert drawn.marks.goals.get_xydata().tolist() == [[3.0, 0.05]]
    (arrow,) = drawn.marks.beyond
    x, y = arrow.get_xydata()[0]
    x0, x1, y0, y1 = room().extent_m
    assert x0 < x < x1
    assert y0 < y < y1
    assert (x1 - x, y1 - y) == pytest.approx((0.16, 0.16))
    tip, *tail, _ = arrow.get_marker()
    assert tip == pytest.approx(np.array([50.0 - x, 30.0 - y]) / np.hypot(50.0 - x, 30.0 - y))
    assert np.mean(tail, axis=0) == pytest.approx(-tip)
    assert {"goal", "goal outside"} < set(legend_texts(drawn.axes))


def test_a_goal_that_is_not_shown_is_not_in_the_legend():
    texts = legend_texts(draw_paths(one_axes(), [replace(demonstration(), goal_m=(50.0, 0.0))]).axes)
    assert "goal outside" in texts
    assert "goal" not in texts
    assert "goal outside" not in legend_texts(draw_paths(one_axes(), [demonstration()]).axes)


def test_people_at_different_places_have_the_line_style_of_their_paths():
    ones = [demonstration(aside_m=aside, people_m=[(x, 0.1)]) for aside, x in ((0.5, 0.0), (0.4, 1.0), (0.3, 0.0))]
    drawn = draw_paths(one_axes(), ones)
    kinds = [line._dash_pattern for line in drawn.lines]
    assert kinds[0] == kinds[2] != kinds[1]
    first, second = drawn.people
    assert [one.center[0] for one in (first, second)] == [0.0, 1.0]
    assert first.get_linestyle() != second.get_linestyle()
    assert drawn.lines[0].get_linestyle() == "-"
    assert "person (outlined like its paths)" in legend_texts(drawn.axes)


def test_people_of_all_trials_and_paths_without_people_have_solid_lines():
    both = demonstration(people_m=[(0.0, 0.1), (1.0, -1.0)])
    drawn = draw_paths(one_axes(), [both, demonstration(people_m=[(0.0, 0.1)]), demonstration(people_m=[])])
    assert [line.is_dashed() for line in drawn.lines] == [False, True, False]
    assert [one.get_linestyle() in {"-", "solid"} for one in drawn.people] == [True, True]


def test_lines_are_solid_with_one_place_or_too_many_places():
    for places in ([0.0, 0.001], [0.0, 0.5, 1.0, 1.5, 2.0]):
        drawn = draw_paths(one_axes(), [demonstration(people_m=[(x, 0.1)]) for x in places])
        assert not any(line.is_dashed() for line in drawn.lines)
        label = "person" if len(drawn.people) == 1 else "person (5 places)"
        assert label in legend_texts(drawn.axes)


def test_a_person_who_is_not_shown_is_not_in_the_legend():
    axes = draw_paths(one_axes(), [demonstration(people_m=[(-3.0, 1.5)])], window_m=(-1.0, 1.0, -1.0, 1.0)).axes
    assert "person" not in legend_texts(axes)


def test_a_cropped_map_includes_paths_and_the_people_near_them():
    near, far = (0.0, 1.5), (30.0, 30.0)
    grid = room(800, 800, (-40.0, -40.0))
    one = demonstration(grid=grid, people_m=[near, far], aside_m=0.0)
    drawn = draw_paths(one_axes(), [one], crop=True)
    low, high = one.xy_m.min(axis=0), one.xy_m.max(axis=0)
    margin = CROPPED_M
    expected = (low[0] - margin, high[0] + margin, low[1] - margin, 1.5 + 0.25 + 0.75)
    assert (*drawn.axes.get_xlim(), *drawn.axes.get_ylim()) == pytest.approx(expected)
    assert "person" in legend_texts(drawn.axes)  # the near one alone


def test_a_crop_has_room_for_a_robot_on_either_side_of_a_person():
    grid = room(800, 800, (-40.0, -40.0))
    one = demonstration(grid=grid, people_m=[(0.0, 0.0)], aside_m=1.0)
    low, high = draw_paths(one_axes(), [one], crop=True).axes.get_ylim()
    assert low <= -0.25 - 2 * one.robot_radius_m
    assert high > 1.0


def test_a_crop_ends_with_a_small_map():
    assert cropped_to([room()], np.array([(-3.9, 0.0), (3.0, 0.1)]), np.empty((0, 2))) == pytest.approx(
        (-4.0, 3.5, -0.5, 0.6)
    )


def test_a_scene_is_cropped_to_where_its_policy_leads_and_to_paths_over_it():
    a_scene, visits = scene_and_visits()
    window = likely_window(a_scene, visits)
    likely = a_scene.lattice.xy_m[visits >= LIKELY_VISITS]
    assert inside(window, likely).all()
    assert window[3] - window[2] < 3.0  # the room is 4 m high
    line = np.array([(0.0, 0.0), (0.0, -1.9)])
    assert likely_window(a_scene, visits, [line])[2] == pytest.approx(-2.0)


def overlays():
    lines = [demonstration(aside_m=aside).xy_m for aside in (0.5, 0.7)]
    return [Overlay("force", "force", lines), Overlay("sampled from the policy", "learnt", lines * 6)]


@pytest.mark.parametrize("draw", ["policy", "reward"])
def test_paths_over_values_are_thin_and_have_the_colour_of_their_group(draw):
    a_scene, visits = scene_and_visits()
    axes, paths = one_axes(), overlays()
    if draw == "policy":
        drawn = draw_policy(axes, a_scene, visits, overlays=paths)
    else:
        drawn = draw_reward(axes, a_scene, PUBLISHED.by_cell(a_scene), overlays=paths)
    expected = [line for kind in paths for line in kind.lines_m]
    for line, path in zip(drawn.overlays, expected, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), path)
    assert [line.get_color() for line in drawn.overlays] == [COLOURS["force"]] * 2 + [COLOURS["learnt"]] * 12
    assert drawn.obstacles.get_zorder() < drawn.nominal.get_zorder() < drawn.overlays[0].get_zorder()
    assert drawn.overlays[0].get_zorder() < drawn.people[0].get_zorder()
    assert max(line.get_linewidth() for line in drawn.overlays) < drawn.nominal.get_linewidth()
    assert drawn.overlays[-1].get_alpha() < drawn.overlays[0].get_alpha()  # many let through what is below
    assert legend_texts(axes)[:2] == ["force (n = 2)", "sampled from the policy (n = 12)"]


def test_no_texts_overlap_on_a_map_with_everything():
    a_scene, visits = scene_and_visits()
    drawn = draw_policy(one_axes(), a_scene, visits, overlays=overlays(), robot_radius_m=0.3, title="policy")
    settle(drawn.axes.figure)
    assert_no_overlap(drawn.axes.figure)


def test_demonstrations_of_a_scene_have_its_map_people_start_and_goal():
    one = demonstration()
    same = demonstration(Condition.JOYSTICK, aside_m=0.4)
    others = [
        demonstration(people_m=[(0.0, 0.5)]),
        demonstration(people_m=[]),
        demonstration(people_m=[(0.0, 0.1), (2.0, 1.0)]),
        demonstration(grid=room(origin_m=(-4.0, -1.9))),
        replace(one, xy_m=one.xy_m + np.array([0.0, 0.26])),
        replace(one, xy_m=one.xy_m * np.where(np.arange(101) == 100, 0.8, 1.0)[:, None]),
    ]
    assert alike([one, same, *others], one) == [one, same]
    for other, another in combinations(others, 2):
        assert alike([another], other) in ([], [another])
    assert alike([one], others[2]) == []  # as many people as places is not enough
    nobody = demonstration(people_m=[])
    assert alike([nobody], nobody) == [nobody]
    assert scene() is not None


def test_a_line_style_means_one_place_in_all_panels():
    here, there = (demonstration(people_m=[(x, 0.1)]) for x in (0.0, 1.0))
    _, axes = new_figure(PAGE_IN, panels=2)
    drawn = draw_path_panels(axes, [("both", [here, there]), ("there", [there])])
    assert [[line.is_dashed() for line in panel.lines] for panel in drawn.panels] == [[False, True], [True]]


def test_panels_can_be_cropped_to_the_paths_of_all():
    up, down = demonstration(aside_m=0.8), demonstration(aside_m=-0.8)
    windows = [
        draw_path_panels(new_figure(PAGE_IN, panels=2)[1], [("up", [up]), ("down", [down])], crop=crop).window_m
        for crop in (False, True)
    ]
    low, high = down.xy_m[:, 1].min() - CROPPED_M, up.xy_m[:, 1].max() + CROPPED_M
    assert windows[0] == pytest.approx(room().extent_m)
    assert windows[1] == pytest.approx((-3.5, 3.5, low, high))


def test_one_scene_under_two_rewards_has_one_window_and_one_scale_of_colours():
    a_scene, visits = scene_and_visits()
    _, axes = new_figure(PAGE_IN, panels=4, columns=2)
    one = SolvedScene(a_scene, visits, PUBLISHED.by_cell(a_scene))
    twice = SolvedScene(a_scene, 2 * visits, 2 * one.reward_by_cell)
    window = (-3.5, 3.5, -1.0, 1.5)
    drawn = draw_policy_and_reward(axes, [("a", one), ("b", twice)], 0.3, window)
    assert {one.window_m for one in (*drawn.policies, *drawn.rewards)} == {window}
    assert {(*panel.get_xlim(), *panel.get_ylim()) for panel in axes} == {window}
    for kind in (drawn.policies, drawn.rewards):
        assert kind[0].image.get_clim() == kind[1].image.get_clim()
        assert kind[0].colour_bar is kind[1].colour_bar
    least = [one.image.get_array().min() for one in drawn.rewards]
    assert drawn.rewards[0].image.get_clim()[0] < least[0] / 1.5
