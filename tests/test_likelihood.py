"""Likelihood, gradient, Hessian, scores: by hand, by finite differences, and what must not change them."""

from dataclasses import replace

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.grid import Grid, moves_along
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import (
    feature_sums,
    likelihood,
    log_likelihood,
    policy_of,
    step_likelihood,
    value_and_gradient,
)
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward

TRUTH = Reward((-35.0, -0.6, -3.0, 2.0))


def crowd(people, seed=0):
    """Demonstrations in two scenes on one map with obstacles."""
    rng = np.random.default_rng(seed)
    scene = make.random_scene(rng, 14, 10, density=0.12, people=people)
    cells = scene.lattice.cells
    other = make.scene_on(scene.lattice.grid, cells[scene.goal], cells[scene.start], scene.people_m)
    return [*make.drawn(scene, TRUTH, 3, seed), *make.drawn(other, TRUTH, 2, seed + 1)]


def test_three_cells_in_a_row_by_hand():
    world = oracles.CorridorOfThree
    evidence = evidence_of([make.demonstration(make.grid_of("..."), [[0, 0], [1, 0], [2, 0]])])
    found = likelihood(evidence, Reward((world.C0, 0.0, 0.0, 1.0)))
    assert found.value == pytest.approx(world.LOG_LIKELIHOOD, rel=1e-13)
    assert found.gradient[0] == pytest.approx(world.GRADIENT_C0, rel=1e-12)
    assert found.hessian[0, 0] == pytest.approx(world.HESSIAN_C0, rel=1e-12)
    assert evidence.uniform_log_likelihood() == pytest.approx(world.UNIFORM_LOG_LIKELIHOOD)


def test_equally_likely_moves_by_hand():
    # A corner has 3 moves, a cell on a side 5, the one in the middle 8.
    grid = make.open_grid(3, 3)
    path = make.demonstration(grid, [[0, 0], [1, 1], [2, 1], [2, 2]])
    assert evidence_of([path]).uniform_log_likelihood() == pytest.approx(-np.log(3 * 8 * 5))
    assert evidence_of([path, path]).uniform_log_likelihood() == pytest.approx(-2 * np.log(3 * 8 * 5))


def test_the_likelihood_of_a_path_against_value_iteration():
    demonstrations = crowd(2)
    total = 0.0
    for one in demonstrations:
        free, grid = ~one.grid.occupied, one.grid
        start, goal = tuple(one.cells[0].tolist()), tuple(one.cells[-1].tolist())
        reward = oracles.paper_reward(TRUTH.theta, free, start, goal, one.people_m, 0.1, grid.origin_m)
        policy = oracles.soft_policy(reward, oracles.soft_values(reward, goal))
        for here, there in zip(one.cells[:-1], one.cells[1:], strict=True):
            move = oracles.MOVES.index(tuple((there - here).tolist()))
            total += np.log(policy[here[1], here[0], move])
    assert log_likelihood(evidence_of(demonstrations), TRUTH) == pytest.approx(total, rel=1e-10)


@pytest.mark.parametrize("people", [0, 1, 2])
@pytest.mark.parametrize("theta", [(-35.0, -0.6, -3.0, 2.0), (-70.0, -0.05, -0.5, 0.4), (-27.0, -3.0, 0.3, 6.0)])
def test_gradient_and_hessian_against_finite_differences(people, theta):
    evidence = evidence_of(crowd(people))

    def value(x):
        return log_likelihood(evidence, Reward(tuple(x)))

    def gradient(x):
        return likelihood(evidence, Reward(tuple(x))).gradient

    found = likelihood(evidence, Reward(theta))
    assert found.value == pytest.approx(value(theta), rel=1e-13)
    assert found.gradient == pytest.approx(oracles.derivative(value, np.array(theta)), rel=1e-6, abs=1e-7)
    assert found.hessian == pytest.approx(oracles.derivative(gradient, np.array(theta)), rel=1e-6, abs=1e-7)
    assert (found.hessian == found.hessian.T).all()
    if people == 0:
        assert (found.gradient[2:] == 0).all()
        assert (found.hessian[2:] == 0).all()


