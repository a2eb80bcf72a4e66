"""Soft values, policy and visits: against value iteration, worlds solved by hand, and where nothing is finite."""

from math import log
from pathlib import Path

import factories as make
import numpy as np
import oracles
import pytest

import navirl_cli
from navirl_cli.demos.grid import Grid
from navirl_cli.irl import series, values
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError, ValueStatus


def cell(scene, state):
    return tuple(scene.lattice.cells[state].tolist())


def slow_values(scene, reward):
    """Value iteration, by state, and the policy that goes with it, by cell."""
    by_cell = make.by_cell(scene, reward.on(scene).value, -np.inf)
    found = oracles.soft_values(by_cell, cell(scene, scene.goal))
    columns, rows = scene.lattice.cells.T
    return found[rows, columns], oracles.soft_policy(by_cell, found)


def check_policy(scene, reward, policy, tolerance=1e-9):
    """Everything that holds of any policy, and its values against value iteration."""
    slow, slow_policy = slow_values(scene, reward)
    assert np.abs(policy.value - slow).max() < tolerance  # the relative error of z
    columns, rows = scene.lattice.cells.T
    assert np.abs(policy.probability - slow_policy[rows, columns]).max() < tolerance
    driving = np.arange(scene.lattice.size) != scene.goal
    assert np.abs(policy.probability[driving].sum(axis=1) - 1).max() < 1e-10
    assert (policy.probability[scene.goal] == 0).all()
    assert (policy.probability >= 0).all()
    check_visits(scene, policy)


def check_visits(scene, policy):
    start = np.zeros(scene.lattice.size)
    start[scene.start] = 1.0
    visits = policy.visits(start)
    assert visits[scene.goal] == pytest.approx(1.0, abs=1e-10), "what starts arrives"
    source, move, target = scene.lattice.edges
    inflow = np.bincount(target, visits[source] * policy.probability[source, move], minlength=scene.lattice.size)
    assert visits == pytest.approx(start + inflow, abs=1e-10)
    steps = np.ones(scene.lattice.size)
    steps[scene.goal] = 0.0
    assert policy.expected_to_goal(steps)[scene.start] == pytest.approx(visits.sum() - 1, rel=1e-10)


def test_three_cells_in_a_row_by_hand():
    world = oracles.CorridorOfThree
    scene = make.scene_on(make.grid_of("..."), [0, 0], [2, 0])
    policy = policy_of(Reward((world.C0, 0.0, 0.0, 1.0)), scene)
    assert np.exp(policy.value) == pytest.approx([world.Z_A, world.Z_B, 1.0], rel=1e-13)
    assert policy.probability[1, [0, 4]] == pytest.approx([world.TO_GOAL, world.BACK], rel=1e-13)
    assert policy.visits(np.array([1.0, 0, 0])) == pytest.approx([world.VISITS, world.VISITS, 1.0], rel=1e-13)


@pytest.mark.parametrize("c0", [-12.0, -30.0, -90.0, -2000.0])
def test_four_cells_in_a_square_by_hand(c0):
    scene = make.scene_on(make.open_grid(2, 2), [0, 0], [1, 1])
    policy = policy_of(Reward((c0, 0.0, 0.0, 1.0)), scene)
    a, b = oracles.SquareOfFour.z(c0)
    at = {cell(scene, state): policy.value[state] for state in range(4)}
    assert at == pytest.approx({(0, 0): log(a), (1, 0): log(b), (0, 1): log(b), (1, 1): 0.0}, rel=1e-12)


@pytest.mark.parametrize("seed", range(14))
def test_random_maps_and_parameters_against_value_iteration(seed):
    rng = np.random.default_rng(seed)
    scene = make.random_scene(rng, 22, 16, density=(0.0, 0.15, 0.3)[seed % 3], people=seed % 3)
    theta = (-rng.uniform(25, 90), -rng.uniform(0, 3), rng.choice([-8.0, -1.0, 0.4]), rng.uniform(0.3, 5))
    check_policy(scene, Reward(theta), policy_of(Reward(theta), scene))


def test_visits_against_mass_moved_step_by_step():
    scene = make.random_scene(np.random.default_rng(5), 15, 12, density=0.2)
    reward = Reward((-28.0, -0.4, -3.0, 2.0))
    policy = policy_of(reward, scene)
    slow = oracles.expected_visits(slow_values(scene, reward)[1], cell(scene, scene.start), cell(scene, scene.goal))
    start = np.zeros(scene.lattice.size)
    start[scene.start] = 1.0
    columns, rows = scene.lattice.cells.T
    assert policy.visits(start) == pytest.approx(slow[rows, columns], rel=1e-9, abs=1e-14)
    assert (policy.visits_from(scene.start) == policy.visits(start)).all()


