"""Figures of values by cell: the propagated policy and the state reward."""

import numpy as np
import pytest
from figure_checks import assert_cells, layouts, legend_texts
from figure_factory import PUBLISHED, one_axes, scene, scene_and_visits
from matplotlib.colors import to_rgba

from navirl_cli.figures.cells import LEAST_VISITS, REACH_M, draw_policy, draw_reward
from navirl_cli.figures.layout import settle
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN, DPI, PAGE_IN

#: A window so flat that its colour bar stands above it.
FLAT = (-3.5, 3.5, -1.0, 1.0)


def test_the_policy_is_drawn_as_visits_on_a_logarithmic_scale():
    a_scene, visits = scene_and_visits()
    drawn = draw_policy(one_axes(), a_scene, visits, robot_radius_m=0.3)
    assert_cells(drawn, a_scene, visits)
    norm = drawn.image.norm
    assert (norm.vmin, norm.vmax) == (LEAST_VISITS, visits.max())
    assert norm(np.sqrt(LEAST_VISITS)) == pytest.approx(0.5, rel=1e-3)
    assert drawn.colour_bar.ax.get_ylabel() == "expected visits"
    assert legend_texts(drawn.axes) == ["nominal path", "start", "goal", "robot", "person", "obstacle, inflated"]


def test_the_bar_of_visits_is_numbered_in_plain_decades():
    drawn = draw_policy(one_axes(), *scene_and_visits())
    drawn.axes.figure.draw_without_rendering()
    labels = [label.get_text() for label in drawn.colour_bar.ax.get_yticklabels()]
    assert [label for label in labels if label in {"0.001", "0.01", "0.1", "1"}] == ["0.001", "0.01", "0.1", "1"]


def test_unlikely_cells_are_white_and_likely_ones_dark():
    image = draw_policy(one_axes(), *scene_and_visits()).image
    rarely, never, often = (image.to_rgba(np.ma.array([value]))[0] for value in (1e-5, 0.0, 0.5))
    assert tuple(rarely) == to_rgba("white")
    assert never[3] == 0.0  # the paper shows
    assert often[:3].sum() < 1.0


def test_cells_visited_more_than_once_widen_the_scale():
    visits = np.full(scene().lattice.size, 2.5)
    assert draw_policy(one_axes(), scene(), visits).image.norm.vmax == 2.5


def test_the_reward_is_drawn_by_cell_on_a_linear_scale():
    a_scene = scene()
    reward = PUBLISHED.by_cell(a_scene)
    drawn = draw_reward(one_axes(), a_scene, reward)
    assert_cells(drawn, a_scene, reward)
    xy = a_scene.lattice.xy_m
    near = (a_scene.deviation_m <= REACH_M) | (np.hypot(*(xy - a_scene.people_m[0]).T) <= REACH_M)
    assert 0 < near.sum() < a_scene.lattice.size
    assert (drawn.image.norm.vmin, drawn.image.norm.vmax) == (reward[near].min(), reward[near].max())
    assert drawn.colour_bar.ax.get_ylabel() == "state reward per step\n(without path length)"
    assert "robot" not in legend_texts(drawn.axes)


def test_the_reward_scale_spans_what_is_shown():
    a_scene = scene()
    x = a_scene.lattice.xy_m[:, 0]
    drawn = draw_reward(one_axes(), a_scene, x, window_m=(-1.0, 1.0, -2.0, 2.0))
    assert (drawn.image.norm.vmin, drawn.image.norm.vmax) == pytest.approx((-0.95, 0.95))


def test_far_corners_do_not_take_the_colours_of_the_personal_space():
    a_scene = scene()
    reward = PUBLISHED.by_cell(a_scene)
    aside = np.hypot(*(a_scene.lattice.xy_m - a_scene.people_m[0]).T)
    far = (a_scene.deviation_m > REACH_M) & (aside > REACH_M)
    reward[far] = -100.0
    drawn = draw_reward(one_axes(), a_scene, reward)
    assert drawn.image.norm.vmin == reward[~far].min() > -10.0
    assert drawn.colour_bar.extend == "min"
    shades = drawn.image.norm(reward[[a_scene.nominal.argmax(), reward[~far].argmin()]])
    assert shades.max() - shades.min() > 0.5


def test_a_person_off_the_nominal_path_is_within_the_scale():
    a_scene = scene(people_m=[(2.0, 1.5)])
    reward = np.zeros(a_scene.lattice.size)
    beside = np.hypot(*(a_scene.lattice.xy_m - (2.0, 1.5)).T) < 0.1
    assert a_scene.deviation_m[beside].min() > REACH_M
    reward[beside] = -7.0
    drawn = draw_reward(one_axes(), a_scene, reward)
    assert drawn.image.norm.vmin == -7.0


@pytest.mark.parametrize(
    ("beyond", "extend"), [((), "neither"), ((-9.0,), "min"), ((9.0,), "max"), ((-9.0, 9.0), "both")]
)
def test_the_bar_of_the_reward_is_pointed_where_cells_are_outside_of_its_range(beyond, extend):
    a_scene = scene(people_m=[])
    reward = np.linspace(-1.0, 1.0, a_scene.lattice.size)
    far = np.flatnonzero(a_scene.deviation_m > REACH_M)
    reward[far] = 0.0
    reward[far[: len(beyond)]] = beyond
    assert draw_reward(one_axes(), a_scene, reward).colour_bar.extend == extend


