"""Properties of a policy's paths: one by one against plain geometry, and exact expectations against many paths."""

from itertools import pairwise

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.grid import moves_along
from navirl_cli.evaluation.metrics import area_between_m2, areas_m2, center_distance_m, path_length_m
from navirl_cli.evaluation.policy_paths import Steps
from navirl_cli.evaluation.segments import ZONES, segments
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward

PEOPLE = np.array([[2.05, 1.05], [3.0, 0.6]])
SCENE = make.scene_on(make.open_grid(40, 21), [2, 10], [37, 12], PEOPLE)
POLICY = policy_of(Reward((-40.0, -0.8, -4.0, 2.0)), SCENE)
STEPS = Steps.of(SCENE.lattice, PEOPLE, 0.25)
NOMINAL = SCENE.nominal_line_m()


@pytest.fixture(scope="module")
def drawn():
    return sample_paths(POLICY, SCENE.start, 10_000, np.random.default_rng(0))


@pytest.fixture(scope="module")
def values(drawn):
    return STEPS.measured(drawn, NOMINAL)


def line(drawn, number):
    return SCENE.lattice.xy_m[drawn.path(number)]


def test_drawn_paths_are_measured_as_lines(drawn, values):
    for number in range(200):
        one = line(drawn, number)
        assert values["length_m"][number] == pytest.approx(path_length_m(one))
        assert values["min_distance_m"][number] == pytest.approx(center_distance_m(one, PEOPLE) - 0.25)
        assert values["area_m2"][number] == pytest.approx(area_between_m2(one, NOMINAL), abs=1e-12)
        ways = [values[f"{name}_m"][number] for name, _ in ZONES]
        assert sum(ways) == pytest.approx(values["length_m"][number])


def test_turns_are_those_between_segments(drawn, values):
    for number in range(50):
        heading = np.arctan2(*np.diff(line(drawn, number), axis=0).T[::-1])
        turned = sum(abs((b - a + np.pi) % (2 * np.pi) - np.pi) for a, b in pairwise(heading))
        assert values["heading_rad"][number] == pytest.approx(turned)


def test_mean_distance_and_zones_against_a_fine_sampling(drawn, values):
    for number in range(10):
        one = line(drawn, number)
        fine = np.concatenate([a + (np.arange(2000)[:, None] + 0.5) / 2000 * (b - a) for a, b in pairwise(one)])
        weight = np.repeat(np.hypot(*np.diff(one, axis=0).T), 2000) / 2000
        distance = np.min([np.hypot(*(fine - person).T) for person in PEOPLE], axis=0) - 0.25
        assert values["mean_distance_m"][number] == pytest.approx(weight @ distance / weight.sum(), abs=2e-4)
        assert values["intimate_m"][number] == pytest.approx(weight[distance < 0.45].sum(), abs=0.02)


def test_exact_expectations_agree_with_many_paths(values):
    exact = STEPS.expected(POLICY, SCENE.start)
    errors = {name: own.std(ddof=1) / np.sqrt(len(own)) for name, own in values.items()}
    assert set(exact) == {"length_m", "heading_rad", "intimate_m", "personal_m", "social_m", "public_m"}
    for name, value in exact.items():
        assert abs(values[name].mean() - value) <= 4 * errors[name] + 1e-9, name


def test_moves_along_padded_paths(drawn):
    moves = moves_along(SCENE.lattice.cells[drawn.states])
    for number in range(20):
        path = drawn.path(number)
        own = moves[number, : len(path) - 1]
        assert (SCENE.lattice.neighbours[path[:-1], own] == path[1:]).all()
        assert (moves[number, len(path) - 1 :] == -1).all()


def test_many_areas_are_those_one_by_one():
    rng = np.random.default_rng(3)
    lines = np.cumsum(rng.normal(0.1, 0.3, (40, 30, 2)), axis=1)
    assert areas_m2(lines, NOMINAL) == pytest.approx([area_between_m2(one, NOMINAL) for one in lines])


def test_segments_by_hand():
    # Along y = 0.5 m past a person in the origin: the shell comes to 0.25 m, and the intimate zone (0.45 m from a
    # shell of 0.25 m: 0.7 m between centres) reaches to x = sqrt(0.49 - 0.25).
    found = segments(np.array([-4.0, 0.5]), np.array([4.0, 0.5]), np.zeros((1, 2)), 0.25)
    assert found.length_m == pytest.approx(8.0)
    assert found.least_m == pytest.approx(0.25)
    assert found.zones_m.sum() == pytest.approx(8.0)
    pieces = np.array([np.linspace(-4, 4, 801)[:-1], np.full(800, 0.5)]).T
    fine = segments(pieces, pieces + np.array([0.01, 0.0]), np.zeros((1, 2)), 0.25)
    assert fine.zones_m[:, 0].sum() == pytest.approx(2 * np.sqrt(0.49 - 0.25), abs=2e-3)
    x = np.linspace(-4, 4, 200_001)
    assert fine.distance_m2.sum() == pytest.approx(np.trapezoid(np.hypot(x, 0.5) - 0.25, x), rel=1e-4)
    oracle = oracles.distance_to_segment((0.0, 0.0), (-4.0, 0.5), (4.0, 0.5))[0]
    assert found.least_m == pytest.approx(oracle - 0.25)


def test_without_people_there_are_no_distances():
    steps = Steps.of(SCENE.lattice, np.zeros((0, 2)), 0.25)
    paths = sample_paths(POLICY, SCENE.start, 5, np.random.default_rng(0))
    values = steps.measured(paths, NOMINAL)
    assert np.isnan(values["min_distance_m"]).all()
    assert np.isnan(values["mean_distance_m"]).all()
    assert np.isnan(values["intimate_m"]).all()
    assert np.isfinite(values["area_m2"]).all()


def test_a_segment_of_no_length_is_a_point():
    found = segments(np.array([1.0, 0.0]), np.array([1.0, 0.0]), np.zeros((1, 2)), 0.2)
    assert (found.length_m, found.least_m) == (0.0, pytest.approx(0.8))
    assert found.zones_m.sum() == 0.0
