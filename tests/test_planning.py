"""Planned paths: most probable, drawn, along the ridge; smooth lines that keep the rules; impossible scenes."""

from itertools import pairwise

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.grid import MOVES, Grid
from navirl_cli.errors import SceneError
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.evaluation.segments import Segments
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.terms import TERMS
from navirl_cli.planning.paths import Mode, Planner, measured, rewards_by_term
from navirl_cli.planning.problem import Problem, problem_of, problem_on
from navirl_cli.planning.recommendation import recommended, straight_passage
from navirl_cli.planning.smooth import Limits, smoothed
from navirl_cli.reports.recommendation import sentences

PAPER = Reward((-54.1, -0.87, -4.91, 1.68))
RADIUS_M = 0.05


def problem_in(scene, radius_m=RADIUS_M):
    start, goal = (tuple(scene.lattice.xy_m[state]) for state in (scene.start, scene.goal))
    return Problem(scene, start, goal, scene.nominal_line_m(), radius_m)


def paths_up_to(scene, allowed, longest):
    """All paths of at most some number of steps from start to goal over allowed states, as lists of states."""
    waiting, found = [[scene.start]], []
    while waiting:
        path = waiting.pop()
        if path[-1] == scene.goal:
            found.append(path)
        elif len(path) <= longest:
            nexts = scene.lattice.neighbours[path[-1]]
            waiting += [[*path, int(state)] for state in nexts if state >= 0 and allowed[state]]
    return found


def log_probability(planner, path):
    lattice = planner.problem.scene.lattice
    moves = [
        int(np.flatnonzero((lattice.cells[there] - lattice.cells[here] == MOVES).all(axis=1))[0])
        for here, there in pairwise(path)
    ]
    return float(np.log(planner.policy.probability[path[:-1], moves]).sum())


@pytest.mark.parametrize("seed", range(4))
def test_the_likely_path_is_the_most_probable_one_of_all_that_touch_nobody(seed):
    scene = make.random_scene(np.random.default_rng(seed), 4, 3, 0.15)
    planner = Planner(problem_in(scene, 0.0), PAPER)
    allowed = ~planner.touching
    best = max((log_probability(planner, path) for path in paths_up_to(scene, allowed, 5)), default=None)
    if best is None:
        with pytest.raises(SceneError, match=r"people leave no free path"):
            planner.plan(Mode.LIKELY)
        return
    (found,) = planner.plan(Mode.LIKELY)
    assert found.log_probability >= best - 1e-9
    assert found.log_probability == pytest.approx(log_probability(planner, found.states.tolist()))


def test_with_a_cost_of_turns_the_most_probable_path_is_at_least_as_probable_as_any_drawn_one():
    problem = problem_in(make.scene_on(make.open_grid(12, 9), [0, 4], [11, 4], [[0.6, 0.2]]))
    turning = Reward((*PAPER.theta, -2.0), (*PAPER.terms, TERMS["turn"]))
    planner = Planner(problem, turning)
    (found,) = planner.plan(Mode.LIKELY)
    assert found.log_probability >= max(path.log_probability for path in planner.plan(Mode.SAMPLE, 300)) - 1e-9
    total = sum(rewards_by_term(problem, turning, found.states).values())
    assert total - planner.policy.value_by_cell()[problem.scene.start] == pytest.approx(found.log_probability)


def test_no_path_of_any_mode_drives_into_a_person():
    problem = straight_passage(0.3, 0.1)
    through = problem.nominal_states
    planner = Planner(problem, PAPER)
    assert planner.touching[through].any()
    for mode in Mode:
        for path in planner.plan(mode, 5, seed=1):
            least = measured(problem, path.line_m).min_distance_m[0]
            assert least > PERSON_RADIUS_M - 0.05, mode
            assert not planner.touching[path.states].any()


def test_the_most_probable_path_passes_nearer_than_paths_of_the_policy_and_the_ridge_does_not():
    planner = Planner(straight_passage(0.3, 0.1), PAPER)
    mean, spread = planner.passing_m
    likely, ridge = (planner.plan(mode)[0] for mode in (Mode.LIKELY, Mode.EXPECTED))
    assert measured(planner.problem, likely.line_m).min_distance_m[0] < mean - spread / 2
    assert measured(planner.problem, ridge.line_m).min_distance_m[0] == pytest.approx(mean, abs=0.1)
    assert likely.log_probability > ridge.log_probability


