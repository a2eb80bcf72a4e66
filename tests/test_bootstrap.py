"""Fits of participants drawn anew."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from statistics import NormalDist

import factories as make
import numpy as np
import pytest
from executors import Here

from navirl_cli.errors import DemonstrationError
from navirl_cli.irl import bootstrap as module
from navirl_cli.irl.bootstrap import Bootstrap, bootstrap
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError, ValueStatus

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -4.0, -4.0, 3.0))
START = Reward.named({})


@pytest.fixture(scope="module")
def twelve():
    # Participants come mixed up in the list, not one after the other.
    demonstrations = make.by_participants(SCENE, TRUTH, 12, 6, seed=3)
    return evidence_of([demonstrations[i] for i in np.random.default_rng(1).permutation(72)])


@pytest.fixture(scope="module")
def found(twelve):
    return fit(twelve, START, 0.0)


@pytest.fixture
def counts(monkeypatch):
    """What every replicate was fitted to: how often each demonstration."""
    seen = []

    def watched(evidence, *args, **named):
        owners = np.concatenate([part.owner[part.number == 0] for part in evidence.scenes])
        seen.append(np.bincount(owners, minlength=evidence.count))
        return fit(evidence, *args, **named)

    monkeypatch.setattr(module, "fit", watched)
    return seen


def test_all_demonstrations_of_a_participant_are_drawn_together(twelve, found, counts):
    drawn = bootstrap(twelve, found, 12, 5, executor=Here())
    assert len(drawn.theta) == 12
    assert len(counts) == 12 + 12, "the draws, and for the acceleration all but one participant each"
    for count, left_out in zip(counts[12:], np.unique(twelve.participants), strict=True):
        assert (count == (np.array(twelve.participants) != left_out)).all()
    del counts[12:]
    names = np.array(twelve.participants)
    for count in counts:
        assert count.sum() == 72, "twelve participants of six demonstrations"
        for name in set(names):
            assert len(set(count[names == name].tolist())) == 1
    assert len({tuple(count) for count in counts}) == 12
    assert max(count.max() for count in counts) >= 3


def test_a_replicate_is_the_fit_to_the_drawn_participants(twelve, found, counts):
    drawn = bootstrap(twelve, found, 3, 5, executor=Here())
    for theta, count in zip(drawn.theta, counts[:3], strict=True):
        again = fit(twelve.repeated(count), START, 0.0)
        assert theta == pytest.approx(np.array(again.reward.theta), rel=1e-3, abs=1e-3)


def test_the_seed_decides_and_the_executor_does_not(twelve, found):
    here = bootstrap(twelve, found, 7, 11, executor=Here())
    assert (here.theta == bootstrap(twelve, found, 7, 11).theta).all()
    with ThreadPoolExecutor(2) as pool:
        assert (here.theta == bootstrap(twelve, found, 7, 11, executor=pool).theta).all()
    assert here.seed == 11
    assert not (here.theta[:, 0] == bootstrap(twelve, found, 7, 12, executor=Here()).theta[:, 0]).any()


def test_prior_regulariser_and_method_are_those_of_the_fit(twelve, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "fit", lambda *args, **named: asked.append((args, named)) or fit(*args, **named))
    found = fit(twelve, START, 0.7)
    bootstrap(twelve, found, 2, 0, executor=Here())
    for (_, start, l2), named in asked:
        assert (start, l2) == (found.reward, 0.7)
        assert named["prior"] is found.prior
        assert named["method"] is found.method


def test_its_errors_are_of_the_size_of_those_clustered_by_participant(twelve, found):
    drawn = bootstrap(twelve, found, 40, 1, executor=Here())
    assert drawn.failed == 0
    ratio = drawn.standard_errors / found.clustered_errors
    # Twelve participants, of whom eight differ in a draw: a factor, not digits.
    assert (ratio > 0.5).all()
    assert (ratio < 1.6).all()
    lower, upper = drawn.interval()
    assert (lower < found.reward.theta).all()
    assert (np.array(found.reward.theta) < upper).all()


def test_errors_and_intervals_are_those_of_the_replicates():
    theta = np.random.default_rng(0).normal(size=(200, 2))
    # Replicates centred on the estimate, and fits without one participant that are not skewed: plain percentiles.
    drawn = Bootstrap(theta, 0, 0, 0, np.median(theta, axis=0), np.array([[-1.0, -1.0], [0.0, 0.0], [1.0, 1.0]]))
    assert drawn.standard_errors == pytest.approx(np.sqrt(((theta - theta.mean(axis=0)) ** 2).sum(axis=0) / 199))
    lower, upper = drawn.interval(0.9)
    assert ((theta < lower).sum(axis=0) == 10).all()
    assert ((theta > upper).sum(axis=0) == 10).all()


def test_draws_without_a_fit_are_counted(twelve, found, monkeypatch):
    number = iter(range(100))

    def sometimes(*args, **named):
        if next(number) % 3 == 0:
            raise InfinitePartitionError(ValueStatus.INFINITE)
        return fit(*args, **named)

    monkeypatch.setattr(module, "fit", sometimes)
    drawn = bootstrap(twelve, found, 6, 0, executor=Here())
    assert (drawn.failed, len(drawn.theta)) == (2, 4)
    monkeypatch.setattr(module, "fit", lambda *_, **__: (_ for _ in ()).throw(DemonstrationError("none")))
    with pytest.raises(
        DemonstrationError,
        match=r"^`bootstrap`: fewer than two of 6 draws of participants gave a fit; add demonstrations$",
    ):
        bootstrap(twelve, found, 6, 0, executor=Here())


def test_draws_that_stopped_early_are_counted_and_kept(twelve, found, monkeypatch):
    from navirl_cli.irl import newton

    monkeypatch.setattr(newton, "MAX_ITERATIONS", 1)
    drawn = bootstrap(twelve, found, 4, 0, executor=Here())
    assert (drawn.stopped_early, drawn.failed, len(drawn.theta)) == (4, 0, 4)


def test_progress_counts_the_replicates(twelve, found):
    told = []
    bootstrap(twelve, found, 8, 0, executor=Here(), progress=lambda done, text: told.append((done, text)))
    assert told == [(4, ""), (8, "")]


def test_one_participant_cannot_be_drawn_from():
    evidence = evidence_of(make.by_participants(SCENE, TRUTH, 1, 3, seed=0))
    with pytest.raises(
        DemonstrationError,
        match="`bootstrap`: expected several participants, found only p01; add logs of",
    ):
        bootstrap(evidence, fit(evidence, START), 5, 0)


def test_a_participant_without_selected_steps_is_not_drawn(twelve):
    masks = [np.zeros(0, bool)] * twelve.count
    for part in twelve.scenes:
        for owner in np.unique(part.owner).tolist():
            masks[owner] = np.full(int((part.owner == owner).sum()), twelve.participants[owner] == "p01")
    alone = twelve.only(masks)
    with pytest.raises(DemonstrationError, match="expected several participants, found only p01"):
        bootstrap(alone, fit(alone, START), 8, 0, executor=Here())


def test_draws_that_do_not_identify_a_parameter_are_left_out_of_its_errors():
    # One of three participants meets somebody.
    alone = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4])
    met = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
    truth = Reward((-32.0, -4.0, -4.0, 3.0))
    demonstrations = [
        *(replace(one, participant="p01") for one in make.drawn(met, truth, 20, 1)),
        *make.by_participants(alone, truth, 3, 8, seed=2)[8:],
    ]
    evidence = evidence_of(demonstrations)
    found = bootstrap(evidence, fit(evidence, START), 12, 0, executor=Here())
    assert found.identified_draws[0] == len(found.theta) == 12
    assert 0 < found.identified_draws[2] < 12
    assert np.isnan(found.theta[:, 2]).sum() == 12 - found.identified_draws[2]
    assert found.accelerated.tolist() == [True, True, False, False], "without p01 nobody meets anybody"
    told = found.theta[np.isfinite(found.theta[:, 2]), 2]
    assert found.standard_errors[2] == pytest.approx(told.std(ddof=1))
    lower, upper = found.interval()[:, 2]
    assert told.min() <= lower < upper <= told.max()


def bca(theta, estimate, without_one, level):
    """The interval as Efron and Tibshirani write it (1993, Eqs. 14.10 to 14.15), parameter by parameter."""
    normal, ends = NormalDist(), []
    for column, value, own in zip(theta.T, estimate, without_one.T, strict=True):
        z0 = normal.inv_cdf(np.mean(column < value))
        away = own.mean() - own
        a = sum(away**3) / (6 * sum(away**2) ** 1.5)
        z = [z0 + normal.inv_cdf(share) for share in (0.5 - level / 2, 0.5 + level / 2)]
        ends.append([np.percentile(column, 100 * normal.cdf(z0 + one / (1 - a * one))) for one in z])
    return np.array(ends).T


def test_intervals_are_corrected_for_bias_and_acceleration():
    rng = np.random.default_rng(4)
    theta, alone = np.exp(rng.normal(size=(300, 2))), np.exp(rng.normal(size=(9, 2)))
    estimate = np.array([0.8, 1.4])
    drawn = Bootstrap(theta, 0, 0, 0, estimate, alone)
    assert drawn.interval(0.9) == pytest.approx(bca(theta, estimate, alone, 0.9))
    # Without every fit but one there is no acceleration.
    unknown = Bootstrap(theta, 0, 0, 0, estimate, np.where(alone == alone[0], np.nan, alone))
    even = np.array([[-1.0, -1.0], [1.0, 1.0]])
    assert unknown.interval() == pytest.approx(bca(theta, estimate, even, 0.95))


def test_an_estimate_outside_all_replicates_has_an_interval():
    theta = np.random.default_rng(0).normal(size=(50, 1))
    lower, upper = Bootstrap(theta, 0, 0, 0, np.array([9.0]), np.array([[0.0], [1.0]])).interval()
    assert theta.min() <= lower <= upper <= theta.max()


def test_few_participants_are_fitted_with_a_search_for_other_maxima(twelve, found, monkeypatch):
    asked = []

    def watched(evidence, *args, scan, **named):
        asked.append(scan)
        return fit(evidence, *args, scan=scan, **named)

    monkeypatch.setattr(module, "fit", watched)
    bootstrap(twelve, found, 2, 5, executor=Here())
    assert not any(asked)
    asked.clear()
    names = np.array(twelve.participants)
    three = twelve.repeated(np.isin(names, np.unique(names)[:3]).astype(int))
    bootstrap(three, fit(three, START, 0.0), 2, 5, executor=Here())
    assert asked == [True] * 5
