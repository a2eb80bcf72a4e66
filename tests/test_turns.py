"""Cells by incoming move: against slow value iteration, finite differences, sampled paths, and cells alone."""

from math import inf

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.grid import MOVES, moves_along
from navirl_cli.evaluation.policy_paths import PolicyLines, Steps, Visits
from navirl_cli.evaluation.ranks import sampled_log_likelihoods
from navirl_cli.irl import likelihood as likelihoods
from navirl_cli.irl import series, values
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.graph import NO_MOVE
from navirl_cli.irl.likelihood import likelihood, log_likelihood, policy_of, step_likelihood, value_and_gradient
from navirl_cli.irl.models import MODELS
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import PAPER_TERMS, Reward, parameters_of
from navirl_cli.irl.series import InfinitePartitionError, Splitting, ValueStatus
from navirl_cli.irl.terms import TERMS

TURNING = (*PAPER_TERMS, TERMS["turn"])
SHARP = -1.3
#: Low costs of path length, so that paths wander and turn.
THETA = (-24.0, -2.0, -2.5, 3.0)


def world(seed):
    """A small map, its rewards with and without turns, and its cells for the oracle."""
    rng = np.random.default_rng(seed)
    scene = make.random_scene(rng, 6, 5, density=(0.0, 0.25)[seed % 2])
    free = make.by_cell(scene, np.ones(scene.lattice.size), 0.0) > 0
    start, goal = (tuple(scene.lattice.cells[cell].tolist()) for cell in (scene.start, scene.goal))
    plain = Reward(THETA)
    return scene, Reward((*THETA, SHARP), TURNING), make.by_cell(scene, plain.on(scene).value, -inf), free, start, goal


def state_of(scene, came):
    """The number of an oracle's state."""
    cell, move = came
    graph = scene.turn_ordering.graph
    number = scene.lattice.states_of(np.array([cell]))
    return int(graph.states_in(number, np.array([NO_MOVE if move is None else move]))[0])


@pytest.mark.parametrize("seed", range(4))
def test_the_states_are_cells_by_incoming_move_and_one_goal(seed):
    scene, _, _, free, _, goal = world(seed)
    graph = scene.turn_ordering.graph
    states = {state_of(scene, came) for came in oracles.turn_states(free, goal)}
    assert states == set(range(graph.size))
    for cell, came in oracles.turn_states(free, goal):
        if cell == goal:
            continue
        here = state_of(scene, (cell, came))
        after = {move: state_of(scene, (target, move)) for move, target in oracles.ways(free, cell)}
        assert graph.neighbours[here].tolist() == [after.get(move, -1) for move in range(8)]
    assert (scene.turn_ordering.order[0], scene.turn_ordering.rank[state_of(scene, (goal, None))]) == (
        state_of(scene, (goal, None)),
        0,
    )


