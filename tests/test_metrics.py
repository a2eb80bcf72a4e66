"""Length, distance and area: closed forms and slow twins."""

import pickle
import re
from itertools import pairwise
from math import cos, pi, sin, sqrt

import numpy as np
import oracles
import pytest
from path_values import line_values

from navirl_cli.demos.lines import path_length_m
from navirl_cli.evaluation.lines import LEAVES_M, Lines, area_between_m2, areas_m2, center_distance_m, onset_m
from navirl_cli.evaluation.metric import Metric, Need, measure
from navirl_cli.evaluation.metrics import BY_NAME, METRICS, PAPER_METRICS

NOMINAL, PERSON = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([[6.0, 0.3]])
STRAIGHT = np.array([[0.0, 0.0], [4.0, 0.0]])
NO_PEOPLE = np.zeros((0, 2))


def wavy(seed, poses=60):
    rng = np.random.default_rng(seed)
    x = np.linspace(0, 6, poses)
    y = sum(rng.normal(0, 0.5) * np.sin(k * np.pi * x / 6) for k in (1, 2, 3))
    return np.stack([x, y], axis=1)


def test_a_square_detour():
    detour = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 0.0], [4.0, 0.0]])
    found = line_values(detour, STRAIGHT, np.array([[1.5, 0.4]]), 0.25)
    assert found["length_m"] == pytest.approx(6.0)
    assert found["area_m2"] == pytest.approx(1.0)
    assert found["min_distance_m"] == pytest.approx(0.5 - 0.25)  # to the detour's sides at x = 1 and x = 2


def test_half_a_circle():
    angles = np.linspace(pi, 0, 2001)
    arc = np.stack([1 + np.cos(angles), np.sin(angles)], axis=1)
    found = line_values(arc, np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[1.0, 0.0]]), 0.0)
    assert found["length_m"] == pytest.approx(pi, rel=1e-6)
    assert found["area_m2"] == pytest.approx(pi / 2, rel=1e-6)
    assert found["min_distance_m"] == pytest.approx(1.0, rel=1e-6)


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


