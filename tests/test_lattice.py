"""The free cells as a graph, against plain Dijkstra."""

from math import sqrt

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.grid import OPPOSITE
from navirl_cli.errors import SceneError
from navirl_cli.irl.lattice import Lattice

ROOM = make.grid_of(
    """
    ........
    .####...
    .#..#.#.
    .#..###.
    .####...
    ........
    """,
    origin_m=(-1.0, 2.0),
)


def test_a_lattice_holds_exactly_the_reachable_cells():
    lattice = Lattice.around(ROOM, np.array([0, 0]))
    cells = {tuple(cell) for cell in lattice.cells.tolist()}
    free = ~ROOM.occupied
    assert cells == set(oracles.steps_from(free, (0, 0)))
    assert (2, 2) not in cells
    assert free[2, 2], "the chamber inside is free, but nothing leads there"
    assert lattice.size == len(cells)
    assert lattice.states_of(lattice.cells).tolist() == list(range(lattice.size))
    assert lattice.states_of(np.array([[2, 2], [1, 1], [-1, 0], [8, 0], [0, 6]])).tolist() == [-1] * 5
    assert np.allclose(lattice.xy_m, ROOM.centres_of(lattice.cells), rtol=0, atol=0)


def test_neighbours_and_edges_against_loops():
    lattice = Lattice.around(ROOM, np.array([0, 0]))
    expected = []
    for state, cell in enumerate(lattice.cells.tolist()):
        leads_to = dict(oracles.ways(~ROOM.occupied, tuple(cell)))
        for move in range(8):
            target = lattice.neighbours[state, move]
            if move not in leads_to:
                assert target == -1
                continue
            assert tuple(lattice.cells[target]) == leads_to[move]
            assert lattice.neighbours[target, OPPOSITE[move]] == state
            expected.append((state, move, target))
    assert list(zip(*(array.tolist() for array in lattice.edges), strict=True)) == expected
    assert lattice.possible.sum() == len(expected)


def test_a_step_is_a_cell_long_or_a_diagonal():
    assert Lattice.around(ROOM, np.array([0, 0])).step_m == pytest.approx([0.1, 0.1 * sqrt(2)] * 4)


@pytest.mark.parametrize("seed", range(5))
def test_costs_of_paths_against_plain_dijkstra(seed):
    scene = make.random_scene(np.random.default_rng(seed), 14, 11, density=0.3)
    lattice, goal = scene.lattice, tuple(scene.lattice.cells[scene.goal].tolist())
    steps = oracles.steps_from(~lattice.grid.occupied, goal)
    exact = [0.1 * (steps[tuple(c)][0] + sqrt(2) * steps[tuple(c)][1]) for c in lattice.cells.tolist()]
    assert lattice.costs_to(scene.goal, lattice.step_m) == pytest.approx(exact, rel=1e-12)
    path = lattice.descend(scene.start, scene.goal, lattice.step_m)
    assert (path[0], path[-1]) == (scene.start, scene.goal)
    line = lattice.xy_m[path]
    assert oracles.length_by_steps(line) == pytest.approx(exact[scene.start], rel=1e-12)
    assert (np.abs(np.diff(lattice.cells[path], axis=0)).max(axis=1) == 1).all()


def test_costs_belong_to_the_cell_that_is_left():
    # Leaving the middle cell costs 10, entering it 1: from the left end it is 1 + 10 to the right one, and from the
    # right end to itself nothing.
    lattice = Lattice.around(make.grid_of("..."), np.array([0, 0]))
    cost = np.broadcast_to(np.array([[1.0], [10.0], [100.0]]), (3, 8))
    assert lattice.costs_to(2, cost).tolist() == [11.0, 10.0, 0.0]
    assert lattice.costs_to(0, cost).tolist() == [0.0, 10.0, 110.0]


@pytest.mark.parametrize("cell", [[1, 1], [8, 0], [0, -1]])
def test_an_occupied_cell_is_refused_as_start(cell):
    x, y = ROOM.centres_of(cell)
    with pytest.raises(SceneError, match=rf"the cell at x {x:.2f} m, y {y:.2f} m is not free on the map"):
        Lattice.around(ROOM, np.array(cell))