def test_other_rooms_ask_for_the_visits_of_a_state():
    package = Path(navirl_cli.__file__).parent
    others = [path for path in package.rglob("*.py") if path.parent.name != "irl"]
    assert [path.name for path in others if ".visits(" in path.read_text(encoding="utf-8")] == []


def test_expected_sums_solve_their_equation_for_several_rewards_at_once():
    scene = make.random_scene(np.random.default_rng(6), 12, 9, density=0.2)
    policy = policy_of(Reward((-30.0, -0.4, -3.0, 2.0)), scene)
    local = np.random.default_rng(0).normal(size=(scene.lattice.size, 3))
    sums = policy.expected_to_goal(local)
    ahead = (policy.probability[:, :, None] * sums[scene.lattice.neighbours]).sum(axis=1)
    assert sums == pytest.approx(local + ahead, rel=1e-10, abs=1e-10)
    assert sums[:, 1] == pytest.approx(policy.expected_to_goal(local[:, 1]), rel=1e-12)


def test_an_open_area():
    scene = make.scene_on(make.open_grid(60, 40), [3, 20], [56, 18], [[3.0, 2.1]])
    reward = Reward((-54.12586, -0.873514, -4.907188, 1.679499))
    check_policy(scene, reward, policy_of(reward, scene))


