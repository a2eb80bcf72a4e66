"""Properties of a policy's paths: one by one against plain geometry, and exact expectations against many paths."""

from itertools import pairwise

import factories as make
import numpy as np
import oracles
import pytest
from path_values import line_values

from navirl_cli.demos.lines import path_length_m
from navirl_cli.evaluation.lines import area_between_m2, areas_m2, center_distance_m
from navirl_cli.evaluation.metrics import METRICS
from navirl_cli.evaluation.policy_paths import Nearness, PolicyLines, Steps, Visits
from navirl_cli.evaluation.segments import ZONES, Segments
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import SampledPaths, sample_paths
from navirl_cli.irl.reward import Reward

PEOPLE = np.array([[2.05, 1.05], [3.0, 0.6]])
SCENE = make.scene_on(make.open_grid(40, 21), [2, 10], [37, 12], PEOPLE)
POLICY = policy_of(Reward((-40.0, -0.8, -4.0, 2.0)), SCENE)
STEPS = Steps(SCENE.lattice, PEOPLE, 0.25)
NOMINAL = SCENE.nominal_line_m()


@pytest.fixture(scope="module")
def drawn():
    return sample_paths(POLICY, SCENE.start, 10_000, np.random.default_rng(0))


@pytest.fixture(scope="module")
def values(drawn):
    lines = PolicyLines.of(STEPS, drawn, NOMINAL)
    return {metric.name: metric.lines(lines) for metric in METRICS if metric.lines is not None}


def line(drawn, number):
    return SCENE.lattice.xy_m[drawn.path(number)]


def test_drawn_paths_are_measured_as_lines(drawn, values):
    for number in range(200):
        one = line(drawn, number)
        assert values["length_m"][number] == pytest.approx(path_length_m(one))
        assert values["min_distance_m"][number] == pytest.approx(center_distance_m(one, PEOPLE) - 0.25)
        assert values["area_m2"][number] == pytest.approx(area_between_m2(one, NOMINAL), abs=1e-12)
        lengths = [values[f"{name}_m"][number] for name, _ in ZONES]
        assert sum(lengths) == pytest.approx(values["length_m"][number])


def test_turns_are_those_between_Segments(drawn, values):
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


def test_drawn_and_driven_lines_are_measured_alike(drawn, values):
    few = range(0, 10_000, 500)
    # Steps are sampled more finely along diagonals than lines are.
    loose = {"mean_distance_m": 1e-3, "compliance": 0.01} | {f"{zone}_share": 0.01 for zone, _ in ZONES}
    loose |= {f"{zone}_m": 0.06 for zone, _ in ZONES}
    for number in few:
        found = line_values(line(drawn, number), NOMINAL, PEOPLE, 0.25)
        assert set(found) == set(values)
        for name, value in found.items():
            tolerance = loose.get(name, 1e-9)
            assert values[name][number] == pytest.approx(value, abs=tolerance, nan_ok=True), name


def test_exact_expectations_agree_with_many_paths(values):
    visits = Visits(STEPS, POLICY, SCENE.start)
    exact = {metric.name: metric.exact(visits) for metric in METRICS if metric.exact is not None}
    assert set(exact) == {"length_m", "heading_rad", "intimate_m", "personal_m", "social_m", "public_m"}
    for name, value in exact.items():
        error = values[name].std(ddof=1) / np.sqrt(len(values[name]))
        assert abs(values[name].mean() - value) <= 4 * error + 1e-9, name


def test_many_areas_are_those_one_by_one():
    rng = np.random.default_rng(3)
    lines = np.cumsum(rng.normal(0.1, 0.3, (40, 30, 2)), axis=1)
    assert areas_m2(lines, NOMINAL) == pytest.approx([area_between_m2(one, NOMINAL) for one in lines])


def test_segments_by_hand():
    # Along y = 0.5 m past a person in the origin: the shell comes to 0.25 m, and the intimate zone (0.45 m from a
    # shell of 0.25 m: 0.7 m between centres) reaches to x = sqrt(0.49 - 0.25).
    found = Segments(np.array([-4.0, 0.5]), np.array([4.0, 0.5]), np.zeros((1, 2)), 0.25)
    assert found.length_m == pytest.approx(8.0)
    assert found.least_m == pytest.approx(0.25)
    assert found.zones_m.sum() == pytest.approx(8.0)
    pieces = np.array([np.linspace(-4, 4, 801)[:-1], np.full(800, 0.5)]).T
    fine = Segments(pieces, pieces + np.array([0.01, 0.0]), np.zeros((1, 2)), 0.25)
    assert fine.zones_m[:, 0].sum() == pytest.approx(2 * np.sqrt(0.49 - 0.25), abs=2e-3)
    x = np.linspace(-4, 4, 200_001)
    assert fine.distance_m2.sum() == pytest.approx(np.trapezoid(np.hypot(x, 0.5) - 0.25, x), rel=1e-4)
    oracle = oracles.distance_to_segment((0.0, 0.0), (-4.0, 0.5), (4.0, 0.5))[0]
    assert found.least_m == pytest.approx(oracle - 0.25)


def test_without_people_there_are_no_distances():
    steps = Steps(SCENE.lattice, np.zeros((0, 2)), 0.25)
    lines = PolicyLines.of(steps, sample_paths(POLICY, SCENE.start, 5, np.random.default_rng(0)), NOMINAL)
    assert np.isnan(lines.min_distance_m).all()
    assert np.isnan(lines.mean_distance_m).all()
    assert np.isnan(lines.zones_m).all()
    assert np.isnan(Visits(steps, POLICY, SCENE.start).zones_m).all()
    assert np.isfinite(lines.area_m2).all()


def test_a_path_is_at_no_distance_from_itself_and_a_parallel_one_at_its_own():
    states = SCENE.lattice.states_of(np.array([[column, 10] for column in range(2, 38)]))
    paths = SampledPaths(states[None], np.array([len(states)]))
    same = Nearness(SCENE.lattice.xy_m[states], SCENE.lattice, paths)
    assert (same.to_learnt_m, same.from_learnt_m) == (pytest.approx([0.0]), pytest.approx([0.0]))
    beside = Nearness(SCENE.lattice.xy_m[states[:10]] + [0.0, 0.3], SCENE.lattice, paths)
    assert beside.to_learnt_m == pytest.approx([0.3])
    further = [0.3] * 10 + [np.hypot(0.3, 0.1 * k) for k in range(1, 27)]
    assert beside.from_learnt_m == pytest.approx([np.mean(further)])


def test_a_segment_of_no_length_is_a_point():
    found = Segments(np.array([1.0, 0.0]), np.array([1.0, 0.0]), np.zeros((1, 2)), 0.2)
    assert (found.length_m, found.least_m) == (0.0, pytest.approx(0.8))
    assert found.zones_m.sum() == 0.0