def test_drawn_paths_are_those_of_the_seed():
    planner = Planner(problem_in(make.scene_on(make.open_grid(12, 9), [0, 4], [11, 4], [[0.6, 0.2]])), PAPER)
    first, again, other = (planner.plan(Mode.SAMPLE, 3, seed) for seed in (1, 1, 2))
    assert [path.states.tolist() for path in first] == [path.states.tolist() for path in again]
    assert [path.states.tolist() for path in first] != [path.states.tolist() for path in other]


def test_rewards_by_term_add_up_to_the_log_probability():
    planner = Planner(problem_in(make.scene_on(make.open_grid(12, 9), [0, 4], [11, 4], [[0.6, 0.2]])), PAPER)
    (path,) = planner.plan(Mode.EXPECTED)
    total = sum(rewards_by_term(planner.problem, PAPER, path.states).values())
    assert total - planner.policy.value[planner.problem.scene.start] == pytest.approx(path.log_probability)


def test_lines_begin_and_end_at_the_exact_points():
    problem = problem_on(make.open_grid(20, 9), (0.12, 0.47), (1.88, 0.41), [], 0.3)
    (path,) = Planner(problem, PAPER).plan(Mode.LIKELY)
    np.testing.assert_array_equal(path.line_m[[0, -1]], [(0.12, 0.47), (1.88, 0.41)])


def test_people_that_fill_a_corridor_leave_no_path():
    problem = problem_on(make.open_grid(40, 5), (0.15, 0.25), (3.85, 0.25), [(2.0, 0.25)], 0.3)
    with pytest.raises(SceneError, match=r"people leave no free path from start to goal: the robot's shell keeps 0.25"):
        Planner(problem, PAPER).plan(Mode.LIKELY)


WALLED = """
    ..#...
    ..#...
    ..#...
"""


@pytest.mark.parametrize(
    ("start", "goal", "people", "message"),
    [
        ((0.05, 0.05), (0.45, 0.05), [], r"the start at x 0.05 m, y 0.05 m is walled in, with 0.1 m2 of free space"),
        ((0.45, 0.05), (0.05, 0.05), [], r"the goal at x 0.05 m, y 0.05 m is walled in"),
        (
            (0.25, 0.05),
            (0.45, 0.05),
            [],
            r"`start`: x 0.25 m, y 0.05 m is occupied.*nearest place that is free is x 0.15",
        ),
        ((0.45, 0.05), (0.25, 0.05), [], r"`goal`: x 0.25 m, y 0.05 m is occupied"),
        ((9.0, 0.05), (0.45, 0.05), [], r"`start`: expected a place on the map, which spans x 0.00 to 0.60 m"),
        ((0.35, 0.05), (0.55, 0.05), [(0.56, 0.06)], r"`goal`: the person at x 0.56 m, y 0.06 m stands 0.01 m from it"),
        ((0.35, 0.05), (0.35, 0.05), [], r"start and goal lie in the same cell"),
    ],
)
def test_impossible_scenes_are_refused_with_the_reason(start, goal, people, message):
    with pytest.raises(SceneError, match=message):
        problem_on(make.grid_of(WALLED), start, goal, people, RADIUS_M)


def test_the_problem_of_a_demonstration_is_its_scene():
    one = make.demonstration(make.open_grid(12, 5), [[i, 2] for i in range(12)], [[0.6, 0.5]])
    problem = problem_of(one)
    assert problem.start_m == tuple(one.xy_m[0])
    assert problem.robot_radius_m == one.robot_radius_m
    np.testing.assert_array_equal(problem.scene.people_m, one.people_m)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("tolerance_m", [0.05, 0.3])