@pytest.mark.parametrize("within", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_the_area_beside_a_straight_path_is_that_of_the_faces(seed, within):
    # A corner of a nanometre in the nominal path does not change the areas, but asks for the faces.
    rng = np.random.default_rng(seed)
    steps = rng.uniform([-0.05 if seed % 2 else 0.0, -0.2], [0.3, 0.2], (20, 40, 2))
    lines = np.cumsum(steps, axis=1) + np.array([0.1, 0.0])
    nominal = np.array([[0.0, 0.05], [lines[..., 0].max() + 0.1, 0.05]])
    if within:  # the paths begin and end on the line of a nominal path that is shorter than they are
        lines[:, [0, -1], 1] = 0.05
        nominal[:, 0] = 0.3, lines[:, -1, 0].min() - 0.1
    bent = np.insert(nominal, 1, nominal.mean(axis=0) + np.array([0.0, 1e-9]), axis=0)
    turn = np.array([[cos(0.3 * seed), -sin(0.3 * seed)], [sin(0.3 * seed), cos(0.3 * seed)]])
    found, expected = areas_m2(lines @ turn, nominal @ turn), areas_m2(lines @ turn, bent @ turn)
    assert found == pytest.approx(expected, abs=1e-7)


def test_a_path_that_starts_behind_the_nominal_path_or_passes_its_end_has_the_area_of_the_faces():
    line = np.array([[-1.0, 0.0], [-1.0, 1.0], [5.0, 1.0], [5.0, 0.0]])
    # The joins of the ends lie on the nominal line itself.
    assert area_between_m2(line, STRAIGHT) == pytest.approx(6.0)


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
    assert line_values(STRAIGHT, STRAIGHT, np.array([[2.0, 0.1]]), 0.25)["min_distance_m"] == pytest.approx(-0.15)


def test_without_people_there_is_no_distance():
    found = line_values(STRAIGHT, STRAIGHT, NO_PEOPLE, 0.25)
    assert np.isnan(found["min_distance_m"])
    assert found["length_m"] == 4.0


@pytest.mark.parametrize("angle", [0.3, 1.9, -2.4])
def test_values_do_not_depend_on_the_frame(angle):
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    line, nominal, people = wavy(3), wavy(4), np.array([[2.0, 0.7]])
    there = [points @ turn.T + [30.0, -7.0] for points in (line, nominal, people)]
    before, after = line_values(line, nominal, people, 0.2), line_values(*there, 0.2)
    assert [after["length_m"], after["min_distance_m"], after["area_m2"]] == pytest.approx(
        [before["length_m"], before["min_distance_m"], before["area_m2"]], rel=1e-9
    )


def test_names_are_unique_and_the_papers_come_first():
    assert len(BY_NAME) == len(METRICS)
    assert METRICS[:3] == PAPER_METRICS
    assert set(line_values(STRAIGHT, STRAIGHT, PERSON, 0.25)) == {one.name for one in METRICS if one.lines is not None}


def test_names_end_with_the_unit():
    symbols = {"1": "", "m": "_m", "m²": "_m2", "1/m": "_1_m", "m/s": "_m_s", "m/s²": "_m_s2", "m/s³": "_m_s3"}
    symbols |= {"N": "_n", "N s": "_n_s", "J": "_j", "s": "_s", "rad": "_rad"}
    for metric in METRICS:
        assert re.fullmatch("[a-z0-9_]+", metric.name)
        assert metric.name.endswith(symbols[metric.unit]), metric.name


def test_a_metric_is_computed_in_one_way():
    with pytest.raises(ValueError, match="metric both_m: needs exactly one of lines, drive and near"):
        Metric("both_m", "both", "m", "", lines=lambda lines: lines.length_m, drive=lambda drive: drive.duration_s)
    with pytest.raises(ValueError, match="metric neither_m: needs exactly one of"):
        Metric("neither_m", "neither", "m", "")


def test_a_metric_is_itself_after_pickling():
    assert all(pickle.loads(pickle.dumps(metric)) is metric for metric in METRICS)


def test_only_what_is_asked_for_is_computed():
    def fail(_):
        raise AssertionError("not asked for")

    costly = Metric("costly_m", "costly", "m", "", lines=fail)
    for_people = Metric("near_m", "near", "m", "", needs=(Need.PEOPLE,), lines=fail)
    lines = Lines(STRAIGHT[None], STRAIGHT, NO_PEOPLE, 0.25)
    values, missing = measure([BY_NAME["length_m"], for_people], lines, {Need.PEOPLE})
    assert values == pytest.approx({"length_m": 4.0, "near_m": np.nan}, nan_ok=True)
    assert missing == {"near_m": "no people in the scene"}
    with pytest.raises(AssertionError, match="not asked for"):
        measure([costly], lines, {Need.PEOPLE})


def test_a_value_that_does_not_exist_has_a_reason():
    lines = Lines(STRAIGHT[None], STRAIGHT, PERSON, 0.25)
    values, missing = measure([BY_NAME["onset_m"]], lines, set())
    assert np.isnan(values["onset_m"])
    assert missing == {"onset_m": "the path does not leave the nominal path by 0.15 m, or does not start on it"}
    # Neither a driven path's time nor distances to learnt paths are properties of a line.
    assert measure([BY_NAME["duration_s"], BY_NAME["hausdorff_m"]], lines, set()) == ({}, {})


def test_zones_shares_and_mean_distance_of_a_straight_line():
    # Past a person 0.5 m beside its middle, shell of 0.25 m: intimate below 0.7 m between centres, personal below 1.45.
    found = line_values(STRAIGHT, STRAIGHT, np.array([[2.0, 0.5]]), 0.25)
    near, far = 2 * sqrt(0.7**2 - 0.25), 2 * sqrt(1.45**2 - 0.25)
    assert found["intimate_m"] == pytest.approx(near, abs=0.01)
    assert found["personal_m"] == pytest.approx(far - near, abs=0.02)
    assert found["social_m"] == pytest.approx(4.0 - far, abs=0.01)
    assert found["public_m"] == 0.0
    assert found["intimate_share"] == pytest.approx(near / 4, abs=0.003)
    assert found["compliance"] == pytest.approx(1 - found["intimate_share"])
    x = np.linspace(-2, 2, 100_001)
    assert found["mean_distance_m"] == pytest.approx(np.trapezoid(np.hypot(x, 0.5), x) / 4 - 0.25, abs=1e-4)


def test_heading_changes_and_curvature():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 0.0], [4.0, 0.0]])
    found = line_values(square, STRAIGHT, NO_PEOPLE, 0.25)
    assert found["heading_rad"] == pytest.approx(4 * pi / 2)
    assert found["curvature_1_m"] == pytest.approx(4 * pi / 2 / 6)
    angles = np.linspace(pi, 0, 2001)
    arc = np.stack([1 + np.cos(angles), np.sin(angles)], axis=1)
    assert line_values(arc, STRAIGHT, NO_PEOPLE, 0.25)["heading_rad"] == pytest.approx(pi, rel=0.05)
    assert line_values(arc, STRAIGHT, NO_PEOPLE, 0.25)["curvature_1_m"] == pytest.approx(1.0, rel=0.05)