def test_scores_sum_to_the_gradient_and_each_is_that_of_its_demonstration():
    demonstrations = crowd(2)
    found = likelihood(evidence_of(demonstrations), TRUTH)
    assert found.scores.shape == (5, 4)
    assert found.scores.sum(axis=0) == pytest.approx(found.gradient, rel=1e-12)
    for number, one in enumerate(demonstrations):
        alone = likelihood(evidence_of([one]), TRUTH).gradient
        assert found.scores[number] == pytest.approx(alone, rel=1e-9, abs=1e-10)


def test_equal_scenes_are_solved_once():
    demonstrations = crowd(1)
    shuffled = [demonstrations[i] for i in (3, 0, 4, 1, 2)]
    evidence = evidence_of(shuffled)
    assert len(evidence.scenes) == 2
    assert evidence.count == 5
    assert evidence.steps == sum(len(one.cells) - 1 for one in demonstrations)
    assert sorted(np.unique(np.concatenate([part.owner for part in evidence.scenes]))) == [0, 1, 2, 3, 4]


def test_repeated_steps_count_each_time():
    # Back and forth twice before going on.
    grid = make.open_grid(5, 3)
    once = make.demonstration(grid, [[0, 1], [1, 1], [2, 1], [3, 1], [4, 1]])
    again = make.demonstration(grid, [[0, 1], [1, 1], [2, 1], [1, 1], [2, 1], [1, 1], [2, 1], [3, 1], [4, 1]])
    scene = evidence_of([once]).scenes[0].scene
    policy = policy_of(TRUTH, scene)
    east, west = (
        np.log(policy.probability[scene.lattice.states_of(np.array([cell]))[0], move])
        for cell, move in (([1, 1], 0), ([2, 1], 4))
    )
    values = [log_likelihood(evidence_of([one]), TRUTH) for one in (once, again)]
    assert values[1] - values[0] == pytest.approx(2 * (east + west), rel=1e-10)
    assert evidence_of([again]).steps == 8


def close(one, other):
    assert one.value == pytest.approx(other.value, rel=1e-9)
    assert one.gradient == pytest.approx(other.gradient, rel=1e-9, abs=1e-8)
    assert one.hessian == pytest.approx(other.hessian, rel=1e-9, abs=1e-7)


def test_the_order_of_demonstrations_changes_nothing():
    demonstrations = crowd(2)
    close(likelihood(evidence_of(demonstrations[::-1]), TRUTH), likelihood(evidence_of(demonstrations), TRUTH))


def moved(one, occupied, to_cell, to_xy, origin_m):
    grid = Grid(np.ascontiguousarray(occupied(one.grid.occupied)), one.grid.resolution_m, origin_m)
    return make.demonstration(grid, to_cell(*one.cells.T, *one.grid.shape), to_xy(one), number=int(one.id[3:]))


def shifted(one):
    return moved(
        one, np.copy, lambda c, r, *_: np.stack([c, r], 1), lambda d: d.people_m + np.array([12.5, -4.0]), (12.15, -3.2)
    )


def mirrored(one):
    x0, x1, *_ = one.grid.extent_m
    return moved(
        one,
        lambda o: o[:, ::-1],
        lambda c, r, _, columns: np.stack([columns - 1 - c, r], 1),
        lambda d: np.stack([x0 + x1 - d.people_m[:, 0], d.people_m[:, 1]], 1),
        one.grid.origin_m,
    )


def turned(one):
    """By 90 degrees to the left: (x, y) -> (height - y, x) from the lower left corner."""
    x0, _, y0, y1 = one.grid.extent_m
    return moved(
        one,
        lambda o: o.T[:, ::-1],
        lambda c, r, rows, _: np.stack([rows - 1 - r, c], 1),
        lambda d: np.stack([x0 + y1 - d.people_m[:, 1], y0 + d.people_m[:, 0] - x0], 1),
        one.grid.origin_m,
    )


