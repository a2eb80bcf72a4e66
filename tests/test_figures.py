"""Figures of paths: paths, obstacles, people, and the view of the map."""

import numpy as np
import pytest
from figure_checks import labelled, legend_texts
from figure_factory import demonstration, one_axes, room
from matplotlib.colors import to_hex

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.ground import window_around
from navirl_cli.figures.layout import trim_height
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN


def test_every_path_is_drawn_where_it_was_driven_in_the_colour_of_its_group():
    ones = [
        demonstration(Condition.AUTONOMOUS, aside_m=0.0),
        demonstration(Condition.FORCE, 2, 0.4),
        demonstration(Condition.JOYSTICK, aside_m=-0.5),
        demonstration(Condition.FORCE, 1, 0.6),
    ]
    drawn = draw_paths(one_axes(), ones)
    for line, one in zip(drawn.lines, [ones[3], ones[1], ones[2], ones[0]], strict=True):
        np.testing.assert_array_equal(line.get_xydata(), one.xy_m)
    assert [line.get_color() for line in drawn.lines] == ["#56B4E9", "#0072B2", "#D55E00", "#009E73"]


def test_the_legend_names_groups_with_their_counts_and_what_the_marks_mean():
    ones = [
        demonstration(Condition.FORCE, 1),
        demonstration(Condition.FORCE, 1, 0.3),
        demonstration(Condition.JOYSTICK),
    ]
    drawn = draw_paths(one_axes(), ones)
    assert legend_texts(drawn.axes) == [
        "force, cycle 1 (n = 2)",
        "joystick (n = 1)",
        "start",
        "goal",
        "robot",
        "person",
        "obstacle, inflated",
    ]
    handles = drawn.axes.get_legend().legend_handles
    assert [handle.get_color() for handle in handles[:2]] == [COLOURS["force, cycle 1"], COLOURS["joystick"]]


def test_the_legend_can_be_left_out():
    assert draw_paths(one_axes(), [demonstration()], legend=False).axes.get_legend() is None


def test_a_legend_is_as_wide_as_its_panel_at_most():
    ones = [demonstration(condition, 12) for condition in Condition]
    for panels, width_in in ((1, COLUMN_IN), (1, PAGE_IN), (3, PAGE_IN)):
        figure, axes = new_figure(width_in, panels=panels)
        draw_paths(axes[0], ones)
        figure.draw_without_rendering()
        legend = axes[0].get_legend().get_window_extent()
        assert legend.width / figure.dpi <= width_in / panels
        assert legend.y1 < axes[0].xaxis.label.get_window_extent().y0


def test_sections_in_contact_are_thicker():
    drawn = draw_paths(one_axes(), [demonstration(contacts=[(2.05, 4.0), (9.0, 20.0)])])
    first, second = drawn.contacts
    np.testing.assert_allclose(first.get_xdata()[[0, -1]], [-3.0 + 0.6 * 2.05, -3.0 + 0.6 * 4.0])
    assert len(first.get_xdata()) == 2 + 19  # poses at 2.1 .. 3.9 s between the two ends
    np.testing.assert_allclose(second.get_xdata()[[0, -1]], [2.4, 3.0])
    assert first.get_linewidth() > 2 * drawn.lines[0].get_linewidth()
    assert first.get_color() == drawn.lines[0].get_color()
    assert "in contact" in legend_texts(drawn.axes)


def test_obstacles_are_where_the_map_has_them_and_free_cells_are_white():
    grid = room()
    drawn = draw_paths(one_axes(), [demonstration(grid=grid)])
    (image,) = drawn.obstacles
    assert tuple(image.get_extent()) == grid.extent_m
    assert image.origin == "lower"
    np.testing.assert_array_equal(image.get_array().mask, ~grid.occupied)
    assert to_hex(image.to_rgba(image.get_array())[0, 0]) == "#d4d4d4"
    assert image.to_rgba(image.get_array())[20, 20, 3] == 0.0


def test_cells_that_one_path_drove_through_are_free_on_the_shared_map():
    grid = room()
    freed = grid.freed(np.array([[50, 2]]))
    drawn = draw_paths(one_axes(), [demonstration(grid=grid), demonstration(grid=freed)])
    (image,) = drawn.obstacles
    np.testing.assert_array_equal(image.get_array().mask, ~freed.occupied)


def test_maps_of_different_places_are_all_drawn():
    shifted = room(origin_m=(-4.0, -1.8))
    drawn = draw_paths(one_axes(), [demonstration(), demonstration(grid=shifted)])
    assert [tuple(image.get_extent()) for image in drawn.obstacles] == [room().extent_m, shifted.extent_m]
    np.testing.assert_allclose(drawn.axes.get_ylim(), (-2.0, 2.2))


