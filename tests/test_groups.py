"""Means over groups and over participants, and Student's interval."""

import numpy as np
import pytest
from scipy import stats

from navirl_cli.evaluation.compare import DRIVEN, ON_GRID
from navirl_cli.evaluation.groups import Measured, by_participant, mean_and_spread, student_half_width, summary_of


def row(participant, length, onset=np.nan, path_type=DRIVEN):
    missing = {path_type: {} if np.isfinite(onset) else {"onset_m": "never leaves"}}
    return Measured("", participant, "joystick", {path_type: {"length_m": length, "onset_m": onset}}, missing)


ROWS = [row("a", 1.0), row("a", 2.0, 0.5), row("b", 4.0), row("c", 7.0, path_type=ON_GRID)]


def test_participants_count_with_their_means():
    assert by_participant(ROWS, DRIVEN, "length_m") == {"a": 1.5, "b": 4.0}
    assert by_participant(ROWS, DRIVEN, "onset_m") == {"a": 0.5}
    assert by_participant(ROWS, ON_GRID, "length_m") == {"c": 7.0}
    assert by_participant(ROWS, DRIVEN, "area_m2") == {}


def test_mean_and_spread_of_few():
    assert mean_and_spread([1.0, 3.0, float("nan")]) == (2.0, pytest.approx(np.sqrt(2)))
    mean, spread = mean_and_spread([5.0])
    assert (mean, np.isnan(spread)) == (5.0, True)
    assert np.isnan(mean_and_spread([])).all()


@pytest.mark.parametrize("count", [2, 3, 13, 400])
def test_students_interval_is_that_of_scipy(count):
    values = np.random.default_rng(count).normal(2.0, 0.3, count)
    low, high = stats.t.interval(0.95, count - 1, values.mean(), stats.sem(values))
    assert student_half_width(values) == pytest.approx((high - low) / 2, rel=1e-12)
    assert student_half_width([*values, np.nan]) == student_half_width(values)


def test_one_value_has_no_interval():
    assert np.isnan(student_half_width([1.0]))
    assert np.isnan(student_half_width([]))


def test_a_summary_counts_paths_participants_and_values():
    found = summary_of("joystick", DRIVEN, ROWS)
    assert (found.count, found.participants) == (3, 2)
    assert found.missing == {"onset_m": {"never leaves": 2}}
    assert (found.count_of("length_m"), found.count_of("onset_m")) == (3, 1)
    assert found.mean["length_m"] == pytest.approx(7 / 3)
    assert found.half_interval["length_m"] == pytest.approx(student_half_width([1.5, 4.0]))
    assert np.isnan(found.half_interval["onset_m"])
