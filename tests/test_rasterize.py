"""From poses to cells: the study's rule, against a naive twin."""

import factories as make
import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navirl_cli.demos.grid import Grid
from navirl_cli.demos.rasterize import rasterize
from navirl_cli.errors import DemonstrationError

GRID = Grid(np.zeros((60, 60), dtype=bool), 0.1, (-3.0, -2.95))


def smooth_curve(seed, poses=120):
    """A curve about 4 m long whose heading wanders, with uneven distances between the poses."""
    rng = np.random.default_rng(seed)
    heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.07, poses))
    stride = rng.uniform(0.005, 0.06, poses)
    return rng.uniform(-1, 1, 2) + np.cumsum(stride[:, None] * np.stack([np.cos(heading), np.sin(heading)], 1), axis=0)


def check(path, line, grid):
    assert path[0].tolist() == grid.cells_of(line[0]).tolist()
    assert path[-1].tolist() == grid.cells_of(line[-1]).tolist()
    assert (np.abs(np.diff(path, axis=0)).max(axis=1) == 1).all(), "steps lead to one of the eight neighbours"
    assert not (path[2:] == path[:-2]).all(axis=1).any(), "never straight back"


@pytest.mark.parametrize("seed", range(25))
def test_smooth_curves_against_the_naive_rule(seed):
    line = smooth_curve(seed)
    path = rasterize(line, GRID)
    check(path, line, GRID)
    in_cells = (line - np.array(GRID.origin_m)) / GRID.resolution_m - 0.5
    assert [tuple(cell) for cell in path.tolist()] == oracles.rasterised(in_cells)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.tuples(*[st.floats(-2.9, 2.9)] * 4))
def test_a_straight_line_takes_no_detour_and_stays_within_a_cell_of_it(ends):
    line = np.array(ends).reshape(2, 2)
    path = rasterize(line, GRID)
    check(path, line, GRID)
    fewest = 1 + np.abs(path[-1] - path[0]).max()
    assert fewest <= len(path) <= fewest + 2  # ends in the corner of a cell may cost a step
    away = [oracles.distance_to_segment(tuple(xy), tuple(line[0]), tuple(line[1]))[0] for xy in GRID.centres_of(path)]
    assert max(away) < GRID.resolution_m


def test_an_axis_and_a_diagonal():
    grid = make.open_grid(6, 6)
    assert rasterize(np.array([[0.05, 0.25], [0.55, 0.25]]), grid).tolist() == [[c, 2] for c in range(6)]
    assert rasterize(np.array([[0.55, 0.55], [0.05, 0.05]]), grid).tolist() == [[c, c] for c in range(5, -1, -1)]


def test_poses_standing_still_change_nothing():
    line = smooth_curve(3)
    assert rasterize(np.repeat(line, 4, axis=0), GRID).tolist() == rasterize(line, GRID).tolist()


def test_a_loop_is_left_out_where_the_path_comes_back_to_itself():
    # Not wished for, but the study's rule: the rest of the line is nearest where it passes here again.
    angles = np.linspace(0, 2.5 * np.pi, 200)
    line = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    path = rasterize(line, GRID)
    check(path, line, GRID)
    in_cells = (line - np.array(GRID.origin_m)) / GRID.resolution_m - 0.5
    assert [tuple(cell) for cell in path.tolist()] == oracles.rasterised(in_cells)
    assert len(path) < 20, "a quarter of a circle of radius 10 cells, not five"


def test_a_path_within_one_cell_is_that_cell():
    assert rasterize(np.array([[0.01, 0.01], [0.09, 0.02]]), make.open_grid(2, 2)).tolist() == [[0, 0]]
    assert rasterize(np.array([[0.01, 0.01], [0.01, 0.01]]), make.open_grid(2, 2)).tolist() == [[0, 0]]


def test_a_rule_that_walks_on_and_on_is_stopped_and_says_where(monkeypatch):
    monkeypatch.setattr("navirl_cli.demos.rasterize.PATIENCE", 0)
    with pytest.raises(DemonstrationError, match=r"circles near x -2\.95 m, y 0\.10 m.*coarser --resolution"):
        rasterize(np.array([[-2.95, 0.1], [2.95, 0.1]]), GRID)