@pytest.mark.parametrize("change", [shifted, mirrored, turned], ids=lambda change: change.__name__)
def test_translation_and_rotation_of_the_world_change_nothing(change):
    demonstrations = crowd(2)
    close(
        likelihood(evidence_of([change(d) for d in demonstrations]), TRUTH),
        likelihood(evidence_of(demonstrations), TRUTH),
    )


def test_twice_the_demonstrations_twice_the_likelihood_and_half_the_covariance():
    scene = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4], [[0.8, 0.4]])
    paths = make.drawn(scene, TRUTH, 40, seed=5)
    single, double = evidence_of(paths), evidence_of(paths + paths)
    assert log_likelihood(double, TRUTH) == pytest.approx(2 * log_likelihood(single, TRUTH), rel=1e-12)
    one, two = fit(single, TRUTH, l2=0.0), fit(double, TRUTH, l2=0.0)
    assert np.isfinite(one.covariance).all()
    assert two.covariance == pytest.approx(one.covariance / 2, rel=1e-4)


def test_the_expected_gradient_is_zero_at_the_truth():
    # Over many paths drawn from a policy, the mean score is zero within its standard error.
    scene = make.scene_on(make.open_grid(12, 7), [0, 3], [11, 3], [[0.6, 0.3]])
    found = likelihood(evidence_of(make.drawn(scene, TRUTH, 1500, seed=9)), TRUTH)
    error = found.scores.std(axis=0, ddof=1) / np.sqrt(1500)
    assert (np.abs(found.scores.mean(axis=0)) < 4 * error).all()
    # The scores' covariance is the information (the curvature), for this is a correct model.
    assert np.cov(found.scores.T) == pytest.approx(
        -found.hessian / 1500, rel=0.2, abs=0.02 * np.abs(found.hessian).max() / 1500
    )


def test_no_demonstrations_are_an_error():
    with pytest.raises(DemonstrationError, match="no demonstration to learn from"):
        evidence_of([])


def test_a_path_through_its_goal_is_refused_by_name():
    grid = make.open_grid(4, 2)
    path = make.demonstration(grid, [[0, 0], [1, 0], [2, 0], [3, 0], [2, 0]], participant="p4", number=2)
    with pytest.raises(DemonstrationError, match=r"demonstration p4/2: its path passes the goal's cell before it ends"):
        evidence_of([path])


def test_participants_are_kept_in_order():
    grid = make.open_grid(3, 1)
    names = ["b", "a", "b"]
    paths = [make.demonstration(grid, [[0, 0], [1, 0]], participant=name, number=i) for i, name in enumerate(names)]
    assert evidence_of(paths).participants == ("b", "a", "b")


def test_only_the_cells_count_not_the_poses():
    scene = make.scene_on(make.open_grid(8, 4), [0, 1], [7, 1])
    states = sample_paths(policy_of(TRUTH, scene), scene.start, 1, np.random.default_rng(0)).path(0)
    one = make.demonstration(scene.lattice.grid, scene.lattice.cells[states])
    other = replace(one, t_s=one.t_s * 3, yaw_rad=one.yaw_rad + 1.0, xy_m=one.xy_m + 0.02)
    assert log_likelihood(evidence_of([one]), TRUTH) == log_likelihood(evidence_of([other]), TRUTH)


def test_steps_sum_to_their_demonstrations_and_to_the_whole():
    evidence = evidence_of(crowd(2))
    found, steps = likelihood(evidence, TRUTH), step_likelihood(evidence, TRUTH)
    assert len(steps.value) == len(steps.number) == evidence.steps
    assert steps.value.sum() == pytest.approx(found.value, rel=1e-12)
    assert (steps.value < 0).all()
    for owner in range(evidence.count):
        own = steps.demonstration == owner
        assert sorted(steps.number[own].tolist()) == list(range(int(own.sum())))
        assert steps.gradient[own].sum(axis=0) == pytest.approx(found.scores[owner], rel=1e-9, abs=1e-10)


