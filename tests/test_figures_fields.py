"""Figures of all cells: the soft value with its contours, and the most likely moves."""

import numpy as np
import pytest
from figure_checks import assert_cells, assert_no_overlap, legend_texts
from figure_factory import PUBLISHED, demonstration, one_axes, room, scene
from matplotlib.colors import to_hex

from navirl_cli.demos.grid import MOVES
from navirl_cli.figures.actions import draw_actions
from navirl_cli.figures.layout import settle
from navirl_cli.figures.overlay import overlays_of
from navirl_cli.figures.style import COLUMN_IN, LOOKS, PAGE_IN, styled
from navirl_cli.figures.values import draw_value
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.scene import scenes_of

SCENE = scene()
POLICY = policy_of(PUBLISHED, SCENE)


def test_the_value_is_drawn_by_cell_up_to_0_at_the_goal():
    drawn = draw_value(one_axes(), SCENE, POLICY.value, robot_radius_m=0.3)
    assert_cells(drawn, SCENE, POLICY.value)
    norm = drawn.image.norm
    assert (norm.vmin, norm.vmax) == (POLICY.value.min(), POLICY.value.max())
    assert norm.vmax == pytest.approx(0.0, abs=1e-9)
    assert drawn.colour_bar.ax.get_ylabel() == "soft value [nats]"
    assert legend_texts(drawn.axes) == ["nominal path", "start", "goal", "robot", "person", "obstacle, inflated"]


def test_contours_are_where_the_value_is_theirs():
    drawn = draw_value(one_axes(), SCENE, POLICY.value)
    levels = drawn.contours.levels
    assert 3 <= len(levels) <= 13
    step = np.diff(levels)
    assert step == pytest.approx(step[0])
    assert f"{step[0]:g}"[0] in "125"
    grid, cells = SCENE.lattice.grid, SCENE.lattice.cells
    checked = 0
    for level, path in zip(levels, drawn.contours.get_paths(), strict=True):
        for vertex in path.vertices[::3]:
            (state,) = SCENE.lattice.states_of(grid.cells_of(vertex)[None])
            around = (np.abs(cells - grid.cells_of(vertex)) <= 1).all(axis=1)
            if state >= 0:
                assert POLICY.value[around].min() <= level <= POLICY.value[around].max()
                checked += 1
    assert checked > 100


def test_contours_have_numbers_and_people_hide_the_colours_below_them():
    drawn = draw_value(one_axes(), SCENE, POLICY.value)
    levels = [f"{level:g}".replace("-", "\N{MINUS SIGN}") for level in drawn.contours.levels]
    numbers = [number.get_text() for number in drawn.numbers]
    assert len(set(numbers)) >= 3
    assert set(numbers) <= set(levels)
    for axis, (low, high) in enumerate((drawn.axes.get_xlim(), drawn.axes.get_ylim())):
        shares = [(number.get_position()[axis] - low) / (high - low) for number in drawn.numbers]
        assert 0.04 < min(shares) < max(shares) < 0.96, "the frame cuts no number"
    assert set(drawn.numbers) == {text for text in drawn.axes.texts if text.get_text() in levels}
    (outline,) = drawn.people
    filled = [patch for patch in drawn.axes.patches if patch.center == outline.center and patch.get_fill()]
    assert to_hex(filled[0].get_facecolor()) == LOOKS["paper"].person.lower()


def test_arrows_below_paths_are_fewer_and_fainter():
    probability = POLICY.probability_by_cell(SCENE.start)
    alone = draw_actions(one_axes(), SCENE, probability)
    below = draw_actions(one_axes(), SCENE, probability, overlays=overlays_of([demonstration()]))
    assert len(below.states) < 0.4 * len(alone.states)
    assert (alone.arrows.get_alpha(), below.arrows.get_alpha()) == (1.0, 0.5)
    assert below.colour_bar.alpha in {None, 1.0}


def test_the_value_of_a_window_spans_what_it_shows():
    drawn = draw_value(one_axes(), SCENE, POLICY.value, window_m=(-2.0, 0.0, -1.0, 1.0))
    x, y = SCENE.lattice.xy_m.T
    shown = POLICY.value[(np.abs(x + 1) < 1) & (np.abs(y) < 1)]
    assert (drawn.image.norm.vmin, drawn.image.norm.vmax) == (shown.min(), shown.max())
    assert shown.min() < drawn.contours.levels.min()
    assert drawn.contours.levels.max() < shown.max()


