"""Linear systems: against dense solves, by the Krylov method, near criticality, and on long and extreme worlds."""

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.grid import Grid
from navirl_cli.irl import series, values
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError, Splitting, ValueStatus


def split_at_random(seed, leaving=0.2):
    """A splitting of random weights whose rows sum to 1 - leaving at most, and the whole matrix, by rank."""
    rng = np.random.default_rng(seed)
    ordering = make.random_scene(rng, 13, 9, density=(0.0, 0.25)[seed % 2]).ordering
    weight = np.where(ordering.neighbours >= 0, rng.random(ordering.neighbours.shape), 0.0)
    weight *= (1 - leaving) / weight.sum(axis=1, keepdims=True)
    size = ordering.graph.size
    whole = np.zeros((size, size))
    rank, move = np.nonzero(ordering.neighbours >= 0)
    whole[rank, ordering.neighbours[rank, move]] = weight[rank, move]
    return Splitting.of(ordering, weight), whole, rng


@pytest.mark.parametrize("krylov", [False, True], ids=["sweeps", "krylov"])
@pytest.mark.parametrize("transposed", [False, True], ids=["rows", "columns"])
@pytest.mark.parametrize("seed", range(4))
def test_systems_against_dense_solves(seed, transposed, krylov, monkeypatch):
    if krylov:
        monkeypatch.setattr(series, "PLAIN_SWEEPS", 2)
    splitting, whole, rng = split_at_random(seed)
    matrix = np.eye(len(whole)) - (whole.T if transposed else whole)
    size = np.ones(len(whole))
    several = rng.normal(size=(len(whole), 3))
    several[:, 1] = 0.0
    for right in (several[:, 0], several):
        found = splitting.solve(right, size, 5, transposed=transposed)
        assert found.shape == right.shape
        assert np.abs(found - np.linalg.solve(matrix, right)).max() < 1e-11


def test_the_first_term_and_a_sweep_against_dense_products():
    splitting, whole, rng = split_at_random(2)
    lower, upper = np.tril(whole), np.triu(whole)
    x = rng.normal(size=len(whole))
    one = np.eye(len(whole))
    assert splitting.start(x) == pytest.approx(np.linalg.solve(one - lower, x))
    assert splitting.sweep(x) == pytest.approx(np.linalg.solve(one - lower, upper @ x))
    assert splitting.start(x, transposed=True) == pytest.approx(np.linalg.solve(one - lower.T, x))
    assert splitting.sweep(x, transposed=True) == pytest.approx(np.linalg.solve(one - lower.T, upper.T @ x))


def sums_of(scene, policy):
    """Visits from the start, and expected sums of two rewards."""
    local = np.random.default_rng(1).normal(size=(scene.lattice.size, 2))
    return policy.visits(np.eye(scene.lattice.size)[scene.start]), policy.expected_to_goal(local)


@pytest.fixture
def krylov(monkeypatch):
    """Counts what the Krylov method is asked for from now on: z, and sums."""
    used = {"_accelerated": 0, "_refined": 0}
    for name in used:
        method = getattr(Splitting, name)

        def watched(*args, name=name, method=method, **named):
            used[name] += 1
            return method(*args, **named)

        monkeypatch.setattr(Splitting, name, watched)
    monkeypatch.setattr(series, "PLAIN_SWEEPS", 4)
    return used


KRYLOV_WORLDS = [
    (make.random_scene(np.random.default_rng(seed), 24, 16, density=(0.0, 0.15, 0.3)[seed % 3]), theta)
    for seed, theta in enumerate(
        [
            (-22.0, 0.0, 0.0, 1.0),
            (-20.0, -0.4, -3.0, 2.0),
            (-17.0, 0.0, 0.0, 1.0),
            (-19.0, -1.0, 0.2, 1.0),
            (-45.0, -1.0, -8.0, 3.0),
        ]
    )
]


@pytest.mark.parametrize("number", range(len(KRYLOV_WORLDS)))
def test_the_krylov_method_finds_what_plain_sweeps_find(number, krylov, monkeypatch):
    scene, theta = KRYLOV_WORLDS[number]
    reward = Reward(theta)
    policy = policy_of(reward, scene)
    visits, sums = sums_of(scene, policy)
    if number < 4:
        assert krylov["_accelerated"] == 1
        assert krylov["_refined"] == 3, "one for the visits, one for each reward"
    monkeypatch.setattr(series, "PLAIN_SWEEPS", 5000)
    plain = policy_of(reward, scene)
    plain_visits, plain_sums = sums_of(scene, plain)
    assert np.abs(policy.value - plain.value).max() < 1e-10
    assert np.abs(policy.probability - plain.probability).max() < 1e-10
    assert visits == pytest.approx(plain_visits, rel=1e-10, abs=1e-12)
    assert sums == pytest.approx(plain_sums, rel=1e-10, abs=1e-10)
    assert np.abs(policy.value - make.slow_values(scene, reward)).max() < 1e-9


def attempt(reward, scene):
    """The policy, or the reason why there is none."""
    try:
        return policy_of(reward, scene), None
    except InfinitePartitionError as error:
        return None, error.status


