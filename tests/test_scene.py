"""Scenes: the nominal path and the deviation from it, avoidance, and what is no scene."""

from itertools import pairwise
from math import hypot, sqrt

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.grid import Grid
from navirl_cli.errors import SceneError
from navirl_cli.irl.scene import Scene, avoidance_line_m, scenes_of

WALL = make.grid_of(
    """
    ............
    ............
    ............
    .....#......
    .....#......
    .....#......
    ............
    ............
    """
)


def cell(scene, state):
    return tuple(scene.lattice.cells[state].tolist())


@pytest.mark.parametrize("seed", range(8))
def test_nominal_cells_and_deviation_against_brute_force(seed):
    scene = make.random_scene(np.random.default_rng(seed), 13, 10, density=(0.0, 0.15, 0.3)[seed % 3])
    free = ~scene.lattice.grid.occupied
    nominal = oracles.nominal_cells(free, cell(scene, scene.start), cell(scene, scene.goal))
    assert {cell(scene, state) for state in np.flatnonzero(scene.nominal)} == nominal
    for state, (column, row) in enumerate(scene.lattice.cells.tolist()):
        nearest = min(hypot(column - c, row - r) for c, r in nominal) * 0.1
        assert scene.deviation_m[state] == pytest.approx(nearest, abs=1e-12)


def test_on_open_ground_the_nominal_cells_are_a_parallelogram():
    # From (0, 0) to (5, 2): two diagonal steps and three straight ones in any order.
    scene = make.scene_on(make.open_grid(9, 7), [1, 2], [6, 4])
    expected = {(1 + a + b, 2 + b) for a in range(4) for b in range(3)}
    assert {cell(scene, state) for state in np.flatnonzero(scene.nominal)} == expected


def test_a_path_that_is_hardly_longer_is_not_nominal():
    # Over 299 cells the smallest detour, one cell aside and back, costs 0.3 %.
    scene = make.scene_on(make.open_grid(300, 3), [0, 1], [299, 1])
    assert (scene.lattice.cells[scene.nominal][:, 1] == 1).all()
    assert scene.nominal.sum() == 300


def test_the_nominal_line_is_straight_without_obstacles():
    scene = make.scene_on(make.open_grid(40, 30), [2, 3], [36, 21])
    assert scene.nominal_line_m() == pytest.approx(np.array([[0.25, 0.35], [3.65, 2.15]]))


def test_the_nominal_line_goes_round_an_obstacle_and_is_no_longer_than_the_cells():
    scene = make.scene_on(WALL, [1, 3], [10, 3])
    line = scene.nominal_line_m()
    assert line[[0, -1]] == pytest.approx(WALL.centres_of([[1, 3], [10, 3]]))
    assert len(line) > 2
    for a, b in pairwise(line):
        samples = a + np.linspace(0, 1, 500)[:, None] * (b - a)
        assert not WALL.is_occupied(WALL.cells_of(samples)).any()
    cells = oracles.steps_from(~WALL.occupied, (1, 3))[10, 3]
    assert hypot(0.9, 0) < oracles.length_by_steps(line) <= 0.1 * (cells[0] + sqrt(2) * cells[1]) + 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_the_hugging_path_is_a_shortest_one(seed):
    scene = make.random_scene(np.random.default_rng(40 + seed), 25, 18, density=0.2)
    steps = oracles.steps_from(~scene.lattice.grid.occupied, cell(scene, scene.start))[cell(scene, scene.goal)]
    path = scene.hugging_path()
    moves = np.abs(np.diff(scene.lattice.cells[path], axis=0)).sum(axis=1)
    assert (int((moves == 1).sum()), int((moves == 2).sum())) == steps


def test_the_hugging_path_keeps_to_the_straight_line():
    scene = make.scene_on(make.open_grid(50, 40), [1, 1], [46, 31])
    xy = scene.lattice.xy_m[scene.hugging_path()]
    away = [oracles.distance_to_segment(tuple(p), tuple(xy[0]), tuple(xy[-1]))[0] for p in xy]
    assert max(away) < 0.06


