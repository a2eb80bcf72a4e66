"""Profile likelihoods: against brute force, and where they are open or refused."""

from dataclasses import replace
from types import SimpleNamespace

import factories as make
import numpy as np
import pytest

from navirl_cli.errors import RewardError
from navirl_cli.irl import profile as module
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.profile import fall_at, profile
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -0.8, -4.0, 3.0))
START = Reward.named({})
NAMES = ("c0", "a_g", "a_p", "sigma_p")


@pytest.fixture(scope="module")
def evidence():
    return evidence_of(make.drawn(SCENE, TRUTH, 100, seed=8))


@pytest.fixture(scope="module")
def found(evidence):
    return fit(evidence, START, 0.0)


def brute(evidence, name, value, l2=0.0, prior=None):
    """The best objective with a parameter held, from several starts."""
    best = []
    for theta in (TRUTH.theta, (-60.0, -0.01, -1.0, 1.0), (-25.0, -2.0, -8.0, 6.0)):
        start = Reward.named({**dict(zip(NAMES, theta, strict=True)), name: value})
        best.append(fit(evidence, start, l2, prior=prior, fixed=(name,), scan=False).objective)
    return max(best)


@pytest.mark.parametrize(("level", "fall"), [(0.95, 1.9207), (0.6827, 0.5), (0.9545, 2.0), (0.9, 1.3528)])
def test_the_fall_is_half_the_quantile_of_chi_square(level, fall):
    assert fall_at(level) == pytest.approx(fall, abs=5e-4)


@pytest.mark.parametrize("name", NAMES)
def test_a_profile_is_the_best_of_the_others_at_every_value(evidence, found, name):
    followed = profile(evidence, found, name)
    j = NAMES.index(name)
    assert (np.diff(followed.values) > 0).all()
    assert followed.theta[:, j] == pytest.approx(followed.values, rel=1e-14)
    assert followed.relative.max() == 0.0
    assert followed.values[np.argmax(followed.relative)] == found.reward.theta[j]
    for relative, theta in zip(followed.relative, followed.theta, strict=True):
        assert log_likelihood(evidence, Reward(tuple(theta))) - found.objective == pytest.approx(relative, abs=1e-9)
    for value, relative in zip(followed.values[::3], followed.relative[::3], strict=True):
        assert brute(evidence, name, value) - found.objective == pytest.approx(relative, abs=1e-5)
    # It is drawn beyond the interval on both sides, or up to the bound.
    assert followed.threshold == pytest.approx(-1.9207, abs=1e-4)
    for end, value in ((0, found.reward.parameters[j].lower), (-1, found.reward.parameters[j].upper)):
        assert followed.relative[end] < -1.6 * 1.92 or followed.values[end] == value


@pytest.mark.parametrize("level", [0.6827, 0.95])
def test_the_ends_are_where_the_likelihood_has_fallen(evidence, found, level):
    followed = profile(evidence, found, "sigma_p", level)

    best, error = found.reward.theta[3], float(found.standard_errors[3])
    for side, end in ((-1, followed.lower), (1, followed.upper)):
        inside, outside = (
            brute(evidence, "sigma_p", end + side * away * error) - found.objective for away in (-0.02, 0.02)
        )
        assert inside > -fall_at(level) > outside
        assert side * (end - best) > 0
    assert (followed.name, followed.level) == ("sigma_p", level)
    # The decay of a bump that few paths touch is known worse upward than downward.
    assert followed.upper - best > 1.02 * (best - followed.lower)


def test_many_data_make_the_interval_that_of_the_standard_error(evidence):
    many = evidence.repeated(np.full(evidence.count, 12))
    found = fit(many, START, 0.0)
    for j, name in ((0, "c0"), (3, "sigma_p")):
        followed = profile(many, found, name)
        best, error = found.reward.theta[j], found.standard_errors[j]
        assert followed.lower == pytest.approx(best - 1.96 * error, abs=0.25 * error)
        assert followed.upper == pytest.approx(best + 1.96 * error, abs=0.25 * error)


def test_a_parabola_has_the_symmetrical_interval_of_its_curvature(evidence, found, monkeypatch):
    # In place of fits: an objective that falls as a parabola of the parameter and of nothing else.
    best, error = found.reward.theta[2], float(found.standard_errors[2])

    def parabola(_evidence, begin, *_, **__):
        fallen = -((begin.theta[2] - best) ** 2) / (2 * error**2)
        return SimpleNamespace(objective=found.objective + fallen, reward=begin)

    monkeypatch.setattr(module, "fit", parabola)
    followed = profile(evidence, found, "a_p")
    assert followed.lower == pytest.approx(best - 1.959964 * error, rel=1e-5)
    assert followed.upper == pytest.approx(best + 1.959964 * error, rel=1e-5)
    assert followed.values + followed.values[::-1] == pytest.approx(2 * best)
    assert followed.relative == pytest.approx(followed.relative[::-1])


