"""Intervals of all parameters: against brute force, closed forms, and where they are open."""

from dataclasses import replace
from math import sqrt

import factories as make
import numpy as np
import pytest

from navirl_cli.irl import ends as module
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.intervals import Ends, Errors, Intervals, Kind, default_kind, intervals, quantile
from navirl_cli.irl.objective import Objective
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -6.0, -4.0, 3.0))
START = Reward.named({})
NAMES = ["c0", "a_g", "a_p", "sigma_p"]


@pytest.fixture(scope="module")
def evidence():
    return evidence_of(make.drawn(SCENE, TRUTH, 500, seed=8))


@pytest.fixture(scope="module")
def found(evidence):
    return fit(evidence, START, 0.0)


def best_at(evidence, name, value):
    """The best log-likelihood with a parameter held, from several starts."""
    best = []
    for theta in (TRUTH.theta, (-60.0, -0.01, -1.0, 1.0), (-25.0, -2.0, -8.0, 0.1)):
        start = Reward.named({**dict(zip(NAMES, theta, strict=True)), name: value})
        best.append(fit(evidence, start, 0.0, fixed=(name,), scan=False).objective)
    return max(best)


@pytest.mark.parametrize("name", NAMES)
def test_the_ends_of_a_profile_are_where_the_best_likelihood_has_fallen(evidence, found, name):
    (only,) = intervals(evidence, found, Kind.PROFILE)
    assert (only.kind, only.errors, only.level) == (Kind.PROFILE, Errors.MODEL, 0.95)
    ends = next(one for one in only.ends if one.parameter == name)
    value = found.reward.theta[NAMES.index(name)]
    assert ends.lower < value < ends.upper
    for end in (ends.lower, ends.upper):
        assert best_at(evidence, name, end) - found.objective == pytest.approx(-1.9207, abs=0.003)


def test_an_end_takes_few_evaluations_of_the_likelihood(evidence, found, monkeypatch):
    made = []

    class Counted(Objective):
        @staticmethod
        def of(*given):
            made.append(Objective.of(*given))
            return made[-1]

    monkeypatch.setattr(module, "Objective", Counted)
    intervals(evidence, found, Kind.PROFILE)
    begun = sum(one.evaluations for one in made)
    made.clear()
    intervals(evidence, replace(found, scanned=()), Kind.PROFILE)
    assert len(found.scanned) > 8
    again = sum(one.evaluations for one in made)
    assert begun + 10 < again < 60, "8 ends and the profile; the scan of the fit spares a part"


def test_the_places_of_a_scan_without_the_regulariser_are_evaluated_already(evidence):
    regularised = fit(evidence, START, 0.5)
    here = Objective.of(evidence, regularised.reward, 0.5, None)
    plain = Objective.of(evidence, regularised.reward, 0.0, None)
    places = module._unregularised(regularised, here)
    assert len(places) > 8
    for place in places:
        there = plain(place.x)
        assert place.value == pytest.approx(there.value, abs=1e-9)
        assert place.gradient == pytest.approx(there.gradient, abs=1e-7)
        assert place.hessian == pytest.approx(there.hessian, rel=1e-9, abs=1e-7)


