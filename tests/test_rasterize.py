"""From poses to cells by every rule, against naive twins."""

import factories as make
import numpy as np
import oracles
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from navirl_cli.demos.grid import Grid
from navirl_cli.demos.rasterize import Rule, rasterize
from navirl_cli.errors import DemonstrationError

GRID = Grid(np.zeros((60, 60), dtype=bool), 0.1, (-3.0, -2.95))
#: The rules that take what the line crosses.
CROSSING = (Rule.CROSSED, Rule.CHAIN)
#: By these, the cells before and after a cell are farther apart than this.
APART = {Rule.CROSSED: 1, Rule.CHAIN: 0}


def twin(line, grid, rule):
    """The path of the naive rule."""
    in_cells = (line - np.array(grid.origin_m)) / grid.resolution_m
    if rule is Rule.STUDY:
        return oracles.rasterised(in_cells - 0.5)
    first, last = (tuple(np.floor(in_cells[i]).astype(int).tolist()) for i in (0, -1))
    passed = oracles.passed_cells(in_cells, arms=rule is Rule.CHAIN)
    return oracles.without_spare_cells(passed, first, last, apart=APART[rule])


def check(path, line, grid):
    assert path[0].tolist() == grid.cells_of(line[0]).tolist()
    assert path[-1].tolist() == grid.cells_of(line[-1]).tolist()
    assert (np.abs(np.diff(path, axis=0)).max(axis=1) == 1).all(), "steps lead to one of the eight neighbours"
    assert not (path[2:] == path[:-2]).all(axis=1).any(), "never straight back"


@pytest.mark.parametrize("seed", range(25))
def test_smooth_curves_against_the_naive_rule(seed):
    line = make.smooth_curve(seed)
    path = rasterize(line, GRID)
    check(path, line, GRID)
    assert [tuple(cell) for cell in path.tolist()] == twin(line, GRID, Rule.STUDY)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("curve", [make.smooth_curve, make.shaken])
def test_blocks_of_segments_change_nothing(monkeypatch, seed, curve):
    line = curve(seed)
    try:
        expected = rasterize(line, GRID).tolist()
    except DemonstrationError as error:
        expected = str(error)
    for size in (1, 3, 10_000):
        monkeypatch.setattr("navirl_cli.demos.rasterize._BLOCK", size)
        try:
            found = rasterize(line, GRID).tolist()
        except DemonstrationError as error:
            found = str(error)
        assert found == expected


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("curve", [make.smooth_curve, make.shaken])
@pytest.mark.parametrize("rule", CROSSING)
def test_what_the_line_crosses_against_exact_fractions(seed, curve, rule):
    line = curve(seed)
    path = rasterize(line, GRID, rule)
    check(path, line, GRID)
    assert [tuple(cell) for cell in path.tolist()] == twin(line, GRID, rule)


@pytest.mark.parametrize("rule", CROSSING)
@settings(derandomize=True, deadline=None, max_examples=100)
@given(line=st.lists(st.tuples(*[st.floats(-2.9, 2.9)] * 2), min_size=2, max_size=8).map(np.array))
def test_any_line_becomes_a_path_without_spare_cells_that_it_crosses(rule, line):
    path = rasterize(line, GRID, rule)
    assert path[[0, -1]].tolist() == GRID.cells_of(line[[0, -1]]).tolist()
    assert (np.abs(np.diff(path, axis=0)).max(axis=1, initial=1) == 1).all()
    assert (np.abs(path[2:] - path[:-2]).max(axis=1) > APART[rule]).all(), "a cell could be left out"
    in_cells = (line - np.array(GRID.origin_m)) / GRID.resolution_m
    crossed = {cell for cell, _ in oracles.passed_cells(in_cells, arms=False)}
    # Fractions know on which side of a border a line runs that doubles put on it.
    near = {(c + i, r + j) for c, r in crossed for i in (-1, 0, 1) for j in (-1, 0, 1)}
    cells = {tuple(cell) for cell in path.tolist()}
    assert len(cells - crossed) <= 2
    assert cells <= near


