"""Occupancy grids: geometry, growth, resampling, and the meaning of ROS occupancy."""

from math import acos, hypot

import factories as make
import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from navirl_cli.demos.grid import (
    MOVE_LENGTHS,
    MOVES,
    OPPOSITE,
    TURN_RAD,
    Grid,
    grid_from_occupancy,
    is_costmap,
    moves_along,
)
from navirl_cli.errors import GridError

DETERMINISTIC = settings(derandomize=True, deadline=None, max_examples=60)
COORDINATES = st.integers(-(10**5), 10**5)
MAPS = st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(lambda shape: arrays(bool, shape))


def test_the_eight_moves_turn_counter_clockwise_from_x():
    assert MOVES.tolist() == [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]]


def test_the_table_of_moves_against_plain_geometry():
    for one, (dx, dy) in enumerate(oracles.MOVES):
        assert MOVE_LENGTHS[one] == hypot(dx, dy)
        assert oracles.MOVES[OPPOSITE[one]] == (-dx, -dy)
        for other, (ex, ey) in enumerate(oracles.MOVES):
            turn = acos(max(-1.0, min(1.0, (dx * ex + dy * ey) / hypot(dx, dy) / hypot(ex, ey))))
            assert TURN_RAD[one, other] == pytest.approx(turn, abs=1e-7)


def test_moves_between_cells():
    cells = np.cumsum(np.array([(0, 0), *oracles.MOVES, (0, 0)]), axis=0)
    assert moves_along(cells).tolist() == [*range(8), -1]
    several = np.stack([cells, cells[::-1]])
    assert moves_along(several).tolist() == [[*range(8), -1], [-1, *OPPOSITE[::-1].tolist()]]


@DETERMINISTIC
@given(
    st.tuples(COORDINATES, COORDINATES),
    st.floats(0.01, 2.0),
    st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
    st.tuples(st.floats(0.01, 0.99), st.floats(0.01, 0.99)),
)
def test_every_point_inside_a_cell_is_in_that_cell(cell, resolution_m, origin_m, share):
    grid = Grid(np.zeros((2, 2), dtype=bool), resolution_m, origin_m)
    assert grid.cells_of(grid.centres_of(cell)).tolist() == list(cell)
    point = np.asarray(origin_m) + (np.array(cell) + share) * resolution_m
    assert grid.cells_of(point).tolist() == list(cell)


def test_rows_run_along_y_and_columns_along_x():
    grid = make.grid_of("""
        ..#
        ...
    """)
    assert grid.shape == (2, 3)
    assert grid.is_occupied(grid.cells_of([0.25, 0.15]))
    assert grid.is_occupied([[2, 1], [1, 1], [2, 0]]).tolist() == [True, False, False]
    assert grid.extent_m == pytest.approx((0.0, 0.3, 0.0, 0.2))


def test_what_lies_beyond_the_grid_is_occupied_and_does_not_wrap_around():
    grid = make.open_grid(3, 2)
    cells = [[0, 0], [2, 1], [-1, 0], [0, -1], [3, 0], [0, 2]]
    assert grid.contains(cells).tolist() == [True, True, False, False, False, False]
    assert grid.is_occupied(cells).tolist() == [False, False, True, True, True, True]
    assert grid.is_occupied(np.zeros((0, 2), dtype=int)).shape == (0,)


@DETERMINISTIC
@given(MAPS, st.floats(0.01, 0.6))
def test_inflation_against_every_pair_of_cells(occupied, radius_m):
    grown = Grid(occupied, 0.1, (0.0, 0.0)).inflated(radius_m)
    taken = np.argwhere(occupied)
    for row, column in np.ndindex(occupied.shape):
        near = any(hypot(row - r, column - c) * 0.1 < radius_m for r, c in taken)
        assert grown.occupied[row, column] == (occupied[row, column] or near)


def test_inflation_by_zero_and_of_free_maps_changes_no_cell():
    grid = make.grid_of("..#")
    assert grid.inflated(0.0) is grid
    empty = make.open_grid(4, 4)
    assert empty.inflated(1.0).digest == empty.digest
    assert grid.inflated(1.0, make.NOBODY).digest == grid.digest


def test_people_grow_about_the_point_where_they_stand_and_obstacles_do_not():
    grid = Grid(np.zeros((20, 30), dtype=bool), 0.1, (-1.0, -0.5))
    grid.occupied[0, 0] = True
    people = np.array([[0.512, 0.391], [2.1, 0.3]])  # the second stands 10 cm beyond the map
    grown = grid.inflated(0.4, people)
    for row, column in np.ndindex(grid.shape):
        centre = grid.centres_of([column, row])
        near = min(hypot(*(centre - person)) for person in people) < 0.4
        assert grown.occupied[row, column] == (near or (row, column) == (0, 0))
    assert grown.occupied[:, -1].any(), "who stands beyond the border still takes room inside it"