class Twin:
    """The best likelihood at a value of a parameter, by L-BFGS-B from a grid of decays and along a fine one."""

    def __init__(self, objective):
        self.objective = objective
        (self.decay, _), *_ = objective.scans()
        self.grid = np.geomspace(0.001, 1000, 25)

    def best(self, name=None, value=0.0):
        number = None if name is None else [p.name for p in self.objective.initial.parameters].index(name)
        if number is not None:
            value = value / float(self.objective.scale[number])
        start = self.objective.to_units(self.objective.initial.theta)
        costly = np.where(np.arange(len(start)) == 0, -5.0, start)  # has a policy, whatever the decay
        found = []
        for x0, grid in ((start, self.grid), (costly, self.grid[::-1])):
            x = x0
            for decay in grid if number != self.decay else (value,):
                x = self._climb(np.where(np.arange(len(x)) == self.decay, decay, x), {self.decay}, number, value)
                found.append(x)
        top = max(found, key=lambda one: self.objective.slope(one)[0])
        return float(self.objective.slope(self._climb(top, set(), number, value))[0])

    def _climb(self, x, held, number, value):
        from scipy.optimize import minimize

        low, high = (bound.copy() for bound in self.objective.bounds)
        x = x if number is None else np.where(np.arange(len(x)) == number, value, x)
        for j in held | ({number} - {None}):
            low[j] = high[j] = x[j]

        def downward(at):
            value, gradient = self.objective.slope(np.clip(at, low, high))
            return (1e6, gradient) if np.isinf(value) else (-value, -gradient)

        options = {"maxiter": 300, "ftol": 1e-10, "gtol": 1e-6}
        return minimize(downward, x, jac=True, bounds=np.stack([low, high], axis=1), options=options).x


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 5])
def test_ends_of_few_paths_against_a_grid_of_decays(seed):
    evidence = evidence_of(make.drawn(SCENE, TRUTH, 2, seed=seed))
    found = fit(evidence, START)
    (only,) = intervals(evidence, found, default_kind(found))
    assert only.kind is Kind.PROFILE
    twin = Twin(Objective.of(evidence, found.reward, 0.0, None))
    top = twin.best()
    for ends, parameter in zip(only.ends, found.reward.parameters, strict=True):
        for side, end, bound in ((-1, ends.lower, parameter.lower), (1, ends.upper, parameter.upper)):
            if end is None:
                assert np.isinf(bound) or twin.best(ends.parameter, bound) - top > -1.95
                continue
            fall = twin.best(ends.parameter, end) - top
            assert fall == pytest.approx(-1.9207, abs=0.03) or fall < -1e3, "or no policy exists beyond"
            beyond = min(max(end + side * 0.2 * abs(end), parameter.lower), parameter.upper)
            assert twin.best(ends.parameter, beyond) - top < -1.9207


def test_wald_intervals_are_estimate_and_error(evidence, found):
    (only,) = intervals(evidence, found, Kind.WALD)
    for ends, value, error in zip(only.ends, found.reward.theta, found.standard_errors, strict=True):
        assert (ends.lower, ends.upper) == pytest.approx((value - 1.959964 * error, value + 1.959964 * error))


def test_many_demonstrations_make_both_alike(evidence):
    many = evidence.repeated(np.full(evidence.count, 10))
    found = fit(many, START, 0.0)
    (profiles,), (wald,) = (intervals(many, found, kind) for kind in (Kind.PROFILE, Kind.WALD))
    for one, other, error in zip(profiles.ends, wald.ends, found.standard_errors, strict=True):
        assert (one.lower, one.upper) == pytest.approx((other.lower, other.upper), abs=0.25 * error)


def test_an_end_beyond_the_admissible_range_is_open_and_never_a_number(found):
    wide = replace(found, covariance=np.diag([1e12, 100.0, 1.0, 4.0]))
    (only,) = intervals(None, wide, Kind.WALD)
    c0, a_g, _, sigma_p = only.ends
    assert (c0.lower, c0.upper) == (None, None)
    assert (a_g.upper, sigma_p.lower) == (None, None)
    assert a_g.lower == pytest.approx(found.reward.theta[1] - 19.6, abs=1e-3)
    assert only.is_open
    assert default_kind(wide) is Kind.PROFILE, "where errors leave the range, the likelihood is asked"


def test_the_default_goes_by_the_number_of_demonstrations(found):
    assert default_kind(found) is Kind.WALD
    assert default_kind(replace(found, demonstrations=9)) is Kind.PROFILE
    assert default_kind(replace(found, on_bound=np.array([False, True, False, False]))) is Kind.PROFILE