@pytest.mark.parametrize("banded", [False, True], ids=["plain", "banded"])
@pytest.mark.parametrize("seed", range(2))
def test_values_against_slow_value_iteration(seed, banded, monkeypatch):
    if banded:
        monkeypatch.setattr(values, "PLAIN_STEPS", 1)
        monkeypatch.setattr(values, "STEPS_PER_BAND", 3.0)
    scene, reward, alone, free, _, goal = world(seed)
    slow = oracles.turn_values(alone, SHARP, free, goal)
    policy = policy_of(reward, scene)
    found = {came: policy.value[state_of(scene, came)] for came in slow}
    assert found == pytest.approx(slow, abs=1e-9)
    by_cell = {
        tuple(cell): value for cell, value in zip(scene.lattice.cells.tolist(), policy.value_by_cell(), strict=True)
    }
    assert by_cell == pytest.approx({cell: slow[cell, None] for cell in by_cell}, abs=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_visits_and_moves_against_mass_moved_step_by_step(seed):
    scene, reward, alone, free, start, goal = world(seed)
    slow = np.zeros((*free.shape, 8))
    for ((column, row), _came), move in (flow := oracles.turn_flow(alone, SHARP, free, start, goal)):
        slow[row, column, move] += flow[((column, row), _came), move]
    policy = policy_of(reward, scene)
    columns, rows = scene.lattice.cells.T
    assert policy.flow_by_cell(scene.start) == pytest.approx(slow[rows, columns], abs=1e-10)
    visits = slow.sum(axis=2)[rows, columns]
    visits[scene.goal] = 1.0
    assert policy.visits_by_cell(scene.start) == pytest.approx(visits, abs=1e-10)
    seen = visits > 1e-6
    seen[scene.goal] = False
    shares = slow[rows, columns] / np.maximum(visits, 1e-30)[:, None]
    assert policy.probability_by_cell(scene.start)[seen] == pytest.approx(shares[seen], abs=1e-8)
    turned = sum(
        share * abs(np.angle(np.exp(1j * (np.pi / 4) * (move - came))))
        for ((_cell, came), move), share in flow.items()
        if came is not None
    )
    assert Visits(Steps(scene.lattice, scene.people_m, 0.0), policy, scene.start).heading_rad == pytest.approx(turned)


def test_cells_that_no_path_enters_have_the_probabilities_of_paths_that_begin_there():
    scene = make.scene_on(make.open_grid(60, 3), [5, 1], [0, 1])
    policy = policy_of(Reward((-5000.0, 0.0, -1.0, 1.0, -1.0), TURNING), scene)
    probability = policy.probability_by_cell(scene.start)
    driving = np.arange(scene.lattice.size) != scene.goal
    assert (policy.visits_by_cell(scene.start) == 0).any()
    assert probability[driving].sum(axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(3))
def test_without_a_cost_of_turns_everything_is_as_on_cells(seed):
    scene, *_ = world(seed)
    plain, turning = Reward(THETA), Reward((*THETA, 0.0), TURNING)
    evidence = evidence_of(make.drawn(scene, plain, 6, seed))
    one, other = policy_of(plain, scene), policy_of(turning, scene)
    assert other.value_by_cell() == pytest.approx(one.value, abs=1e-10)
    assert other.visits_by_cell(scene.start) == pytest.approx(one.visits_from(scene.start), abs=1e-10)
    assert other.probability_by_cell(scene.start) == pytest.approx(one.probability, abs=1e-8)
    cells, states = likelihood(evidence, plain), likelihood(evidence, turning)
    assert states.value == pytest.approx(cells.value, abs=1e-9)
    assert states.gradient[:4] == pytest.approx(cells.gradient, abs=1e-7)
    assert states.hessian[:4, :4] == pytest.approx(cells.hessian, abs=1e-6)
    assert states.scores[:, :4] == pytest.approx(cells.scores, abs=1e-7)
    assert states.information[:4, :4] == pytest.approx(cells.information, abs=1e-6)


EVERY_MODEL = [*MODELS, (*PAPER_TERMS[:2], TERMS["length-space"], TERMS["turn"])]


@pytest.mark.parametrize("terms", EVERY_MODEL, ids=lambda terms: "+".join(term.name for term in terms))
@pytest.mark.parametrize("blocks", [False, True], ids=["whole", "blocks"])
def test_gradient_and_hessian_of_every_model_against_finite_differences(terms, blocks, monkeypatch):
    if blocks:
        monkeypatch.setattr(likelihoods, "BLOCK", 10)
    scene = make.scene_on(make.open_grid(9, 6), [0, 2], [8, 3], [[0.45, 0.25], [0.7, 0.5]])
    start = np.array([THETA[0] if p.name == "c0" else p.initial for p in parameters_of(terms)])
    evidence = evidence_of(make.drawn(scene, Reward(tuple(start * 1.1), terms), 5, seed=1))
    half = evidence.only(
        [
            np.arange(len(one.cells) - 1) % 3 > 0
            for one in make.drawn(scene, Reward(tuple(start * 1.1), terms), 5, seed=1)
        ]
    )
    for some in (evidence, half):
        found = likelihood(some, Reward(tuple(start), terms))
        value, gradient = value_and_gradient(some, Reward(tuple(start), terms))
        assert found.value == pytest.approx(value)
        assert found.value == pytest.approx(log_likelihood(some, Reward(tuple(start), terms)))
        assert found.gradient == pytest.approx(gradient, rel=1e-8, abs=1e-8)
        assert found.scores.sum(axis=0) == pytest.approx(found.gradient)

        def slope(at, some=some):
            return value_and_gradient(some, Reward(tuple(at.tolist()), terms))

        exact = oracles.derivative(lambda at: np.array(slope(at)[0]), start)
        assert found.gradient == pytest.approx(exact, rel=1e-6, abs=1e-6)
        bend = oracles.derivative(lambda at: slope(at)[1], start)
        assert found.hessian == pytest.approx(bend, rel=1e-6, abs=1e-6)
    steps = step_likelihood(evidence, Reward(tuple(start), terms))
    assert steps.gradient.sum(axis=0) == pytest.approx(likelihood(evidence, Reward(tuple(start), terms)).gradient)


def test_information_is_the_covariance_of_the_scores_of_sampled_paths():
    scene, reward, *_ = world(2)
    found = likelihood(evidence_of(make.drawn(scene, reward, 1500, seed=3)), reward)
    spread = np.cov(found.scores.T) * 1500
    assert np.abs(found.gradient / np.sqrt(np.diag(found.information))).max() < 4
    assert np.diag(spread) == pytest.approx(np.diag(found.information), rel=0.2)
    unit = np.sqrt(np.outer(np.diag(found.information), np.diag(found.information)))
    assert spread / unit == pytest.approx(found.information / unit, abs=0.15)


def test_sampled_paths_have_the_policy_s_flow_and_likelihoods():
    scene, reward, *_ = world(1)
    policy = policy_of(reward, scene)
    paths = sample_paths(policy, scene.start, 20_000, np.random.default_rng(5))
    moves = moves_along(scene.lattice.cells[paths.states])
    counts = np.zeros((scene.lattice.size, 8))
    driven = moves >= 0
    np.add.at(counts, (paths.states[:, :-1][driven], moves[driven]), 1 / len(paths))
    assert counts == pytest.approx(policy.flow_by_cell(scene.start), abs=0.03)
    lines = PolicyLines.of(Steps(scene.lattice, scene.people_m, 0.0), paths, scene.nominal_line_m())
    exact = Visits(lines.steps, policy, scene.start)
    assert lines.heading_rad.mean() == pytest.approx(exact.heading_rad, rel=0.03)
    assert lines.length_m.mean() == pytest.approx(exact.length_m, rel=0.02)
    logs = sampled_log_likelihoods(policy, paths)
    for number in range(20):
        cells = scene.lattice.cells[paths.path(number)]
        one = make.demonstration(scene.lattice.grid, cells, scene.people_m)
        assert logs[number] == pytest.approx(log_likelihood(evidence_of([one]), reward), abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_matrix_of_states_is_split_into_steps_down_and_all_others(seed):
    ordering = world(seed)[0].turn_ordering
    size = ordering.graph.size
    weight = np.random.default_rng(seed).random((size, 8))
    whole = np.zeros((size, size))
    rank, move = np.nonzero(ordering.neighbours >= 0)
    whole[rank, ordering.neighbours[rank, move]] = weight[rank, move]
    triangular, rest = ordering.split(weight)
    lower = np.eye(size) - triangular.toarray()
    assert (lower + rest.toarray() == whole).all()
    assert not np.triu(lower).any()
    assert not np.tril(rest.toarray()).any()
    weight = np.where(ordering.neighbours >= 0, weight, 0.0) * 0.8 / np.maximum(weight.sum(axis=1, keepdims=True), 1)
    splitting = Splitting.of(ordering, weight)
    dense = np.zeros((size, size))
    dense[rank, ordering.neighbours[rank, move]] = weight[rank, move]
    right = np.random.default_rng(seed).random(size)
    for transposed in (False, True):
        matrix = np.eye(size) - (dense.T if transposed else dense)
        found = splitting.solve(right, np.ones(size), 5, transposed=transposed)
        assert found == pytest.approx(np.linalg.solve(matrix, right), abs=1e-11)


def test_an_infinite_partition_function_is_refused_and_near_it_the_krylov_method_is_exact(monkeypatch):
    scene = make.scene_on(make.open_grid(9, 7), [0, 3], [8, 3])
    with pytest.raises(InfinitePartitionError) as raised:
        policy_of(Reward((-9.0, 0.0, -1.0, 1.0, -0.5), TURNING), scene)
    assert raised.value.status is ValueStatus.INFINITE
    with pytest.raises(InfinitePartitionError):
        policy_of(Reward((-20.0, 0.0, -1.0, 1.0, 3.0), TURNING), scene)  # turning to and fro pays
    reward = Reward((-15.5, 0.0, -1.0, 1.0, -0.5), TURNING)
    plain = policy_of(reward, scene)
    monkeypatch.setattr(series, "PLAIN_SWEEPS", 3)
    fast = policy_of(reward, scene)
    assert fast.value == pytest.approx(plain.value, abs=1e-8)
    assert plain.sweeps > fast.sweeps


def test_a_cost_of_turns_makes_paths_turn_less():
    scene = make.scene_on(make.open_grid(14, 9), [0, 2], [13, 6], [[0.7, 0.4]])
    turned = []
    for sharp in (0.0, -1.0, -4.0):
        policy = policy_of(Reward((-24.0, -1.0, -4.0, 3.0, sharp), TURNING), scene)
        moves = policy.probability * policy.visits_from(scene.start)[:, None]
        incoming = policy.graph.incoming
        turned.append(
            sum(
                moves[incoming == came, move].sum()
                for came in range(8)
                for move in range(8)
                if oracles.is_sharp(came, move)
            )
        )
    assert turned[0] > turned[1] > turned[2]
    assert MOVES.tolist() == [list(move) for move in oracles.MOVES]