@pytest.mark.parametrize("rule", Rule)
@pytest.mark.parametrize("seed", range(5))
def test_a_path_moves_with_its_line_by_integer_numbers_of_cells(rule, seed):
    # binary fractions, which are not rounded
    line = np.round(make.shaken(seed) * 1024) / 1024
    grid = Grid(np.zeros((64, 64), dtype=bool), 0.125, (-4.0, -4.0))
    moved = rasterize(line + np.array([5, -3]) * 0.125, grid, rule)
    assert moved.tolist() == (rasterize(line, grid, rule) + np.array([5, -3])).tolist()


@pytest.mark.parametrize("rule", Rule)
@pytest.mark.parametrize("seed", range(5))
def test_a_path_turns_and_mirrors_with_its_line(rule, seed):
    # About the centre of the grid, which is a corner of cells: cell c becomes cell -1 - c.
    grid = Grid(np.zeros((64, 64), dtype=bool), 0.1, (0.0, 0.0))
    line = make.shaken(seed)
    x, y = rasterize(line, grid, rule).T
    turned = rasterize(np.stack([-line[:, 1], line[:, 0]], axis=1), grid, rule)
    assert turned.tolist() == np.stack([-1 - y, x], axis=1).tolist()
    mirrored = rasterize(line * [-1, 1], grid, rule)
    assert mirrored.tolist() == np.stack([-1 - x, y], axis=1).tolist()


@pytest.mark.parametrize("rule", CROSSING)
@pytest.mark.parametrize("seed", range(5))
def test_what_is_crossed_does_not_know_the_direction(rule, seed):
    line = make.shaken(seed)
    assert rasterize(line[::-1], GRID, rule).tolist() == rasterize(line, GRID, rule)[::-1].tolist()


@pytest.mark.parametrize("rule", CROSSING)
def test_a_loop_stays_where_the_path_comes_back_to_itself(rule):
    angles = np.linspace(0, 2.5 * np.pi, 200)
    line = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    path = rasterize(line, GRID, rule)
    check(path, line, GRID)
    assert len(path) > 60, "a circle of radius 10 cells and a quarter"


@pytest.mark.parametrize("rule", Rule)
def test_shaking_over_the_border_of_two_rows_does_not_step_to_and_fro(rule):
    x = np.linspace(0.05, 1.95, 143)
    line = np.stack([x, 0.3 + 0.01 * (-1.0) ** np.arange(143)], axis=1)
    path = rasterize(line, make.open_grid(20, 6), rule)
    assert path[:, 0].tolist() == list(range(20))