def test_contours_differ_from_every_colour_of_a_value():
    for name in LOOKS:
        with styled(name):
            drawn = draw_value(one_axes(), SCENE, POLICY.value)
            darkest = drawn.image.to_rgba(np.ma.array([drawn.image.norm.vmin]))[0][:3]
            assert to_hex(drawn.contours.get_edgecolor()[0]) == "#000000"
            assert np.dot(darkest, (0.2126, 0.7152, 0.0722)) > 0.35


def arrows_of(drawn):
    return np.stack([drawn.arrows.U, drawn.arrows.V], axis=1)


def test_arrows_point_to_the_most_likely_move_and_are_as_long_as_it_is_probable():
    drawn = draw_actions(one_axes(), SCENE, POLICY.probability, window_m=(-1.0, 1.0, -0.5, 1.0))
    assert len(drawn.states) > 100
    best = POLICY.probability[drawn.states].argmax(axis=1)
    arrows, sure = arrows_of(drawn), POLICY.probability[drawn.states].max(axis=1)
    along = MOVES[best] / np.hypot(*MOVES[best].T)[:, None]
    np.testing.assert_allclose(arrows / np.hypot(*arrows.T)[:, None], along, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*arrows.T), 0.095 * sure)  # cells of 0.1 m, an arrow each
    np.testing.assert_array_equal(drawn.arrows.get_offsets(), SCENE.lattice.xy_m[drawn.states])
    np.testing.assert_array_equal(drawn.arrows.get_array(), sure)
    assert (drawn.arrows.norm.vmin, drawn.arrows.norm.vmax) == (0.0, 1.0)
    assert (drawn.arrows.scale, drawn.arrows.angles, drawn.arrows.pivot) == (1.0, "xy", "middle")
    assert drawn.colour_bar.orientation == "horizontal" or drawn.colour_bar.ax.get_ylabel()


@pytest.mark.parametrize(("width_in", "every"), [(COLUMN_IN, 3), (PAGE_IN, 2)])
def test_small_cells_have_fewer_arrows(width_in, every):
    drawn = draw_actions(one_axes(width_in), SCENE, POLICY.probability)
    settle(drawn.axes.figure)
    cells = SCENE.lattice.cells[drawn.states]
    assert {int(gap) for column in range(2) for gap in np.diff(np.unique(cells[:, column]))} == {every}
    expected = ((SCENE.lattice.cells - SCENE.lattice.cells[SCENE.start]) % every == 0).all(axis=1)
    expected[SCENE.goal] = False
    np.testing.assert_array_equal(drawn.states, np.flatnonzero(expected))
    longest = np.hypot(*arrows_of(drawn).T).max()
    assert longest < every * 0.1
    pixels = drawn.axes.transData.transform([(0.0, 0.0), (every * 0.1, 0.0)])
    assert np.ptp(pixels[:, 0]) / drawn.axes.figure.dpi > 0.08  # inches from arrow to arrow
    assert_no_overlap(drawn.axes.figure)


def test_the_goal_has_no_arrow_and_no_arrow_leaves_the_window():
    a_scene = scenes_of([demonstration(grid=room(200, 400, (-20.0, -10.0)))])[0]
    policy = policy_of(PUBLISHED, a_scene)
    drawn = draw_actions(one_axes(), a_scene, policy.probability)
    assert a_scene.goal not in drawn.states
    x0, x1, y0, y1 = drawn.window_m
    x, y = drawn.arrows.get_offsets().T
    assert x0 < x.min() < x.max() < x1
    assert y0 < y.min() < y.max() < y1
    assert x1 - x0 < 20.0


def test_probabilities_that_are_not_one_row_for_each_state_are_refused():
    with pytest.raises(ValueError, match=r"probabilities of moves need the shape \(\d+, 8\), found \(3, 8\)"):
        draw_actions(one_axes(), SCENE, np.zeros((3, 8)))
    with pytest.raises(ValueError, match=r"expected one value for each of \d+ states, found shape \(3,\)"):
        draw_value(one_axes(), SCENE, np.zeros(3))