def test_people_and_robot_are_drawn_to_scale_once():
    ones = [
        demonstration(aside_m=0.5, people_m=[(0.0, 0.1)]),
        demonstration(aside_m=0.3, people_m=[(0.001, 0.1), (1.0, -1.0)]),
    ]
    drawn = draw_paths(one_axes(), ones)
    assert [circle.center for circle in drawn.people] == [(0.0, 0.1), (1.0, -1.0)]
    assert {circle.radius for circle in drawn.people} == {0.25}
    assert "person (outlined like its paths)" in legend_texts(drawn.axes)
    (robot,) = drawn.robots
    np.testing.assert_allclose(robot.center, ones[0].xy_m[0])
    assert robot.radius == 0.3


@pytest.mark.parametrize("count", [1, 3, 20])
def test_people_of_different_trials_do_not_hide_each_other_or_a_path(count):
    ones = [demonstration(people_m=[(0.05 * n, 0.1)]) for n in range(count)]
    drawn = draw_paths(one_axes(), ones)
    discs = [patch for patch in drawn.axes.patches if patch.get_fill()]
    assert [disc.center for disc in discs] == [outline.center for outline in drawn.people]
    assert len(discs) == count
    assert {disc.radius for disc in discs} == {0.25}
    opacity = discs[0].get_facecolor()[3]
    assert 1 - (1 - opacity) ** count == pytest.approx(0.9)  # all of them together
    assert not any(outline.get_fill() for outline in drawn.people)
    below, above = max(disc.get_zorder() for disc in discs), min(line.get_zorder() for line in drawn.people)
    assert drawn.obstacles[0].get_zorder() < below < drawn.lines[0].get_zorder() < above


def test_starts_at_different_places_have_an_outline_each():
    shifted = Demonstration(**{**vars(demonstration()), "xy_m": demonstration().xy_m + np.array([0.0, 0.4])})
    drawn = draw_paths(one_axes(), [demonstration(), shifted])
    assert len(drawn.robots) == 2
    np.testing.assert_allclose(labelled(drawn.axes, "start").get_ydata(), [0.05, 0.45])
    np.testing.assert_allclose(labelled(drawn.axes, "goal").get_xydata(), [(3.0, 0.05)])


def test_without_people_the_legend_has_no_person():
    drawn = draw_paths(one_axes(), [demonstration(people_m=[])])
    assert drawn.people == []
    assert "person" not in legend_texts(drawn.axes)


def test_no_demonstration_is_refused():
    with pytest.raises(DemonstrationError, match=r"^no demonstration to draw$"):
        draw_paths(one_axes(), [])


def test_axes_are_metres_to_the_same_scale():
    axes = draw_paths(one_axes(), [demonstration()], title="all trials").axes
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("x [m]", "y [m]", "all trials")
    assert axes.get_aspect() == 1.0
    np.testing.assert_allclose((*axes.get_xlim(), *axes.get_ylim()), room().extent_m)


def test_a_large_map_is_cropped_to_the_paths_and_a_margin():
    points = np.array([(-1.0, 0.0), (2.0, 0.5)])
    assert window_around([room(300, 300, (-15.0, -15.0))], points) == pytest.approx((-2.5, 3.5, -1.5, 2.0))


def test_a_crop_ends_where_the_map_ends():
    points = np.array([(-14.5, 0.0), (2.0, 0.5)])
    assert window_around([room(300, 300, (-15.0, -15.0))], points)[0] == pytest.approx(-15.0)


def test_a_map_of_the_paths_size_is_shown_whole():
    points = np.array([(-3.0, 0.0), (3.0, 0.5)])
    assert window_around([room()], points) == pytest.approx(room().extent_m)


@pytest.mark.parametrize("beyond", [(50.0, 0.0), (-50.0, 30.0), (6.0, -90.0)])
def test_points_outside_of_the_map_do_not_widen_the_view(beyond):
    assert window_around([room()], np.array([(-3.0, 0.0), (3.0, 0.0), beyond])) == pytest.approx(room().extent_m)


def test_a_crop_towards_a_point_outside_of_the_map_ends_with_the_map():
    points = np.array([(-1.0, 0.0), (2.0, 0.5), (50.0, 0.0)])
    assert window_around([room(300, 300, (-15.0, -15.0))], points) == pytest.approx((-2.5, 15.0, -1.5, 2.0))


def test_a_goal_far_outside_of_the_map_does_not_change_the_figure():
    far = Demonstration(**{**vars(demonstration()), "goal_m": (50.0, 0.0)})
    sizes = []
    for one in (demonstration(), far):
        axes = draw_paths(one_axes(), [one]).axes
        trim_height(axes.figure)
        np.testing.assert_allclose((*axes.get_xlim(), *axes.get_ylim()), room().extent_m)
        sizes.append(tuple(axes.figure.get_size_inches()))
    assert sizes[0] == pytest.approx(sizes[1])


def test_a_window_can_be_given():
    axes = draw_paths(one_axes(), [demonstration()], window_m=(-1.0, 1.0, -2.0, 2.0)).axes
    assert (*axes.get_xlim(), *axes.get_ylim()) == (-1.0, 1.0, -2.0, 2.0)