def test_regulariser_and_prior_are_kept(evidence):
    prior = Prior.gaussian(np.array([-33.0, -1.0, -3.0, 2.0]), np.diag([4.0, 0.1, 0.2, 0.1]))
    found = fit(evidence, START, 0.5, prior=prior)
    followed = profile(evidence, found, "a_p")
    for value, relative in zip(followed.values[::4], followed.relative[::4], strict=True):
        assert brute(evidence, "a_p", value, 0.5, prior) - found.objective == pytest.approx(relative, abs=1e-5)
    alone = profile(evidence, fit(evidence, START, 0.0), "a_p")
    assert followed.upper - followed.lower < 0.9 * (alone.upper - alone.lower)


def test_where_the_data_set_no_bound_the_end_is_open():
    # On a corridor of one cell the likelihood only rises with the cost of length.
    grid = make.open_grid(12, 1)
    evidence = evidence_of([make.demonstration(grid, [[c, 0] for c in range(12)])] * 6)
    found = fit(evidence, Reward((-50.0,), START.terms[:1]), 0.0)
    told = replace(found, identified=np.array([True]))
    followed = profile(evidence, told, "c0")
    assert followed.lower is None
    # log p = -log of the partition function; it falls by 1.92 where c0 has left the best by so much upward.
    assert followed.upper is not None
    assert log_likelihood(evidence, Reward((followed.upper,), START.terms[:1])) == pytest.approx(-1.9207, abs=5e-3)


def test_a_parameter_on_its_bound_is_profiled_to_one_side():
    evidence = evidence_of(make.drawn(SCENE, Reward((-32.0, 0.0, -4.0, 3.0)), 40, seed=0))
    found = fit(evidence, START, 0.0)
    assert found.status is Status.ON_BOUND
    followed = profile(evidence, found, "a_g")
    assert followed.upper is None
    assert followed.values[-1] == 0.0
    assert brute(evidence, "a_g", followed.lower) - found.objective == pytest.approx(-fall_at(0.95), abs=5e-3)


def test_progress_gets_the_parameter_and_its_value(evidence, found):
    told = []
    followed = profile(evidence, found, "a_p", progress=lambda done, text: told.append((done, text)))
    assert [done for done, _ in told] == list(range(2, len(followed.values) + 1))
    assert all(text.startswith("a_p -") for _, text in told)


def test_an_unknown_parameter_is_refused(evidence, found):
    with pytest.raises(RewardError, match=r"^`profile`: expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'c9'"):
        profile(evidence, found, "c9")


def test_a_parameter_that_is_not_identified_is_not_profiled():
    nobody = make.scene_on(make.open_grid(12, 7), [0, 3], [11, 3])
    evidence = evidence_of(make.drawn(nobody, TRUTH, 20, seed=3))
    found = fit(evidence, START, 0.0)
    assert not found.identified[3]
    with pytest.raises(RewardError, match="`profile` sigma_p: the demonstrations do not identify this parameter; add"):
        profile(evidence, found, "sigma_p")


def test_a_better_fit_is_reported_with_its_parameters(evidence, found):
    # A fit that is none: its objective is lower than what the others reach without it.
    theta = (found.reward.theta[0] - 8.0, *found.reward.theta[1:])
    fake = replace(found, reward=Reward(theta), objective=log_likelihood(evidence, Reward(theta)))
    with pytest.raises(RewardError, match=r"`profile` c0: the profile found a better fit; fit again with `init` c0=-"):
        profile(evidence, fake, "c0")


@pytest.mark.parametrize("seed", [42, 68, 121])
def test_the_end_is_found_where_the_likelihood_falls_off_a_cliff_behind_it(seed):
    # Toward a decay of zero the space becomes the whole map: the fall is slow at first and without bound at last.
    scene = make.random_scene(np.random.default_rng(seed), 12, 9, 0.1, people=2)
    evidence = evidence_of(make.drawn(scene, Reward((-45.0, -2.0, -8.0, 5.6)), 8, seed=seed))
    found = fit(evidence, START)
    followed = profile(evidence, found, "sigma_p")
    relative = brute(evidence, "sigma_p", followed.lower, 1e-3) - found.objective
    assert relative == pytest.approx(-fall_at(0.95), rel=5e-3)
