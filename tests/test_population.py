"""People who differ: the typical reward, how people are scattered, and each person."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest

from navirl_cli.errors import ArgumentError, DemonstrationError
from navirl_cli.irl.analyses import Pool, Questions
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.log_scale import LogScale, Witness, companies
from navirl_cli.irl.newcomer import Others, newcomer
from navirl_cli.irl.population import population
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps
from navirl_cli.irl.spread import Spread
from navirl_cli.irl.status import Status
from navirl_cli.parallel import Local

TRUTH = np.array([-40.0, -2.0, -5.0, 2.0])
SCATTER = 0.25
REWARD = Reward(tuple(TRUTH))


def people(count, each=2, seed=1):
    """Demonstrations of people whose parameters are scattered in a small room."""
    rng = np.random.default_rng(seed)
    scene = make.scene_on(make.open_grid(20, 12), (1, 6), (18, 6), [(1.0, 0.6)])
    found = []
    for number in range(count):
        own = Reward(tuple(TRUTH * np.exp(SCATTER * rng.standard_normal(4))))
        found += [
            replace(one, participant=f"p{number}", id=f"p{number}/{k}")
            for k, one in enumerate(make.drawn(scene, own, each, int(rng.integers(2**31))))
        ]
    return found


@pytest.fixture(scope="module")
def found():
    evidence = evidence_of(people(6))
    pooled = fit(evidence, Reward.named({}))
    return evidence, pooled, *population(evidence, pooled, executor=Local(1))


def test_population_has_a_typical_reward_and_one_for_each_person(found):
    _, pooled, typical, people_found, intervals = found
    assert typical.status is Status.CONVERGED
    assert [one.name for one in people_found.persons] == [f"p{k}" for k in range(6)]
    assert all(one.steps > 0 and len(one.owners) == 2 for one in people_found.persons)
    assert people_found.log_likelihood > people_found.log_likelihood_alike - 5
    for ends, value, truth in zip(intervals.ends, typical.reward.theta, TRUTH, strict=True):
        assert ends.lower < value < ends.upper
        error = np.log(ends.upper / ends.lower) / 3.92
        assert abs(np.log(value / truth)) < 3 * abs(error)
    assert not np.allclose(typical.reward.theta, pooled.reward.theta, rtol=1e-3)


def test_draws_of_everybody_count(found):
    assert all(one.effective > 40 for one in found[3].persons)


def test_a_person_explains_the_own_steps_better_than_the_typical_one(found):
    evidence, _, typical, known, _ = found
    gains = []
    for one in known.persons:
        own = evidence.repeated(np.array([name == one.name for name in evidence.participants], dtype=int))
        assert one.log_likelihood == pytest.approx(log_likelihood(own, one.reward))
        assert one.log_likelihood_typical == pytest.approx(log_likelihood(own, typical.reward))
        gains.append(one.log_likelihood - one.log_likelihood_typical)
    assert sum(gains) > 0


def test_a_newcomer_without_scatter_is_the_typical_person(found):
    evidence, _, typical, known, _ = found
    _, own = evidence.apart("p3")
    none = Others(known.scale, Spread(known.mean, np.full(4, 1e-4)))
    wide = Others(known.scale, Spread(known.mean, np.sqrt(np.diag(known.prediction()))))
    alike, _ = newcomer(own, none, "new", fit(own, typical.reward, prior=none.prior()))
    assert np.allclose(alike.reward.theta, typical.reward.theta, rtol=1e-3)
    fitted, ends = newcomer(own, wide, "new")
    assert fitted.log_likelihood > alike.log_likelihood
    assert all(one.lower < value < one.upper for one, value in zip(ends.ends, fitted.reward.theta, strict=True))


def test_one_person_is_no_population():
    evidence = evidence_of(people(1))
    with pytest.raises(DemonstrationError, match="`pool`: expected several participants, found only p0"):
        population(evidence, fit(evidence, Reward.named({})))


def test_what_only_a_pooled_fit_answers_is_refused():
    for asked in ({"bootstrap": 10}, {"profiles": ("c0",)}, {"cross_validate": True}, {"correct_bias": True}):
        with pytest.raises(ArgumentError, match="`pool` persons has intervals of its own and no prior: leave out "):
            Questions(pool=Pool.PERSONS, **asked).check_arguments(Steps.ALL, prior=False, l2=0.0)


def test_people_in_the_same_scenes_are_asked_together():
    small = make.scene_on(make.open_grid(9, 7), (1, 3), (7, 3), [(0.4, 0.3)])
    elsewhere = [replace(one, participant="p9", id=f"p9/{k}") for k, one in enumerate(make.drawn(small, REWARD, 2, 5))]
    evidence = evidence_of([*people(3), *elsewhere])
    scale = LogScale(REWARD, np.ones(4, dtype=bool))
    share = Prior.l2(REWARD.parameters, 0.01)
    alone = [Witness(name, evidence.apart(name)[1], scale, share) for name in evidence.people]
    groups = companies(evidence, alone)
    assert [one.members.tolist() for one in groups] == [[0, 1, 2], [3]]
    y = scale.of(REWARD) + 0.1
    assert np.concatenate([one.values(y) for one in groups]) == pytest.approx([one.value(y) for one in alone])
    assert (groups[0].values(y + 40) == -np.inf).all()