def test_avoidance_keeps_clear_of_people_and_leaves_the_nominal_path_no_further_than_it_must():
    person = np.array([2.03, 0.93])
    scene = make.scene_on(make.open_grid(40, 21), [1, 10], [38, 10], person)
    line = avoidance_line_m(scene, 0.5)
    assert line[[0, -1]] == pytest.approx(scene.lattice.xy_m[[scene.start, scene.goal]])
    assert 0.5 <= np.hypot(*(line - person).T).min() < 0.62
    assert line[:, 1].max() < person[1] + 0.62
    free = make.scene_on(make.open_grid(40, 21), [1, 10], [38, 10])
    assert oracles.length_by_steps(avoidance_line_m(free, 0.5)) == pytest.approx(3.7)


def test_avoidance_without_a_path_is_an_error():
    scene = make.scene_on(make.open_grid(40, 5), [1, 2], [38, 2], [[2.0, 0.25]])
    with pytest.raises(
        SceneError, match=r"goal unreachable: no free path on the map from x 0\.15 m, y 0\.25 m to x 3\.85"
    ):
        avoidance_line_m(scene, 0.5)
    near = make.scene_on(make.open_grid(40, 5), [1, 2], [38, 2], [[0.2, 0.25]])
    with pytest.raises(SceneError, match=r"the cell at x 0\.15 m, y 0\.25 m is not free"):
        avoidance_line_m(near, 0.5)


def test_a_goal_behind_a_wall_is_unreachable():
    grid = make.grid_of("..#..")
    with pytest.raises(
        SceneError,
        match=r"goal unreachable: .* from x 0\.05 m, y 0\.05 m to x 0\.45 m, y 0\.05 m; check the map, the goal and",
    ):
        make.scene_on(grid, [0, 0], [4, 0])
    with pytest.raises(SceneError, match="goal unreachable"):
        make.scene_on(grid, [0, 0], [7, 0])


def test_a_start_in_the_goal_is_refused():
    with pytest.raises(SceneError, match=r"start and goal lie in the same cell at x 0\.15 m, y 0\.05 m"):
        make.scene_on(make.grid_of("..."), [1, 0], [1, 0])


def test_equal_scenes_are_one_object():
    grid, there, back = make.open_grid(4, 2), [[0, 0], [1, 0], [2, 0]], [[2, 0], [1, 0], [0, 0]]
    person = [[0.2, 0.2]]
    copy = Grid(grid.occupied.copy(), grid.resolution_m, grid.origin_m)
    scenes = scenes_of(
        [
            make.demonstration(grid, there, person),
            make.demonstration(grid, back, person),
            make.demonstration(copy, [[0, 0], [1, 1], [2, 0]], person),
            make.demonstration(grid, there, [[0.2, 0.21]]),
            make.demonstration(make.open_grid(4, 3), there, person),
        ]
    )
    assert scenes[2] is scenes[0]
    assert len(set(scenes)) == 4
    assert scenes[1].lattice is scenes[0].lattice, "one map is read once"


def test_two_rooms_of_one_map_are_two_lattices():
    grid = make.grid_of("...#...")
    left, right = scenes_of(
        [make.demonstration(grid, [[0, 0], [1, 0]]), make.demonstration(grid, [[5, 0], [4, 0]], number=2)]
    )
    assert (left.lattice.size, right.lattice.size) == (3, 3)
    assert right.lattice.cells[right.start].tolist() == [5, 0]


def test_a_demonstration_without_a_scene_is_named():
    grid = make.open_grid(3, 1)
    loop = make.demonstration(grid, [[0, 0], [1, 0], [0, 0]], participant="p7", number=3)
    with pytest.raises(SceneError, match="demonstration p7/3: start and goal lie in the same cell"):
        scenes_of([loop])


def test_people_are_kept_as_points():
    scene = Scene.on(make.open_grid(3, 1), np.array([0, 0]), np.array([2, 0]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert scene.people_m.tolist() == [[1.0, 2.0], [3.0, 4.0]]


def test_scenes_of_one_goal_share_the_order_of_the_states():
    people = np.array([[0.3, 0.3]])
    grid = make.open_grid(9, 7)
    first = Scene.on(grid, np.array([1, 1]), np.array([6, 4]), people)
    second = Scene.on(grid, np.array([2, 1]), np.array([6, 4]), people + 0.1, first.lattice)
    other = Scene.on(grid, np.array([2, 1]), np.array([5, 4]), people, first.lattice)
    assert second.ordering is first.ordering
    assert other.ordering is not first.ordering