def test_corners_by_hand():
    grid = make.open_grid(4, 4)
    # Up a slope of one half: over the row's border at x = 0.19 m, so that it stays in (1, 0) and leaves (1, 1) out.
    line = np.array([[0.05, 0.03], [0.35, 0.18]])
    assert rasterize(line, grid, Rule.CROSSED).tolist() == [[0, 0], [1, 0], [2, 1], [3, 1]]
    assert rasterize(line, grid, Rule.CHAIN).tolist() == [[0, 0], [1, 0], [2, 1], [3, 1]]
    # Around a right angle the path can do without the corner's cell, but a rule that looks at centres sees it.
    line = np.array([[0.05, 0.05], [0.25, 0.05], [0.25, 0.25]])
    assert rasterize(line, grid, Rule.CROSSED).tolist() == [[0, 0], [1, 0], [2, 1], [2, 2]]
    for rule in (Rule.STUDY, Rule.CHAIN):
        assert rasterize(line, grid, rule).tolist() == [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2]]


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.tuples(*[st.floats(-2.9, 2.9)] * 4))
@pytest.mark.parametrize("rule", Rule)
def test_a_straight_line_takes_no_detour_and_stays_within_a_cell_of_it(rule, ends):
    line = np.array(ends).reshape(2, 2)
    (x0, y0), (x1, y1) = (line - np.array(GRID.origin_m)) / GRID.resolution_m
    along_a_border = any(
        abs(a - b) < 1e-3 and abs(a - round(a)) < 1e-3 and abs(c - d) >= 1e-3
        for a, b, c, d in ((x0, x1, y0, y1), (y0, y1, x0, x1))
    )
    # Halfway between two diagonals of cells the same happens: all their centres are equally near.
    between_diagonals = any(
        abs(a - b) < 1e-3 and abs(a % 1 - 0.5) < 1e-3 and abs(x1 - x0) >= 1e-3
        for a, b in ((x0 + y0, x1 + y1), (x0 - y0, x1 - y1))
    )
    assume(rule is not Rule.STUDY or not (along_a_border or between_diagonals))
    path = rasterize(line, GRID, rule)
    check(path, line, GRID)
    fewest = 1 + np.abs(path[-1] - path[0]).max()
    assert fewest <= len(path) <= fewest + 2  # ends in the corner of a cell may cost a step
    away = [oracles.distance_to_segment(tuple(xy), tuple(line[0]), tuple(line[1]))[0] for xy in GRID.centres_of(path)]
    assert max(away) < GRID.resolution_m


def test_exactly_along_a_border_the_studys_rule_steps_to_and_fro_and_the_others_do_not():
    # Not wished for: there the cells on either side are equally near to the line, beside as well as ahead.
    line = np.array([[0.0, 1.0], [0.0, 0.0]])
    assert len(rasterize(line, GRID, Rule.STUDY)) == 22
    assert len(rasterize(np.array([[-1.0, 0.0], [0.0, -1.0]]), GRID, Rule.STUDY)) == 21
    for rule in CROSSING:
        assert len(rasterize(line, GRID, rule)) == 11


@pytest.mark.parametrize("rule", Rule)
def test_an_axis_and_a_diagonal(rule):
    grid = make.open_grid(6, 6)
    assert rasterize(np.array([[0.05, 0.25], [0.55, 0.25]]), grid, rule).tolist() == [[c, 2] for c in range(6)]
    assert rasterize(np.array([[0.55, 0.55], [0.05, 0.05]]), grid, rule).tolist() == [[c, c] for c in range(5, -1, -1)]


@pytest.mark.parametrize("rule", Rule)
def test_poses_standing_still_change_nothing(rule):
    line = make.smooth_curve(3)
    assert rasterize(np.repeat(line, 4, axis=0), GRID, rule).tolist() == rasterize(line, GRID, rule).tolist()


def test_a_loop_is_left_out_where_the_path_comes_back_to_itself():
    # Not wished for, but the study's rule: the rest of the line is nearest where it passes here again.
    angles = np.linspace(0, 2.5 * np.pi, 200)
    line = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    path = rasterize(line, GRID)
    check(path, line, GRID)
    assert [tuple(cell) for cell in path.tolist()] == twin(line, GRID, Rule.STUDY)
    assert len(path) < 20, "a quarter of a circle of radius 10 cells, not five"


@pytest.mark.parametrize("rule", Rule)
def test_a_path_within_one_cell_is_that_cell(rule):
    assert rasterize(np.array([[0.01, 0.01], [0.09, 0.02]]), make.open_grid(2, 2), rule).tolist() == [[0, 0]]
    assert rasterize(np.array([[0.01, 0.01], [0.01, 0.01]]), make.open_grid(2, 2), rule).tolist() == [[0, 0]]


def test_a_rule_that_does_not_end_is_stopped_with_its_place(monkeypatch):
    monkeypatch.setattr("navirl_cli.demos.rasterize.PATIENCE", 0)
    with pytest.raises(DemonstrationError, match=r"circles near x -2\.95 m, y 0\.10 m.*coarser `resolution`"):
        rasterize(np.array([[-2.95, 0.1], [2.95, 0.1]]), GRID)