@DETERMINISTIC
@given(MAPS, st.sampled_from([0.02, 0.03, 0.05, 0.1, 0.12, 0.2, 0.25, 0.3, 1.5]))
def test_resampling_marks_a_cell_exactly_where_it_overlaps_an_occupied_one(occupied, resolution_m):
    coarse = Grid(occupied, 0.1, (1.0, -2.0)).resampled(resolution_m)
    assert coarse.resolution_m == resolution_m
    assert coarse.origin_m == (1.0, -2.0)
    for side, cells, were in zip((0, 1), coarse.shape, occupied.shape, strict=True):
        assert (cells - 1) * resolution_m < were * 0.1 - 1e-9 <= cells * resolution_m, side

    def overlap(i, j):  # of the new cell i and the old cell j along one axis, m
        return min((i + 1) * resolution_m, (j + 1) * 0.1) - max(i * resolution_m, j * 0.1)

    taken = np.argwhere(occupied)
    for row, column in np.ndindex(coarse.shape):
        touches = any(overlap(row, r) > 1e-7 and overlap(column, c) > 1e-7 for r, c in taken)
        assert coarse.occupied[row, column] == touches


def test_resampling_is_not_led_astray_by_rounding():
    # 9 cells of 0.1 m end where 6 of 0.15 m end, though 9 * (0.1 / 0.15) is a little more than 6 in doubles.
    occupied = np.zeros((1, 12), dtype=bool)
    occupied[0, 8] = True
    assert np.flatnonzero(Grid(occupied, 0.1, (0.0, 0.0)).resampled(0.15).occupied[0]).tolist() == [5]


def test_resampling_to_the_same_size_is_the_same_grid():
    grid = make.grid_of("..#")
    assert grid.resampled(0.1) is grid


def test_a_costmap_is_not_inflated_a_second_time():
    data = np.zeros((5, 5), dtype=np.int8)
    data[1:4, 1:4], data[2, 2], data[0, 0], data[4, 4] = 99, 100, 98, -1
    grid = grid_from_occupancy(data, 0.1, (0.0, 0.0), robot_radius_m=0.3)
    expected = data >= 99
    expected[4, 4] = True  # unknown
    assert (grid.occupied == expected).all()


def test_a_99_here_and_there_makes_no_costmap():
    data = np.zeros((9, 9), dtype=np.int8)
    data[2, 2], data[2, 3], data[6, 6], data[7, 1] = 100, 99, 100, 70
    assert not is_costmap(data)
    grid = grid_from_occupancy(data, 0.1, (0.0, 0.0), robot_radius_m=0.11)
    assert grid.is_occupied([[1, 2], [1, 7], [2, 7], [6, 5]]).all()


def test_a_plain_map_is_grown_by_the_robot_and_its_unknown_cells_are_occupied_but_not_grown():
    data = np.zeros((5, 7), dtype=np.int8)
    data[2, 1], data[2, 3], data[2, 5] = 65, 64, -1
    grid = grid_from_occupancy(data, 0.1, (0.0, 0.0), robot_radius_m=0.11)
    assert np.argwhere(grid.occupied).tolist() == [[1, 1], [2, 0], [2, 1], [2, 2], [2, 5], [3, 1]]


def test_equal_grids_have_equal_digests_and_others_not():
    occupied = np.array([[True, False, False], [False, False, True]])
    grid = Grid(occupied, 0.1, (0.0, 1.0))
    assert grid.digest == Grid(occupied.copy(), np.float64(0.1), (np.float64(0), 1)).digest
    others = [
        Grid(~occupied, 0.1, (0.0, 1.0)),
        Grid(occupied, 0.2, (0.0, 1.0)),
        Grid(occupied, 0.1, (0.0, 1.5)),
        Grid(occupied.reshape(3, 2), 0.1, (0.0, 1.0)),
        Grid(np.concatenate([occupied, [[False] * 3]]), 0.1, (0.0, 1.0)),
    ]
    assert len({grid.digest, *(other.digest for other in others)}) == 6


def test_freeing_the_driven_cells_leaves_the_original_alone():
    grid = make.grid_of("###")
    freed = grid.freed(np.array([[1, 0], [2, 0]]))
    assert freed.occupied.tolist() == [[True, False, False]]
    assert grid.occupied.all()


def test_freeing_beyond_the_map_is_refused_with_place_and_extent():
    with pytest.raises(
        GridError,
        match=r"2 cells of the path lie beyond the map, the first at x 0\.35 m, y 0\.05 m; "
        r"the map spans x 0\.00 to 0\.30 m, y 0\.00 to 0\.10 m",
    ):
        make.grid_of("...").freed(np.array([[0, 0], [3, 0], [4, 0]]))


@pytest.mark.parametrize(
    ("occupied", "resolution_m", "origin_m", "message"),
    [
        (np.zeros(3, dtype=bool), 0.1, (0, 0), r"two-dimensional array of bool, found bool of shape \(3,\)"),
        (np.zeros((2, 2)), 0.1, (0, 0), r"found float64 of shape \(2, 2\)"),
        (np.zeros((0, 2), dtype=bool), 0.1, (0, 0), r"shape \(0, 2\)"),
        (np.zeros((2, 2), dtype=bool), 0.0, (0, 0), "positive number of metres, found 0.0"),
        (np.zeros((2, 2), dtype=bool), np.nan, (0, 0), "positive number of metres, found nan"),
        (np.zeros((2, 2), dtype=bool), np.inf, (0, 0), "positive number of metres, found inf"),
        (np.zeros((2, 2), dtype=bool), 0.1, (0, np.nan), "origin must be finite"),
    ],
)
def test_what_is_no_grid_is_refused(occupied, resolution_m, origin_m, message):
    with pytest.raises(GridError, match=message):
        Grid(occupied, resolution_m, origin_m)