def test_participants_widen_by_student_and_by_their_scatter(evidence, found):
    clustered = found.covariance * np.outer([2.0, 1.0, 3.0, 1.0], [2.0, 1.0, 3.0, 1.0])
    several = replace(found, clustered=clustered, participants=4)
    assert quantile(several, Errors.PARTICIPANT) == pytest.approx(3.182446)
    front, behind = intervals(evidence, several, Kind.WALD)
    assert (front.errors, behind.errors) == (Errors.PARTICIPANT, Errors.MODEL)
    for one, other, times in zip(front.ends[::2], behind.ends[::2], (2.0, 3.0), strict=True):
        assert (one.upper - one.lower) / (other.upper - other.lower) == pytest.approx(times * 3.182446 / 1.959964)
    front, _ = intervals(evidence, several, Kind.PROFILE)
    fall = best_at(evidence, "c0", front.ends[0].lower) - found.objective
    assert fall == pytest.approx(-(3.182446**2) / 2 * 4.0, rel=0.02)
    front, behind = intervals(evidence, replace(several, participants=2), Kind.WALD)
    assert (front.errors, behind.errors) == (Errors.PARTICIPANT, Errors.MODEL)
    assert (front.ends[0].upper - front.ends[0].lower) / 2 == pytest.approx(12.706205 * np.sqrt(clustered[0, 0]))


def test_a_scatter_that_is_too_small_by_chance_does_not_narrow_a_profile(evidence, found):
    several = replace(found, clustered=found.covariance / 100, participants=4)
    front, behind = intervals(evidence, several, Kind.PROFILE)
    assert front.ends[0].upper - front.ends[0].lower > behind.ends[0].upper - behind.ends[0].lower


def test_two_paths_leave_ends_open_whatever_the_small_regulariser():
    evidence = evidence_of(make.drawn(SCENE, TRUTH, 2, seed=3))
    for l2 in (0.0, 1e-3):
        (only,) = intervals(evidence, fit(evidence, START, l2), Kind.PROFILE)
        assert only.is_open
    (held,) = intervals(evidence, fit(evidence, START, 1.0), Kind.PROFILE)
    assert not any(one.lower is None for one in held.ends[:3]), "a larger regulariser is meant"


def test_a_parameter_on_its_bound_has_an_interval_on_one_side():
    # All paths follow the nominal path or both rims alike: a_g ends at 0.
    grid = make.open_grid(16, 9)
    rim = [[0, 4], [1, 5], [2, 6], [3, 7], *[[c, 8] for c in range(4, 12)], [12, 7], [13, 6], [14, 5], [15, 4]]
    mirror = [[c, 8 - r] for c, r in rim]
    evidence = evidence_of([make.demonstration(grid, rim), make.demonstration(grid, mirror, number=2)] * 5)
    found = fit(evidence, Reward((-50.0, -0.5), START.terms[:2]), l2=0.0)
    assert found.status is Status.ON_BOUND
    (only,) = intervals(evidence, found, default_kind(found))
    a_g = only.ends[1]
    assert a_g.upper is None
    assert -5.0 < a_g.lower < 0.0


def test_parameters_that_are_not_identified_have_no_interval():
    alone = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4])
    evidence = evidence_of(make.drawn(alone, TRUTH, 20, seed=3))
    found = fit(evidence, START)
    for kind in (Kind.PROFILE, Kind.WALD):
        (only,) = intervals(evidence, found, kind)
        assert [one.parameter for one in only.ends] == ["c0", "a_g"]
    assert intervals(evidence, found, Kind.NONE) == ()


def test_a_subtracted_bias_moves_the_ends(found):
    before = Intervals(Kind.WALD, Errors.MODEL, 0.95, (Ends("a_g", -2.0, -0.1), Ends("a_p", None, -1.0)))
    after = before.moved(replace(found, bias=np.array([0.0, -0.2, -0.5, 0.0])))
    assert after.ends == (Ends("a_g", -1.8, None), Ends("a_p", None, -0.5))
    assert before.moved(found) is before


def test_progress_names_the_parameters(evidence, found):
    told = []
    intervals(evidence, found, Kind.PROFILE, lambda done, name: told.append((done, name)))
    assert told == list(enumerate(NAMES, start=1))


def test_the_level_is_that_of_the_normal_distribution(found):
    assert quantile(found, Errors.MODEL) == pytest.approx(1.959964)
    assert sqrt(2 * 1.9207) == pytest.approx(quantile(found, Errors.MODEL), abs=1e-4)