def test_a_window_away_from_paths_and_people_spans_what_it_shows():
    a_scene = scene()
    y = a_scene.lattice.xy_m[:, 1]
    drawn = draw_reward(one_axes(), a_scene, y, window_m=(-3.0, -2.0, 1.3, 1.6))
    assert (drawn.image.norm.vmin, drawn.image.norm.vmax) == pytest.approx((1.35, 1.55))


@pytest.mark.parametrize("values", ["policy", "reward"])
def test_people_are_outlines_that_hide_neither_colours_nor_the_nominal_path(values):
    a_scene, visits = scene_and_visits()
    draw = draw_policy if values == "policy" else draw_reward
    drawn = draw(one_axes(), a_scene, visits, robot_radius_m=0.3)
    (person,) = drawn.people
    filled = [patch for patch in drawn.axes.patches if patch.get_fill()]
    assert len(filled) == (values == "policy"), "no visits are that near to the person"
    assert all(patch.get_zorder() < drawn.nominal.get_zorder() for patch in filled)
    assert to_rgba(person.get_edgecolor()) == to_rgba("black")
    (halo,) = person.get_path_effects()
    assert to_rgba(halo._gc["foreground"]) == to_rgba("white")
    assert halo._gc["linewidth"] > person.get_linewidth()
    (robot,) = [patch for patch in drawn.axes.patches if patch not in {person, *filled}]
    assert person.get_linewidth() >= 2 * robot.get_linewidth()  # so that the two are not taken for each other
    entries = dict(zip(legend_texts(drawn.axes), drawn.axes.get_legend().legend_handles, strict=True))
    assert entries["person"].get_markerfacecolor() == ("#F0E442" if filled else "none")
    assert entries["person"].get_markeredgewidth() == person.get_linewidth()


@pytest.mark.parametrize(
    ("width_in", "window"), layouts((COLUMN_IN, None), (PAGE_IN, FLAT), (PAGE_IN, None), (COLUMN_IN, FLAT))
)
def test_the_label_of_a_colour_bar_is_no_longer_than_the_bar(width_in, window):
    drawn = draw_reward(one_axes(width_in), scene(), PUBLISHED.by_cell(scene()), window_m=window)
    drawn.axes.figure.set_dpi(DPI)
    settle(drawn.axes.figure)
    beside = drawn.colour_bar.orientation == "vertical"
    axis = drawn.colour_bar.ax.yaxis if beside else drawn.colour_bar.ax.xaxis
    of_label, of_map = axis.label.get_window_extent(), drawn.axes.get_window_extent()
    assert (window is None) == beside
    assert of_label.height <= of_map.height if beside else of_label.width <= of_map.width


def test_a_reward_that_is_the_same_everywhere_can_be_drawn():
    drawn = draw_reward(one_axes(), scene(people_m=[]), np.zeros(scene().lattice.size))
    drawn.axes.figure.draw_without_rendering()
    assert drawn.people == []


def test_a_colour_bar_is_as_high_as_its_map():
    drawn = draw_reward(one_axes(), scene(), PUBLISHED.by_cell(scene()))
    drawn.axes.figure.draw_without_rendering()
    of_map, of_bar = drawn.axes.get_window_extent(), drawn.colour_bar.outline.get_window_extent()
    assert (of_bar.y0, of_bar.y1) == pytest.approx((of_map.y0, of_map.y1), abs=0.5)
    assert of_bar.x0 > of_map.x1


def test_a_flat_map_has_its_colour_bar_above_under_the_title():
    drawn = draw_policy(one_axes(), *scene_and_visits(), window_m=FLAT, title="policy")
    figure = drawn.axes.figure
    figure.draw_without_rendering()
    of_map, of_label = drawn.axes.get_window_extent(), drawn.colour_bar.ax.xaxis.label.get_window_extent()
    assert drawn.colour_bar.ax.get_xlabel() == "expected visits"
    assert of_map.y1 < of_label.y0 < of_label.y1 < drawn.axes.title.get_window_extent().y0
    assert drawn.axes.title.get_window_extent().y1 <= figure.bbox.y1


def test_two_figures_of_a_scene_can_show_the_same_window():
    a_scene, visits = scene_and_visits()
    _, (left, right) = new_figure(PAGE_IN, panels=2)
    policy = draw_policy(left, a_scene, visits)
    reward = draw_reward(right, a_scene, PUBLISHED.by_cell(a_scene), window_m=policy.window_m)
    assert (*right.get_xlim(), *right.get_ylim()) == policy.window_m == reward.window_m


@pytest.mark.parametrize("draw", [draw_policy, draw_reward])
def test_values_that_are_not_one_for_each_state_are_refused(draw):
    with pytest.raises(ValueError, match=r"expected one value for each of \d+ states, found shape \(3,\)"):
        draw(one_axes(), scene(), np.zeros(3))
