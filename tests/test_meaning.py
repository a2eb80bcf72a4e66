"""What parameters mean in metres: closed forms, and intervals that follow the covariance."""

from math import exp, log, sqrt

import numpy as np
import pytest

from navirl_cli.evaluation.meaning import (
    accepted_detour_m,
    beside_detour_m,
    drawn_rewards,
    half_distance_m,
    longer_path_odds,
    meanings,
    passing_penalty,
    tenth_distance_m,
)
from navirl_cli.irl.intervals import Ends, Errors, Intervals, Kind
from navirl_cli.irl.reward import Reward

THETA = {"c0": -54.0, "a_g": -0.9, "a_p": -4.9, "sigma_p": 1.7}
REWARD = Reward(tuple(THETA.values()))
COVARIANCE = np.diag([9.0, 0.04, 0.5, 0.04])


def test_half_and_tenth_of_personal_space():
    for distance, share in ((half_distance_m(THETA), 0.5), (tenth_distance_m(THETA), 0.1)):
        assert exp(-THETA["sigma_p"] * distance**2) == pytest.approx(share)


def test_the_penalty_of_passing_is_the_sum_over_the_steps():
    for distance in (0.3, 0.8):
        x = np.arange(-400, 400) * 0.1 + 0.03
        steps = THETA["a_p"] * np.exp(-THETA["sigma_p"] * (x**2 + distance**2))
        assert passing_penalty(THETA, distance, 0.1) == pytest.approx(steps.sum(), rel=1e-6)


def test_an_accepted_detour_costs_what_the_distance_gains():
    detour = accepted_detour_m(THETA, 0.7, 0.1)
    gain = passing_penalty(THETA, 0.8, 0.1) - passing_penalty(THETA, 0.7, 0.1)
    assert -THETA["c0"] * detour == pytest.approx(gain)
    assert detour > 0
    # A person who attracts buys no distance.
    assert accepted_detour_m({**THETA, "a_p": 2.0}, 0.7, 0.1) < 0


def test_longer_ways_and_ways_beside_the_path():
    assert longer_path_odds(THETA) == pytest.approx(exp(-5.4))
    # Ten steps of 10 cm at half a metre cost 10 a_g / 4.
    assert -THETA["c0"] * beside_detour_m(THETA, 0.1) == pytest.approx(10 * 0.9 * 0.25)


def test_intervals_follow_the_covariance():
    error = 0.2
    covariance = np.full((4, 4), np.nan)
    covariance[3, 3] = error**2
    found = {one.text.split(" at")[0]: one for one in meanings(REWARD, covariance, 0.1, 0.7, np.random.default_rng(0))}
    half = next(one for text, one in found.items() if "half" in text)
    # Half distance falls with sigma_p: the interval's ends are those of sigma_p, swapped.
    # The decay cannot be negative: its interval is one of its logarithm.
    assert half.lower == pytest.approx(sqrt(log(2) / (1.7 * exp(1.96 * error / 1.7))), rel=0.02)
    assert half.upper == pytest.approx(sqrt(log(2) / (1.7 * exp(-1.96 * error / 1.7))), rel=0.02)
    without = [one for text, one in found.items() if "personal-space" not in text and "tenth" not in text]
    assert len(without) >= 2
    tenth = next(one for text, one in found.items() if "tenth" in text)
    assert tenth.lower / half.lower == pytest.approx(sqrt(log(10) / log(2)), rel=1e-6)
    odds = next(one for text, one in found.items() if "longer" in text)
    assert np.isnan([odds.lower, odds.upper]).all()


def test_the_same_seed_gives_the_same_intervals_and_without_people_there_is_no_detour():
    covariance = np.diag([9.0, 0.04, 0.5, 0.04])
    one, two = (meanings(REWARD, covariance, 0.1, 0.7, np.random.default_rng(3)) for _ in range(2))
    assert one == two
    assert len(meanings(REWARD, covariance, 0.1, float("nan"), np.random.default_rng(3))) == len(one) - 1


def interval_of(**ends):
    return Intervals(Kind.PROFILE, Errors.MODEL, 0.95, tuple(Ends(name, *pair) for name, pair in ends.items()))


ENDS = {"c0": (-60.0, -48.0), "a_g": (-1.5, -0.4), "a_p": (-9.0, -3.0), "sigma_p": (0.9, 4.0)}


def meant(intervals, covariance=COVARIANCE):
    found = meanings(REWARD, covariance, 0.1, 0.7, np.random.default_rng(1), intervals)
    half, tenth, odds, beside, detour = found
    return {"half": half, "tenth": tenth, "odds": odds, "beside": beside, "detour": detour}


def test_quantities_of_one_parameter_have_exactly_its_interval():
    found = meant(interval_of(**ENDS))
    for name, share in (("half", 2), ("tenth", 10)):
        ends = found[name].lower, found[name].upper
        assert ends == pytest.approx([sqrt(log(share) / 4.0), sqrt(log(share) / 0.9)], rel=0.03)
    assert (found["odds"].lower, found["odds"].upper) == pytest.approx((exp(-6.0), exp(-4.8)), rel=0.05)


def test_correlated_parameters_that_cancel_leave_a_narrow_quantity():
    # c0 and a_g that move together leave their ratio, the detour, where it is.
    errors = np.array([3.0, 0.2, 0.5, 0.2])
    together = np.eye(4)
    together[0, 1] = together[1, 0] = 0.999
    apart = together * np.where(np.eye(4) == 1, 1.0, -1.0)
    ends = {**ENDS, "c0": (-108.0, -27.0), "a_g": (-1.8, -0.45)}
    narrow, wide = (meant(interval_of(**ends), one * np.outer(errors, errors))["beside"] for one in (together, apart))
    assert narrow.upper / narrow.lower < 1.1
    assert wide.upper / wide.lower == pytest.approx(16.0, rel=0.1)


def test_open_ends_stay_open_and_no_effect_is_an_end():
    found = meant(interval_of(**{**ENDS, "a_p": (None, -3.0), "sigma_p": (None, 4.0), "a_g": (-1.5, None)}))
    assert found["half"].upper == np.inf
    assert found["half"].lower == pytest.approx(sqrt(log(2) / 4.0), rel=0.03)
    assert found["detour"].upper == np.inf
    assert found["beside"].lower == pytest.approx(0.0, abs=3e-3)
    assert np.isfinite(found["beside"].upper)


def test_all_draws_lie_within_the_bounds():
    wild = np.diag([9.0, 0.04, 0.5, 100.0])
    for one in meanings(REWARD, wild, 0.1, 0.7, np.random.default_rng(1)):
        assert np.isfinite([one.lower, one.upper]).all()


def test_drawn_rewards_have_the_intervals_of_the_estimate_and_there_are_none_where_one_is_open():
    def drawn(intervals):
        return drawn_rewards(REWARD, COVARIANCE, intervals, 4000, np.random.default_rng(0))

    edges = np.quantile([one.theta for one in drawn(interval_of(**ENDS))], [0.025, 0.975], axis=0)
    np.testing.assert_allclose(edges.T, list(ENDS.values()), rtol=0.04)
    assert drawn(interval_of(**ENDS | {"a_p": (None, -3.0)})) == []
    assert len(drawn(None)) == 4000