def slow_steps(one, theta):
    """log p(a|s) of every step of a path, by value iteration."""
    goal = tuple(one.cells[-1].tolist())
    where = ~one.grid.occupied, tuple(one.cells[0].tolist()), goal, one.people_m, 0.1, one.grid.origin_m
    reward = oracles.paper_reward(tuple(theta), *where)
    policy = oracles.soft_policy(reward, oracles.soft_values(reward, goal))
    columns, rows = one.cells[:-1].T
    return np.log(policy[rows, columns, moves_along(one.cells)])


@pytest.mark.parametrize("theta", [(-35.0, -0.6, -3.0, 2.0), (-26.0, -0.1, 0.3, 6.0)])
def test_every_step_and_its_gradient_against_value_iteration(theta):
    demonstrations = crowd(1)
    evidence = evidence_of(demonstrations)
    steps = step_likelihood(evidence, Reward(theta))
    for owner, one in enumerate(demonstrations):
        own = np.flatnonzero(steps.demonstration == owner)
        own = own[np.argsort(steps.number[own])]
        assert steps.value[own] == pytest.approx(slow_steps(one, theta), rel=1e-9)
        if owner in {0, 3}:
            slow = oracles.derivative(lambda x, one=one: slow_steps(one, x), np.array(theta))
            assert steps.gradient[own] == pytest.approx(slow, rel=1e-6, abs=1e-7)


def test_some_of_the_steps_have_their_own_value_gradient_and_hessian():
    demonstrations, rng = crowd(2), np.random.default_rng(8)
    whole = evidence_of(demonstrations)
    masks = [rng.random(len(one.cells) - 1) < 0.4 for one in demonstrations]
    masks[1][:] = False
    some = whole.only(masks)
    theta = np.array([-33.0, -0.4, -2.0, 1.5])

    def value(x):
        return log_likelihood(some, Reward(tuple(x)))

    def gradient(x):
        return likelihood(some, Reward(tuple(x))).gradient

    found = likelihood(some, Reward(tuple(theta)))
    steps = step_likelihood(whole, Reward(tuple(theta)))
    taken = [masks[owner][number] for owner, number in zip(steps.demonstration, steps.number, strict=True)]
    assert found.value == pytest.approx(steps.value[taken].sum(), rel=1e-12)
    assert found.gradient == pytest.approx(steps.gradient[taken].sum(axis=0), rel=1e-9, abs=1e-10)
    assert found.gradient == pytest.approx(oracles.derivative(value, theta), rel=1e-6, abs=1e-7)
    assert found.hessian == pytest.approx(oracles.derivative(gradient, theta), rel=1e-6, abs=1e-7)
    assert (found.scores[1] == 0).all()


@pytest.mark.parametrize("people", [0, 2])
def test_value_and_gradient_are_those_of_the_likelihood(people):
    demonstrations = crowd(people)
    whole = evidence_of(demonstrations)
    some = whole.only([np.arange(len(one.cells) - 1) % 3 == 0 for one in demonstrations])
    for evidence in (whole, some, whole.repeated(np.array([0, 2, 1, 0, 3]))):
        found = likelihood(evidence, TRUTH)
        value, gradient = value_and_gradient(evidence, TRUTH)
        assert value == pytest.approx(found.value, rel=1e-13)
        assert gradient == pytest.approx(found.gradient, rel=1e-9, abs=1e-9)


def test_repeated_demonstrations_count_as_often():
    evidence = evidence_of(crowd(2))
    counts = np.array([2, 0, 1, 3, 1])
    found, again = likelihood(evidence, TRUTH), likelihood(evidence.repeated(counts), TRUTH)
    assert again.scores == pytest.approx(counts[:, None] * found.scores, rel=1e-9, abs=1e-9)
    alone = [likelihood(evidence.repeated(np.eye(5, dtype=int)[i]), TRUTH) for i in range(5)]
    assert again.hessian == pytest.approx(sum(c * one.hessian for c, one in zip(counts, alone, strict=True)), rel=1e-9)