def test_shaking_in_place_is_no_heading_change():
    rng = np.random.default_rng(0)
    line = np.stack([np.linspace(0, 4, 400), rng.normal(0, 0.002, 400)], axis=1)
    assert line_values(line, STRAIGHT, NO_PEOPLE, 0.25)["heading_rad"] < 2.0
    standing = np.concatenate([line, line[-1] + rng.normal(0, 0.01, (300, 2))])
    assert line_values(standing, STRAIGHT, NO_PEOPLE, 0.25)["heading_rad"] < 3.0


def test_without_people_there_are_no_zones():
    found = line_values(STRAIGHT, STRAIGHT, NO_PEOPLE, 0.25)
    for name in ("mean_distance_m", "compliance", "intimate_m", "public_share"):
        assert np.isnan(found[name]), name


def test_the_onset_is_where_the_path_is_15_cm_off():
    # A line that rises by 0.1 m a metre from x = 2 m on is 15 cm off at 3.5 m.
    line = np.array([[0.0, 0.0], [2.0, 0.0], [7.0, 0.5], [10.0, 0.0]])
    assert onset_m(line, NOMINAL, PERSON) == pytest.approx(6.0 - 3.5)


@pytest.mark.parametrize("turn", [0.0, 1.1, 2.5])
def test_the_onset_knows_no_direction(turn):
    line = np.array([[0.0, 0.0], [2.0, 0.0], [7.0, -0.5], [10.0, 0.0]])
    cos, sin = np.cos(turn), np.sin(turn)
    turned = [part @ np.array([[cos, sin], [-sin, cos]]) + (3.0, -7.0) for part in (line, NOMINAL, PERSON)]
    assert onset_m(*turned) == pytest.approx(2.5)


def test_the_first_person_counts_and_the_onset_may_lie_behind():
    line = np.array([[0.0, 0.0], [2.0, 0.0], [7.0, 0.5], [10.0, 0.0]])
    assert onset_m(line, NOMINAL, np.array([[9.0, 1.0], [1.5, 0.0]])) == pytest.approx(1.5 - 3.5)


@pytest.mark.parametrize(
    ("line", "people"),
    [
        ([[0.0, 0.0], [5.0, LEAVES_M], [10.0, 0.0]], PERSON),  # never leaves
        ([[0.0, 0.4], [5.0, 0.4], [10.0, 0.0]], PERSON),  # starts away
        ([[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]], np.zeros((0, 2))),  # no people
    ],
)
def test_some_paths_have_no_onset(line, people):
    assert np.isnan(onset_m(np.array(line), NOMINAL, people))