def corridor(length, width):
    return make.scene_on(make.open_grid(length, width), [0, width // 2], [length - 1, 0], [[length * 0.05, 0.1]])


@pytest.mark.parametrize("c0", [-26.0, -60.0])
def test_a_long_corridor(c0):
    scene = corridor(500, 3)
    reward = Reward((c0, -0.4, -5.0, 2.0))
    policy = policy_of(reward, scene)
    assert policy.value.min() < -1000, "far below what a double holds of exp(V)"
    check_policy(scene, reward, policy)


@pytest.fixture
def bands(monkeypatch):
    """Bands of a few cells on maps of any size; the list gets a True for every use."""
    used = []
    raised = values._raised

    def watched(*args):
        used.append(True)
        return raised(*args)

    monkeypatch.setattr(values, "PLAIN_STEPS", 1)
    monkeypatch.setattr(values, "STEPS_PER_BAND", 5.0)
    monkeypatch.setattr(values, "_raised", watched)
    return used


@pytest.mark.parametrize("seed", range(6))
def test_bands_do_not_change_the_values(seed, bands, monkeypatch):
    rng = np.random.default_rng(100 + seed)
    scene = make.random_scene(rng, 40, 25, density=(0.0, 0.25)[seed % 2], people=1)
    reward = Reward((-rng.uniform(25, 60), -0.3, (-6.0, 0.4)[seed % 2], 1.5))
    banded = policy_of(reward, scene)
    assert bands, "this map was to be solved in bands"
    check_policy(scene, reward, banded)
    monkeypatch.setattr(values, "PLAIN_STEPS", 10_000)
    plain = policy_of(reward, scene)
    assert len(bands) == 1
    assert np.abs(plain.value - banded.value).max() < 1e-10
    assert np.abs(plain.probability - banded.probability).max() < 1e-10


def test_bands_on_a_long_corridor(bands):
    scene = corridor(400, 4)
    reward = Reward((-30.0, -0.4, -5.0, 2.0))
    policy = policy_of(reward, scene)
    assert bands
    check_policy(scene, reward, policy)


def test_a_map_on_which_paths_outnumber_what_a_double_holds():
    # To the right of the goal a hall with more than e^750 times the weight of its best path; to the left a corridor as
    # long, in which there is but one way.
    length, width, height = 900, 560, 280
    occupied = np.ones((height, length + width), dtype=bool)
    occupied[:, length:] = False
    occupied[0, :length] = False
    scene = make.scene_on(Grid(occupied, 0.1, (0.0, 0.0)), [0, 0], [length, 0])
    reward = Reward((-20.0, 0.0, 0.0, 1.0))
    policy = policy_of(reward, scene)
    hard = -20.0 * scene.lattice.costs_to(scene.goal, scene.lattice.step_m)
    assert (policy.value - hard).max() > 750
    driving = np.arange(scene.lattice.size) != scene.goal
    assert np.abs(policy.probability[driving].sum(axis=1) - 1).max() < 1e-9
    # z_n = w (z_(n-1) + z_(n+1)) in the corridor, so that z falls by y = w (1 + y^2) a cell.
    w = np.exp(-2.0)
    fall = log((1 - np.sqrt(1 - 4 * w * w)) / (2 * w))
    inner = scene.lattice.states_of(np.array([[600, 0], [500, 0]]))
    assert np.diff(policy.value[inner])[0] == pytest.approx(100 * fall, rel=1e-10)
    check_visits(scene, policy)


def attempt(scene, reward):
    """The policy, or the reason why there is none."""
    try:
        return policy_of(reward, scene), None
    except InfinitePartitionError as error:
        return None, error.status


@pytest.mark.parametrize("c0", np.arange(-25.0, -17.0, 0.5).tolist())
def test_near_criticality_the_answer_is_right_or_refused(c0):
    scene = make.scene_on(make.open_grid(26, 18), [2, 9], [23, 9])
    reward = Reward((c0, 0.0, 0.0, 1.0))
    policy, status = attempt(scene, reward)
    if policy is None:
        assert spectral_radius(scene, reward) > (1.0 if status is ValueStatus.INFINITE else 0.98)
    else:
        check_policy(scene, reward, policy, tolerance=1e-8 if c0 > -19 else 1e-9)


def matrix_of(scene, reward):
    matrix = np.zeros((scene.lattice.size, scene.lattice.size))
    source, move, target = scene.lattice.edges
    matrix[source, target] = np.exp(reward.on(scene).value[source, move])
    return matrix


def spectral_radius(scene, reward):
    # The graph has even cycles and triangles: the power method converges.
    matrix, vector = matrix_of(scene, reward), np.ones(scene.lattice.size)
    for _ in range(3000):
        vector = matrix @ vector
        norm = np.linalg.norm(vector)
        vector /= norm
    return norm


def test_the_boundary_between_finite_and_infinite_is_decided_correctly():
    scene = make.scene_on(make.open_grid(11, 8), [2, 4], [9, 4])
    seen = set()
    for c0 in np.arange(-18.5, -15.0, 0.1):
        reward = Reward((float(c0), 0.0, 0.0, 1.0))
        radius = spectral_radius(scene, reward)
        policy, status = attempt(scene, reward)
        seen.add(status)
        if status is ValueStatus.INFINITE:
            assert radius > 1
        elif status is ValueStatus.UNDECIDED:
            assert abs(radius - 1) < 0.01
        else:
            assert radius < 1
            exact = np.linalg.solve(np.eye(scene.lattice.size) - matrix_of(scene, reward), np.eye(scene.lattice.size))
            assert policy.value == pytest.approx(np.log(exact[:, scene.goal]), abs=1e-9)
    assert {None, ValueStatus.INFINITE} <= seen


@pytest.mark.parametrize(
    ("theta", "people"),
    [
        ((-10.0, 0.0, 0.0, 1.0), make.NOBODY),
        ((-0.01, 0.0, 0.0, 1.0), make.NOBODY),
        ((-50.0, 0.0, 30.0, 2.0), [[1.5, 1.0]]),  # staying near the person pays
        ((-50.0, 0.0, 2000.0, 2.0), [[1.5, 1.0]]),
    ],
)
def test_an_infinite_partition_function_is_reported(theta, people):
    scene = make.scene_on(make.open_grid(30, 20), [2, 10], [27, 10], people)
    with pytest.raises(
        InfinitePartitionError,
        match=r"infinite partition function.*: a step costs so little .* more negative c0 \(on open ground below about "
        r"-1\.8 per cell, -18 /m on 10 cm cells\) or a smaller positive a_p",
    ):
        policy_of(Reward(theta), scene)


def test_no_number_is_returned_when_sweeps_run_out(monkeypatch):
    scene = make.scene_on(make.open_grid(30, 20), [2, 10], [27, 10])
    monkeypatch.setattr(series, "MAX_SWEEPS", 5)
    with pytest.raises(InfinitePartitionError, match="too close to an infinite partition function") as caught:
        policy_of(Reward((-20.0, 0.0, 0.0, 1.0)), scene)
    assert caught.value.status is ValueStatus.UNDECIDED


def test_sums_that_do_not_converge_are_not_returned(monkeypatch):
    scene = make.scene_on(make.open_grid(30, 20), [2, 10], [27, 10])
    policy = policy_of(Reward((-20.0, 0.0, 0.0, 1.0)), scene)
    monkeypatch.setattr(series, "PLAIN_SWEEPS", 5)
    monkeypatch.setattr(series, "CORRECTIONS", 0)
    with pytest.raises(InfinitePartitionError, match="too close"):
        policy.visits(np.eye(scene.lattice.size)[scene.start])


@pytest.mark.parametrize("theta", [(-1e4, -1e4, -1e4, 1e-3), (-1e4, -0.1, 800.0, 900.0), (-50.0, -1.0, -1e4, 2.0)])
def test_extreme_parameters_give_a_policy(theta):
    scene = make.scene_on(make.open_grid(30, 10), [1, 5], [28, 5], [[1.5, 0.5]])
    policy = policy_of(Reward(theta), scene)
    driving = np.arange(scene.lattice.size) != scene.goal
    assert policy.probability[driving].sum(axis=1) == pytest.approx(1, abs=1e-9)
    check_visits(scene, policy)