def test_the_information_is_the_covariance_of_the_gradients_of_sampled_paths():
    count = 3000
    scene = make.scene_on(make.open_grid(12, 7), [0, 3], [11, 3], [[0.6, 0.3]])
    found = likelihood(evidence_of(make.drawn(scene, TRUTH, count, seed=21)), TRUTH)
    # The true mean of the gradients is zero: their covariance is the mean of their products.
    products = found.scores[:, :, None] * found.scores[:, None, :]
    error = products.std(axis=0, ddof=1) / np.sqrt(count)
    assert (error < 0.1 * np.sqrt(np.outer(np.diag(found.information), np.diag(found.information))) / count).all()
    assert (np.abs(products.mean(axis=0) - found.information / count) < 4 * error).all()


@pytest.mark.parametrize("people", [0, 1, 2])
def test_for_parameters_that_the_reward_is_linear_in_the_information_is_the_curvature(people):
    demonstrations = crowd(people)
    some = evidence_of(demonstrations).only([np.arange(len(one.cells) - 1) % 2 == 0 for one in demonstrations])
    for evidence in (evidence_of(demonstrations), some):
        found = likelihood(evidence, TRUTH)
        assert found.information[:3, :3] == pytest.approx(-found.hessian[:3, :3], rel=1e-12)
        assert (found.information == found.information.T).all()
    if people:
        whole = likelihood(evidence_of(demonstrations), TRUTH)
        assert whole.information[3, 3] != pytest.approx(-whole.hessian[3, 3], rel=1e-3)
        assert (np.linalg.eigvalsh(whole.information) > 0).all()


def test_feature_sums_are_sums_over_the_steps_that_count():
    demonstrations = crowd(1)
    evidence = evidence_of(demonstrations)
    found = feature_sums(evidence, TRUTH)
    lengths = [np.hypot(*np.diff(one.cells, axis=0).T).sum() * 0.1 for one in demonstrations]
    assert found[0] == pytest.approx(sum(lengths))
    a_p, sigma_p = TRUTH.theta[2:]
    squared = np.concatenate(
        [((one.grid.centres_of(one.cells[:-1]) - one.people_m[0]) ** 2).sum(axis=1) for one in demonstrations]
    )
    bump = np.exp(-sigma_p * squared)
    assert found[2:] == pytest.approx([bump.sum(), -(a_p * squared * bump).sum()])
    assert feature_sums(evidence.repeated(np.full(5, 2)), TRUTH) == pytest.approx(2 * found)


@pytest.mark.parametrize("change", [shifted, mirrored, turned], ids=lambda change: change.__name__)
def test_translation_and_rotation_of_the_world_do_not_change_the_fit(change):
    scene = make.scene_on(make.open_grid(16, 9, (-0.35, 0.8)), [0, 4], [15, 4], [[0.45, 1.2]])
    demonstrations = make.drawn(scene, TRUTH, 30, seed=5)
    one, other = (fit(evidence_of(some), Reward.named({})) for some in (demonstrations, [*map(change, demonstrations)]))
    assert one.log_likelihood == pytest.approx(other.log_likelihood, rel=1e-10)
    assert one.reward.theta == pytest.approx(other.reward.theta, rel=1e-6)
    assert one.covariance == pytest.approx(other.covariance, rel=1e-5)


def test_the_order_of_demonstrations_does_not_change_the_fit():
    scene = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4], [[0.8, 0.4]])
    demonstrations = make.by_participants(scene, TRUTH, 5, 6, seed=5)
    shuffled = [demonstrations[i] for i in np.random.default_rng(0).permutation(30)]
    one, other = (fit(evidence_of(some), Reward.named({})) for some in (demonstrations, shuffled))
    assert one.reward.theta == pytest.approx(other.reward.theta, rel=1e-6)
    assert one.covariance == pytest.approx(other.covariance, rel=1e-5)
    assert one.clustered == pytest.approx(other.clustered, rel=1e-5)