@pytest.mark.parametrize("plain", [series.PLAIN_SWEEPS, 8])
def test_close_to_criticality_a_number_is_right_and_a_refusal_has_its_reason(plain, monkeypatch):
    monkeypatch.setattr(series, "PLAIN_SWEEPS", plain)
    scene = make.scene_on(make.open_grid(26, 18), [2, 9], [23, 9])
    one = np.eye(scene.lattice.size)

    def all_walks(matrix):
        """(I - M)^-1, and whether the spectral radius is below 1: then, and only then, no entry is negative."""
        inverse = np.linalg.inv(one - matrix)
        return inverse, bool((inverse >= 0).all())

    seen = []
    for c0 in (*np.arange(-18.2, -17.69, 0.02 if plain > 100 else 0.1), -17.66, -17.6, -17.5):
        reward = Reward((float(c0), 0.0, 0.0, 1.0))
        matrix = make.dense(scene, reward)
        policy, status = attempt(reward, scene)
        seen.append(status)
        if status is not None:
            assert not all_walks(matrix * (1.0 if status is ValueStatus.INFINITE else 1.001))[1]
            assert status is ValueStatus.INFINITE or all_walks(0.999 * matrix)[1]
            continue
        walks, finite = all_walks(matrix)
        assert finite
        z = walks[:, scene.goal]
        assert np.abs(np.exp(policy.value) / z - 1).max() < series.ACCEPTED
        if len(seen) % 4:
            continue
        visits = policy.visits(one[scene.start])
        assert visits[scene.goal] == pytest.approx(1.0, abs=1e-9)
        # A state is visited with the weight of the walks to it and on to the goal, of all walks to the goal.
        assert visits == pytest.approx(walks[scene.start] * z / z[scene.start], rel=1e-8)
    assert {None, ValueStatus.INFINITE} <= set(seen)
    assert seen.count(ValueStatus.UNDECIDED) <= 2
    assert seen[: seen.count(None)] == [None] * seen.count(None), "finite first, then never again"


def serpentine(turns, length, width):
    """Corridors side by side, joined at alternate ends."""
    occupied = np.zeros((turns * (width + 1) - 1, length), dtype=bool)
    for number in range(1, turns):
        occupied[number * (width + 1) - 1] = True
        end = slice(-width, None) if number % 2 else slice(0, width)
        occupied[number * (width + 1) - 1, end] = False
    goal = [length - 1 if turns % 2 else 0, len(occupied) - 1]
    return make.scene_on(Grid(occupied, 0.1, (0.0, 0.0)), [0, 0], goal, [[length * 0.05, 0.5]])


STUDY = (-54.12586, -0.873514, -4.907188, 1.679499)


@pytest.mark.parametrize(
    ("scene", "theta"),
    [
        (make.scene_on(make.open_grid(70, 45), [3, 20], [66, 18], [[3.0, 2.1]]), STUDY),
        (make.scene_on(make.open_grid(70, 45), [3, 20], [66, 18], [[3.0, 2.1]]), (-24.0, 0.0, 0.3, 0.2)),
        (make.scene_on(make.open_grid(1, 900), [0, 0], [0, 899]), (-26.0, 0.0, 0.0, 1.0)),
        (make.scene_on(make.open_grid(600, 3), [0, 1], [599, 2], [[30.0, 0.1]]), STUDY),
        (serpentine(18, 60, 1), (-30.0, 0.0, -5.0, 2.0)),
        (serpentine(8, 60, 2), STUDY),
    ],
    ids=["open", "open and cheap", "line", "corridor", "thin serpentine", "serpentine"],
)
def test_every_value_of_large_worlds_is_right_to_nine_digits(scene, theta):
    reward = Reward(theta)
    policy = policy_of(reward, scene)
    assert np.abs(policy.value - make.slow_values(scene, reward)).max() < 1e-9
    assert policy.visits(np.eye(scene.lattice.size)[scene.start])[scene.goal] == pytest.approx(1.0, abs=1e-10)


def test_the_thin_serpentine_is_a_thousand_cells_long():
    scene = serpentine(18, 60, 1)
    assert len(scene.hugging_path()) >= 1000
    assert scene.ordering.distance.max() > values.PLAIN_STEPS * 0.1, "so long that it is solved in bands"


@pytest.mark.parametrize(
    "theta",
    [
        (-1e4, -1e4, -1e4, 1e-3),
        (-1e4, 0.0, 1e3, 1e3),
        (-19.5, 0.0, 0.0, 1.0),
        (-50.0, -1e4, 0.0, 2.0),
        (-50.0, -1.0, -1e4, 2.0),
        (-40.0, 0.0, -1e4, 1e3),
    ],
)
def test_extreme_parameters_against_value_iteration(theta):
    scene = make.scene_on(make.open_grid(30, 12), [1, 5], [28, 5], [[1.52, 0.53]])
    reward = Reward(theta)
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        policy = policy_of(reward, scene)
        visits, sums = sums_of(scene, policy)
    slow = make.slow_values(scene, reward)
    # Values of ten million are doubles of nine digits behind the point.
    assert (np.abs(policy.value - slow) < np.maximum(1e-9, 32 * np.spacing(np.abs(slow)))).all()
    assert np.isfinite(visits).all()
    assert np.isfinite(sums).all()
    assert visits[scene.goal] == pytest.approx(1.0, abs=1e-9)


def test_the_reason_is_passed_between_processes():
    error = InfinitePartitionError(ValueStatus.UNDECIDED)
    kind, arguments = error.__reduce__()
    assert str(kind(*arguments)) == str(error)
    assert kind(*arguments).status is ValueStatus.UNDECIDED


@pytest.mark.parametrize(
    "theta",
    [
        (-16.0, 0.0, 0.0, 1.0),
        (-0.01, 0.0, 0.0, 1.0),
        (-50.0, 0.0, 30.0, 2.0),
    ],
)
def test_an_infinite_partition_function_is_reported_after_few_sweeps(theta, monkeypatch):
    monkeypatch.setattr(series, "MAX_SWEEPS", 100)
    scene = make.scene_on(make.open_grid(30, 20), [2, 10], [27, 10], [[1.5, 1.0]])
    assert attempt(Reward(theta), scene) == (None, ValueStatus.INFINITE)
