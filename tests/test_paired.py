"""Paired comparisons by participant, against closed forms and enumeration."""

from itertools import product

import numpy as np
import pytest
from scipy import stats

from navirl_cli.evaluation.paired import FEWEST, TESTED, corrected, holm, paired


def compare(differences, seed=0):
    names = [f"p{k}" for k in range(len(differences))]
    other = dict.fromkeys(names, 10.0)
    one = {name: 10.0 + value for name, value in zip(names, differences, strict=True)}
    return paired(one, other, np.random.default_rng(seed))


def test_only_who_has_both_counts():
    found = paired(
        {"a": 3.0, "b": 1.0, "c": np.nan, "d": 5.0}, {"b": 4.0, "a": 1.0, "c": 2.0}, np.random.default_rng(0)
    )
    assert found.differences == {"a": 2.0, "b": -3.0}
    assert (found.n, found.mean) == (2, -0.5)
    assert np.isnan(found.bootstrap).all()


@pytest.mark.parametrize(
    "values",
    [
        np.array([0.3, -0.1, 0.5, 0.7, 1.1, -0.2]),
        np.array([0.25, 0.25, -0.25, 0.5, 0.5, 0.75]),  # ties
        np.array([0.5, 0.5, 0.5]),
    ],
)
def test_wilcoxons_p_value_is_that_of_all_signs(values):
    ranks = stats.rankdata(np.abs(values))
    plus = ranks[values > 0].sum()
    every = np.array([ranks[np.array(signs)].sum() for signs in product([False, True], repeat=len(values))])
    tail = min((every >= plus).mean(), (every <= plus).mean())
    found = compare(values)
    assert found.wilcoxon_p == pytest.approx(min(1.0, 2 * tail))
    assert found.rank_biserial == pytest.approx((plus - (ranks.sum() - plus)) / ranks.sum())


def test_effect_sizes_and_mean():
    values = np.array([0.2, 0.4, 0.1, 0.6, 0.3])
    found = compare(values)
    assert found.mean == pytest.approx(values.mean())
    assert found.cohen_dz == pytest.approx(values.mean() / values.std(ddof=1))
    assert found.rank_biserial == pytest.approx(1.0)
    assert compare(-values).rank_biserial == pytest.approx(-1.0)
    assert compare(-values).mean == pytest.approx(-values.mean())


def test_students_interval_and_the_effect_size_are_those_of_a_paired_t_test():
    rng = np.random.default_rng(3)
    one, other = rng.normal(1.0, 0.4, 9), rng.normal(0.7, 0.5, 9)
    names = [f"p{k}" for k in range(9)]
    found = paired(dict(zip(names, one, strict=True)), dict(zip(names, other, strict=True)))
    test = stats.ttest_rel(one, other)
    low, high = test.confidence_interval(0.95)
    assert (found.student.lower, found.student.upper) == pytest.approx((low, high))
    assert found.cohen_dz == pytest.approx(test.statistic / 3), "t is d_z times the root of n"


def test_the_interval_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(1)
    covered = 0
    for seed in range(120):
        found = compare(rng.normal(0.5, 1.0, 13), seed)
        covered += found.bootstrap.lower <= 0.5 <= found.bootstrap.upper
    # Bootstrap intervals of 13 pairs are a little short: 90 to 95 % for normal differences.
    assert 0.85 <= covered / 120 <= 0.99


@pytest.mark.parametrize("count", range(1, 5))
def test_few_pairs_have_no_interval(count):
    found = compare(np.linspace(0.1, 0.4, count))
    assert np.isfinite(found.bootstrap.lower) == (count >= FEWEST)
    assert np.isfinite(found.wilcoxon_p) == (count >= TESTED)


def test_pairs_that_do_not_differ():
    found = compare(np.zeros(5))
    assert (found.mean, found.bootstrap.lower, found.bootstrap.upper) == (0.0, 0.0, 0.0)
    assert np.isnan([found.wilcoxon_p, found.cohen_dz, found.rank_biserial]).all()
    empty = paired({}, {}, np.random.default_rng(0))
    assert empty.n == 0
    assert np.isnan([empty.mean, empty.wilcoxon_p]).all()


def test_the_same_seed_gives_the_same_interval():
    values = np.random.default_rng(2).normal(size=9)
    assert compare(values, 3) == compare(values, 3)
    assert compare(values, 3).bootstrap != compare(values, 4).bootstrap


def test_holms_correction_is_its_slow_twin():
    rng = np.random.default_rng(4)
    p = rng.uniform(0, 0.2, 12)
    p[3] = np.nan
    known = sorted((value, place) for place, value in enumerate(p) if np.isfinite(value))
    expected, least = np.full(12, np.nan), 0.0
    for number, (value, place) in enumerate(known):
        least = max(least, min(1.0, value * (len(known) - number)))
        expected[place] = least
    assert holm(p) == pytest.approx(expected, nan_ok=True)
    assert holm(np.array([0.01, 0.04, 0.03])) == pytest.approx([0.03, 0.06, 0.06])


def test_comparisons_that_are_no_tests_do_not_count_in_holms_family():
    rng = np.random.default_rng(6)
    tests = {f"m{k}": compare(rng.normal(0.8, 0.5, 8)) for k in range(5)}
    no_tests = {"one": compare([0.4]), "one of five": compare([0.0, 0.3, 0.0, 0.0, 0.0]), "equal": compare(np.zeros(6))}
    assert np.isnan([one.wilcoxon_p for one in no_tests.values()]).all()
    alone = corrected([("a", "b", tests)])[0][2]
    first, second = corrected([("a", "b", {**no_tests, **tests}), ("c", "b", no_tests)])
    assert {name: first[2][name].holm_p for name in tests} == {name: one.holm_p for name, one in alone.items()}
    assert np.isnan([found[2][name].holm_p for found in (first, second) for name in no_tests]).all()


def test_one_test_beside_comparisons_that_are_none_is_not_corrected():
    (found,) = corrected([("a", "b", {"test": compare([0.1, 0.2, 0.4]), "one": compare([0.4])})])
    assert [one.holm_p for one in found[2].values()] == [None, None]