def test_a_smooth_line_keeps_out_of_obstacles_away_from_people_and_near_the_path(seed, tolerance_m):
    rng = np.random.default_rng(seed)
    grid = Grid(rng.random((30, 60)) < 0.06, 0.1, (0.0, 0.0))
    cells = np.argwhere(grid.connected_to(np.argwhere(~grid.occupied)[0, ::-1]))[:, ::-1]
    people = rng.uniform((1.5, 0.5), (4.5, 2.5), (2, 2))
    scene = make.scene_on(grid, cells[np.argmin(cells.sum(axis=1))], cells[np.argmax(cells.sum(axis=1))], people)
    problem = problem_in(scene)
    (path,) = Planner(problem, PAPER).plan(Mode.EXPECTED)
    line = smoothed(problem, path.line_m, tolerance_m, Limits())
    assert line.deviation_m <= tolerance_m + 1e-9
    np.testing.assert_allclose(line.xy_m[[0, -1]], path.line_m[[0, -1]])
    for person in people:
        driven, planned = (
            Segments(one[:-1], one[1:], person[None], 0.0).least_m.min() for one in (line.xy_m, path.line_m)
        )
        assert driven >= planned - 1e-6
    for share in np.linspace(0, 1, 9):
        on = line.xy_m[:-1] + share * np.diff(line.xy_m, axis=0)
        inside = on[grid.is_occupied(grid.cells_of(on))]
        # diagonal moves of the path itself pass the corners of cells
        corners = np.round(inside / 0.1) * 0.1
        assert np.hypot(*(inside - corners).T).max(initial=0.0) < 3e-3
    steps = np.hypot(*np.diff(line.xy_m, axis=0).T)
    assert (np.abs(np.diff(line.speed_m_s**2)) <= 2 * 0.5 * steps + 1e-9).all()
    assert (line.speed_m_s**2 * np.abs(line.curvature_1_m) <= 0.5 + 1e-9).all()
    assert line.speed_m_s.max() <= 0.5
    assert (np.diff(line.t_s) > 0).all()


def test_on_open_ground_a_smooth_line_is_smoother_than_the_path():
    problem = straight_passage(0.3, 0.1)
    (path,) = Planner(problem, PAPER).plan(Mode.EXPECTED)
    line = smoothed(problem, path.line_m, 0.1, Limits())
    assert np.abs(line.curvature_1_m).max() < 1.5
    assert line.deviation_m > 0.01
    # a diagonal move turns by 45 degrees within a cell: more than 7 /m
    rough = smoothed(problem, path.line_m, 0.0, Limits())
    np.testing.assert_allclose(rough.deviation_m, 0.0, atol=1e-9)
    assert np.abs(rough.curvature_1_m).max() > 7


def test_a_recommendation_says_what_the_paths_of_the_policy_do():
    problem = straight_passage(0.3, 0.1)
    found = recommended(problem, PAPER)
    assert found.passing_m.value == pytest.approx(Planner(problem, PAPER).passing_m[0])
    assert 0 < found.least_m.value < found.passing_m.value
    assert found.onset_m.value > 1
    assert 0 < found.detour_m.value < 1
    assert found.worth_m.value > 0
    assert np.isnan(found.passing_m.lower)
    assert any("No intervals" in line for line in sentences(found))
    nearer = Reward((-54.1, -0.87, -2.0, 1.68))
    unbounded = Reward((-0.01, 0.0, 0.0, 1.68))
    drawn = recommended(problem, PAPER, [PAPER, nearer, unbounded])
    assert (drawn.draws, drawn.lost) == (2, 1)
    assert "leave out 1 of 3 draws" in sentences(drawn)[-1]
    assert recommended(problem, nearer).passing_m.value < drawn.passing_m.lower < found.passing_m.value


@pytest.mark.parametrize("c0", [-54.1, -26.0])
def test_on_large_maps_cells_that_only_much_longer_paths_reach_change_nothing(monkeypatch, c0):
    rng = np.random.default_rng(3)
    occupied = rng.random((110, 110)) < 0.03
    occupied[50:53, 20:90] = True
    grid = Grid(occupied, 0.1, (0.0, 0.0))
    free = np.argwhere(~occupied)[:, ::-1]
    start, goal = (tuple(grid.centres_of(free[row])) for row in (5, -9))
    found = []
    for large in (1_000_000, 100):
        monkeypatch.setattr("navirl_cli.planning.problem.LARGE", large)
        planner = Planner(problem_on(grid, start, goal, [(4.0, 4.0)], 0.1), Reward((c0, -0.87, -4.91, 1.68)))
        scene = planner.problem.scene
        (path,) = planner.plan(Mode.LIKELY)
        found.append((scene.lattice.size, planner.policy.value[scene.start], path.log_probability, path.line_m))
    assert found[1][0] < found[0][0]
    assert found[1][1:3] == pytest.approx(found[0][1:3], abs=1e-9)
    np.testing.assert_array_equal(found[1][3], found[0][3])
