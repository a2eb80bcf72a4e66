"""Ranks of demonstrations among the policy's own paths: uniform where the policy is the truth."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest
from scipy import stats

from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.grid import moves_along
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.groups import Trained
from navirl_cli.evaluation.lines import area_between_m2, center_distance_m
from navirl_cli.evaluation.ranks import (
    Ranking,
    by_group_and_training,
    check_to_rank,
    path_log_likelihood,
    ranking,
    ranks_of,
    sampled_log_likelihoods,
)
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import log_likelihood, policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.reports.ranks import group_ranks_table, rank_lines

TRUTH = Reward((-45.0, -0.8, -4.0, 2.0))
SCENE = make.scene_on(make.open_grid(40, 21), [2, 10], [37, 10], [[2.05, 1.05]])


@pytest.fixture(scope="module")
def demonstrations():
    return make.drawn(SCENE, TRUTH, 500, seed=0)


def ranks(demonstrations, reward, seed=1):
    return np.array([one.rank for one in ranks_of(demonstrations, reward, 2000, np.random.default_rng(seed))])


def test_under_the_truth_ranks_are_uniform(demonstrations):
    found = ranks(demonstrations, TRUTH)
    assert ((found >= 0) & (found <= 1)).all()
    assert stats.kstest(found, "uniform").pvalue > 0.01


@pytest.mark.parametrize(
    "wrong", [(-60.0, -0.8, -4.0, 2.0), (-35.0, -0.8, -4.0, 2.0), (-45.0, -0.8, 0.0, 2.0), (-45.0, -8.0, -4.0, 2.0)]
)
def test_under_another_reward_they_are_not(demonstrations, wrong):
    assert stats.kstest(ranks(demonstrations, Reward(wrong)), "uniform").pvalue < 1e-4


def test_log_likelihoods_are_those_of_the_fit(demonstrations):
    few = demonstrations[:5]
    found = ranks_of(few, TRUTH, 10, np.random.default_rng(0))
    assert sum(one.log_likelihood for one in found) == pytest.approx(log_likelihood(evidence_of(few), TRUTH))
    assert [one.id for one in found] == [one.id for one in few]


def test_sampled_paths_have_the_likelihood_of_their_moves():
    policy = policy_of(TRUTH, SCENE)
    paths = sample_paths(policy, SCENE.start, 50, np.random.default_rng(3))
    for number, value in enumerate(sampled_log_likelihoods(policy, paths)):
        states = paths.path(number)
        assert value == pytest.approx(path_log_likelihood(policy, states, moves_along(SCENE.lattice.cells[states])))


def test_a_path_that_the_policy_never_takes_ranks_last():
    # Under a steep reward a long detour has a probability of zero.
    far = [[2, 10], [2, 9], *[[c, 8] for c in range(3, 37)], [37, 9], [37, 10]]
    one = make.demonstration(SCENE.lattice.grid, far, SCENE.people_m)
    (found,) = ranks_of([one], Reward((-2000.0, -0.8, -4.0, 2.0)), 100, np.random.default_rng(0))
    assert found.rank < 0.02


def test_ties_are_shared_out_and_the_same_seed_ranks_the_same():
    # A corridor one cell wide with hardly any choice: nearly all paths are one.
    scene = make.scene_on(make.open_grid(12, 1), [0, 0], [11, 0])
    only = [make.demonstration(scene.lattice.grid, [[c, 0] for c in range(12)], number=i) for i in range(200)]
    reward = Reward((-200.0, -0.5, 0.0, 1.0))
    found = ranks(only, reward)
    assert stats.kstest(found, "uniform").pvalue > 0.01
    assert (found == ranks(only, reward)).all()
    assert (found != ranks(only, reward, seed=2)).any()


def test_progress_counts():
    seen = []
    few = make.drawn(SCENE, TRUTH, 3, seed=5)
    ranks_of(few, TRUTH, 10, np.random.default_rng(0), lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_under_the_truth_all_three_ranks_are_uniform(demonstrations):
    found = ranks_of(demonstrations[:200], TRUTH, 500, np.random.default_rng(2))
    for shares in ([one.distance_rank for one in found], [one.area_rank for one in found]):
        assert stats.kstest(shares, "uniform").pvalue > 0.01
    assert np.mean([one.fits_badly for one in found]) < 0.08


def test_a_policy_of_another_space_shows_in_the_rank_of_the_distance(demonstrations):
    nearer = ranks_of(demonstrations[:100], Reward((-45.0, -0.8, 0.0, 2.0)), 500, np.random.default_rng(2))
    assert np.mean([one.distance_rank for one in nearer]) > 0.6, "the demonstrations pass farther away than the policy"


def test_ranks_by_shape_are_shares_of_measured_paths():
    # slow and obvious: each drawn path measured by itself
    (one,) = make.drawn(SCENE, TRUTH, 1, seed=9)
    rng = np.random.default_rng(4)
    (found,) = ranks_of([one], TRUTH, 60, rng)
    policy = policy_of(TRUTH, SCENE)
    paths = sample_paths(policy, SCENE.start, 60, np.random.default_rng(4))
    nominal = SCENE.nominal_line_m()
    person = SCENE.people_m[0]
    least = lambda line: center_distance_m(line, person[None])  # noqa: E731
    area = lambda line: area_between_m2(line, nominal)  # noqa: E731
    lines = [SCENE.lattice.xy_m[paths.path(k)] for k in range(60)]
    own = SCENE.lattice.xy_m[SCENE.lattice.states_of(one.cells)]
    for measure, rank in ((least, found.distance_rank), (area, found.area_rank)):
        below = sum(measure(line) < measure(own) - 1e-9 for line in lines)
        equal = sum(abs(measure(line) - measure(own)) <= 1e-9 for line in lines)
        assert below / 61 <= rank <= (below + equal + 1) / 61


def groups_of_trials():
    push = make.drawn(SCENE, TRUTH, 3, seed=1)
    alone = make.demonstration(SCENE.lattice.grid, push[0].cells, number=7)
    return [
        *push,
        replace(push[0], id="p1/4", condition=Condition.JOYSTICK),
        replace(push[0], id="p1/5", set="obstacle course"),
        replace(push[1], id="p2/1", participant="p2"),
        alone,
    ]


def test_only_groups_that_were_learnt_from_are_ranked_and_people_held_out_by_themselves():
    trials = groups_of_trials()
    trained = Trained(frozenset(["p1/1", "p1/2"]), frozenset(["p1"]), frozenset(["force"]))
    found = ranking(trials, TRUTH, trained, 20, np.random.default_rng(0))
    assert [one.id for one in found.ranks] == ["p1/1", "p1/2", "p1/3", "p2/1"]
    assert found.not_ranked == {"force, no people": 1, "force, obstacle course": 1, "joystick": 1}
    assert [(one.name, len(one.ranks)) for one in by_group_and_training(found.ranks)] == [
        ("force", 3),
        ("force, held out", 1),
    ]
    assert rank_lines(Ranking((), found.not_ranked))[-1].startswith(
        "not ranked, because the reward was not learnt from"
    )
    table = group_ranks_table(found.ranks)
    assert [row[:2] for row in table.rows] == [("force", 3), ("force, held out", 1)]


def test_where_training_is_unknown_groups_stay_apart():
    found = ranking(groups_of_trials(), TRUTH, None, 20, np.random.default_rng(0))
    assert [one.name for one in by_group_and_training(found.ranks)] == [
        "force",
        "joystick",
        "force, obstacle course",
        "force, no people",
    ]
    assert found.ranks[-1].distance_rank is None, "no people, no distance"


def test_nothing_like_what_was_learnt_from_is_refused():
    trained = Trained(frozenset(), frozenset(), frozenset(["force, cycle 2"]))
    with pytest.raises(DemonstrationError, match=r"^ranks: expected .* learnt from \(force, cycle 2\), found force / "):
        check_to_rank(groups_of_trials(), trained)


def test_a_demonstration_that_fits_badly_is_named_with_its_ranks():
    far = [
        [2, 10],
        *[[2, r] for r in range(11, 20)],
        *[[c, 20] for c in range(3, 37)],
        *[[37, r] for r in range(19, 9, -1)],
    ]
    one = make.demonstration(SCENE.lattice.grid, far, SCENE.people_m)
    ranks = tuple(ranks_of([one], TRUTH, 500, np.random.default_rng(0)))
    line, chance = rank_lines(Ranking(ranks, trained=Trained(frozenset(), frozenset(), frozenset(["force"]))))
    assert line.startswith("this reward fits p1/1 (force) badly: 0.")
    assert "% pass people nearer" in line
    assert chance == "by chance alone, at most 0.03 of 1 demonstration would fit as badly"
    other = Ranking(ranks, trained=Trained(frozenset(), frozenset(), frozenset(["joystick"])))
    assert rank_lines(other) == ["the reward was not learnt from force: ranks there do not show how well it fits"]
    assert other.bad == []
    *_, unknown = rank_lines(Ranking(ranks))
    assert unknown.startswith("it is unknown from which groups the reward was learnt: ")
