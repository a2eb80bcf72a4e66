"""Length, distance and area: closed forms and slow twins."""

from itertools import pairwise
from math import cos, pi, sin, sqrt

import numpy as np
import oracles
import pytest

from navirl_cli.evaluation.metrics import (
    METRICS,
    PathMetrics,
    area_between_m2,
    center_distance_m,
    path_length_m,
    path_metrics,
)

STRAIGHT = np.array([[0.0, 0.0], [4.0, 0.0]])
NOBODY = np.zeros((0, 2))


def wavy(seed, poses=60):
    rng = np.random.default_rng(seed)
    x = np.linspace(0, 6, poses)
    y = sum(rng.normal(0, 0.5) * np.sin(k * np.pi * x / 6) for k in (1, 2, 3))
    return np.stack([x, y], axis=1)


def test_a_square_detour():
    detour = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 0.0], [4.0, 0.0]])
    found = path_metrics(detour, STRAIGHT, np.array([[1.5, 0.4]]), 0.25)
    assert found.length_m == pytest.approx(6.0)
    assert found.area_m2 == pytest.approx(1.0)
    assert found.min_distance_m == pytest.approx(0.5 - 0.25)  # to the detour's sides at x = 1 and x = 2


def test_half_a_circle():
    angles = np.linspace(pi, 0, 2001)
    arc = np.stack([1 + np.cos(angles), np.sin(angles)], axis=1)
    found = path_metrics(arc, np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[1.0, 0.0]]), 0.0)
    assert found.length_m == pytest.approx(pi, rel=1e-6)
    assert found.area_m2 == pytest.approx(pi / 2, rel=1e-6)
    assert found.min_distance_m == pytest.approx(1.0, rel=1e-6)


def test_areas_on_both_sides_do_not_cancel():
    zigzag = np.array([[0.0, 0.0], [1.0, 1.0], [3.0, -1.0], [4.0, 0.0]])
    assert area_between_m2(zigzag, STRAIGHT) == pytest.approx(2.0)  # two triangles of base 2 and height 1
    x = np.linspace(0, 4, 4001)
    sine = np.stack([x, np.sin(2 * pi * x / 4)], axis=1)
    assert area_between_m2(sine, STRAIGHT) == pytest.approx(8 / pi, rel=1e-5)


def test_the_path_itself_has_no_area():
    line = wavy(0)
    assert area_between_m2(line, line) == pytest.approx(0.0, abs=1e-12)
    assert area_between_m2(line[:, :], line[[0, *range(60), 59]]) == pytest.approx(0.0, abs=1e-12)
    assert area_between_m2(STRAIGHT, STRAIGHT[::-1]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_area_against_a_fine_raster_and_an_integral(seed):
    one, other = wavy(seed), wavy(seed + 100)
    area = area_between_m2(one, other)
    assert area == pytest.approx(oracles.area_by_raster(one, other, 0.004), rel=5e-3)
    x = np.linspace(0, 6, 200_001)
    gap = np.abs(np.interp(x, *one.T) - np.interp(x, *other.T))
    assert area == pytest.approx(np.trapezoid(gap, x), rel=1e-6)
    assert area == pytest.approx(area_between_m2(other, one), rel=1e-9)


def test_lines_whose_ends_differ_are_joined():
    shifted = STRAIGHT + np.array([0.0, 0.5])
    assert area_between_m2(shifted, STRAIGHT) == pytest.approx(2.0)


@pytest.mark.parametrize("seed", range(6))
def test_length_and_distance_against_slow_twins(seed):
    line = wavy(seed)
    people = np.random.default_rng(seed).uniform([0, -1], [6, 1], (3, 2))
    assert path_length_m(line) == pytest.approx(oracles.length_by_steps(line), rel=1e-12)
    exact = min(
        oracles.distance_to_segment(tuple(person), tuple(a), tuple(b))[0]
        for person in people
        for a, b in pairwise(line)
    )
    assert center_distance_m(line, people) == pytest.approx(exact, rel=1e-12)
    assert center_distance_m(line, people) == pytest.approx(oracles.distance_by_sampling(line, people, 2000), abs=1e-4)


def test_a_person_between_two_poses_is_not_missed():
    sparse = np.array([[0.0, 0.3], [4.0, 0.3]])
    assert center_distance_m(sparse, np.array([[2.0, 0.0]])) == pytest.approx(0.3)
    # Beyond an end it is the distance to that end.
    assert center_distance_m(sparse, np.array([[5.0, 1.3]])) == pytest.approx(sqrt(2))


def test_the_nearest_of_several_people_counts_and_standing_still_does_not_hurt():
    line = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    assert center_distance_m(line, np.array([[0.0, 3.0], [0.5, -0.2], [9.0, 9.0]])) == pytest.approx(0.2)
    assert path_length_m(line) == pytest.approx(1.0)
    assert center_distance_m(line[:2], np.array([[3.0, 4.0]])) == pytest.approx(5.0)


def test_a_person_within_the_shell_gives_a_negative_distance():
    assert path_metrics(STRAIGHT, STRAIGHT, np.array([[2.0, 0.1]]), 0.25).min_distance_m == pytest.approx(-0.15)


def test_without_people_there_is_no_distance():
    found = path_metrics(STRAIGHT, STRAIGHT, NOBODY, 0.25)
    assert np.isnan(found.min_distance_m)
    assert found.length_m == 4.0


@pytest.mark.parametrize("angle", [0.3, 1.9, -2.4])
def test_turning_and_moving_the_world_changes_nothing(angle):
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    line, nominal, people = wavy(3), wavy(4), np.array([[2.0, 0.7]])
    there = [points @ turn.T + [30.0, -7.0] for points in (line, nominal, people)]
    before, after = path_metrics(line, nominal, people, 0.2), path_metrics(*there, 0.2)
    assert [after.length_m, after.min_distance_m, after.area_m2] == pytest.approx(
        [before.length_m, before.min_distance_m, before.area_m2], rel=1e-9
    )


def test_every_metric_of_the_table_is_measured():
    assert [metric.name for metric in METRICS] == list(PathMetrics.__dataclass_fields__)
