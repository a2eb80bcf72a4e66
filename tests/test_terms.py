"""Terms of the reward: what holds of each, so that a new term needs only its own file and its name in TERMS."""

import pickle
import re
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import factories as make
import numpy as np
import oracles
import pytest
from toy_term import Egg

from navirl_cli.artefacts.rewards import read_reward, reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.errors import RewardError
from navirl_cli.irl import terms
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward, parameters_of, terms_with
from navirl_cli.irl.terms import TERMS
from navirl_cli.irl.terms.term import Term

every_term = pytest.mark.parametrize("term", [*TERMS.values(), Egg()], ids=lambda term: type(term).__name__)


@pytest.fixture(scope="module")
def scene():
    return make.random_scene(np.random.default_rng(11), 9, 7, density=0.15, people=2)


def initial(term: Term) -> Sequence[float]:
    return [parameter.initial for parameter in term.parameters]


def spread(scene, array):
    """By cell, incoming move where it matters, and move."""
    return np.broadcast_to(array, (scene.lattice.size, *((9,) if array.ndim == 3 else ()), 8))


@every_term
@pytest.mark.parametrize("factor", [0.4, 1.0, 1.7])
def test_derivatives_of_every_term(scene, term, factor):
    theta = np.array(initial(term)) * factor
    jet = term.on(scene, theta)

    def value(at):
        return spread(scene, term.on(scene, at).value)

    def slopes(at):
        return np.stack([spread(scene, first) for first in term.on(scene, at).first], axis=-1)

    assert len(jet.first) == len(theta)
    np.testing.assert_allclose(slopes(theta), oracles.derivative(value, theta), rtol=1e-7, atol=1e-9)
    bends = oracles.derivative(slopes, theta)
    for j in range(len(theta)):
        for k in range(len(theta)):
            second = jet.second.get((min(j, k), max(j, k)), np.zeros((1,) * jet.value.ndim))
            np.testing.assert_allclose(spread(scene, second), bends[..., j, k], rtol=1e-7, atol=1e-9)


@every_term
def test_terms_say_whether_they_are_about_people(scene, term):
    alone = replace(scene, people_m=make.NOBODY)
    same = np.array_equal(term.on(scene, initial(term)).value, term.on(alone, initial(term)).value)
    assert same != term.about_people


@every_term
def test_terms_equal_their_copies(term):
    assert pickle.loads(pickle.dumps(term)) == term


@every_term
def test_starts_lie_within_the_bounds(term):
    for parameter in term.parameters:
        for start in (parameter.initial, *parameter.scan):
            assert parameter.lower <= start <= parameter.upper
        assert parameter.scale > 0


@every_term
def test_terms_say_whether_they_are_about_turns(scene, term):
    jet = term.on(scene, initial(term))
    arrays = [jet.value, *jet.first, *jet.second.values()]
    assert {array.ndim for array in arrays} == {3 if term.about_turns else 2}


@every_term
def test_given_the_scanned_parameters_a_term_is_linear_in_the_others(scene, term):
    jet = term.on(scene, initial(term))
    linear = {j for j, parameter in enumerate(term.parameters) if not parameter.scan}
    assert not [pair for pair in jet.second if set(pair) <= linear and np.any(jet.second[pair])]


@every_term
def test_formulas_name_their_parameters(term):
    for parameter in term.parameters:
        assert parameter.name in term.formula.replace("sigma_before|behind", "sigma_before sigma_behind")
    assert all(sentence.endswith(".") for sentence in term.symbols)


def test_every_file_of_terms_is_named_and_no_parameter_twice():
    files = {path.stem for path in Path(terms.__file__).parent.glob("*.py")} - {"__init__", "term", "registry"}
    assert sorted(type(term).__module__.rpartition(".")[2] for term in TERMS.values()) == sorted(files)
    assert {term.name: term for term in TERMS.values()} == TERMS
    names = [parameter.name for parameter in parameters_of(TERMS.values())]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", TERMS)
def test_terms_cite_a_source_and_the_right_equation_of_the_paper(name):
    # Eq. 11: what leads to the goal (step length and deviation). Eq. 12: personal space. Eq. 13: their sum.
    source = import_module(type(TERMS[name]).__module__).__doc__
    cited = re.findall(r"Eq\. (\d+)", source)
    assert cited or re.search(r"\d{4}", source), "cite an equation of the paper, or another source with its year"
    assert set(cited) <= ({"12"} if TERMS[name].about_people else {"11"})


def test_terms_are_found_by_the_names_of_their_parameters():
    assert terms_with(["c0", "a_p", "sigma_p"]) == (TERMS["length"], TERMS["personal-space"])
    for names in (["c0", "c0"], ["a_p"], ["sigma_p", "a_p"], ["c0", "c1"]):
        with pytest.raises(RewardError, match=r"known terms \(c0; a_g; a_p, sigma_p.*\), found " + ", ".join(names)):
            terms_with(names)


def test_a_reward_with_a_new_term_is_fitted_written_and_read_back(tmp_path):
    scene = make.scene_on(make.open_grid(12, 8), [0, 3], [11, 4], [[0.6, 0.6]])
    start = Reward.named({}, (TERMS["length"], Egg()))
    demonstrations = make.drawn(scene, start, 5, seed=2)
    found = fit(evidence_of(demonstrations), start)
    path = tmp_path / "reward.json"
    write_json(path, "reward", reward_document(found, demonstrations, [], 0.1), force=False)
    assert read_reward(path).reward == found.reward
    assert [parameter.name for parameter in found.reward.parameters] == ["c0", "a_e", "s_x", "s_y"]


# --- what the terms of the package are ------------------------------------------------------------------------------


def at(scene, name, *theta):
    return TERMS[name].on(scene, theta).value


def test_the_saturating_deviation_begins_as_the_quadratic_one_and_ends_at_its_bound(scene):
    narrow = at(scene, "saturating-deviation", -0.5, 1e-3)
    assert narrow == pytest.approx(at(scene, "deviation", -0.5e-3), rel=1e-3)
    assert at(scene, "saturating-deviation", -0.5, 1e3)[scene.deviation_m > 0.15] == pytest.approx(-0.5)
    assert (at(scene, "saturating-deviation", -0.5, 4.0)[scene.nominal] == 0).all()


def test_the_anisotropic_space_with_equal_widths_is_the_personal_space(scene):
    assert at(scene, "anisotropic-space", -4.0, 2.0, 2.0, 2.0) == pytest.approx(at(scene, "personal-space", -4.0, 2.0))


@pytest.mark.parametrize(("start", "goal"), [([0, 4], [12, 4]), ([12, 4], [0, 4]), ([6, 0], [6, 8]), ([1, 0], [9, 8])])
def test_before_a_person_is_where_the_robot_has_not_passed(start, goal):
    scene = make.scene_on(make.open_grid(13, 9), start, goal, [[0.65, 0.45]])
    along = np.subtract(goal, start) / np.hypot(*np.subtract(goal, start))
    assert scene.travel_past_people == pytest.approx(along[None])
    value = at(scene, "anisotropic-space", -4.0, 0.5, 8.0, 3.0)[:, 0]
    offset = scene.lattice.xy_m - scene.people_m[0]
    u, v = offset @ along, offset @ [-along[1], along[0]]
    assert value == pytest.approx(-4.0 * np.exp(-np.where(u < 0, 0.5, 8.0) * u**2 - 3.0 * v**2))


def test_directions_follow_a_nominal_path_around_a_corner():
    drawing = """
    ..........
    ..........
    ########..
    ########..
    ########..
    ########..
    """
    scene = make.scene_on(make.grid_of(drawing), [0, 5], [9, 0], [[0.25, 0.55], [0.95, 0.15]])
    first, second = scene.travel_past_people
    assert first[0] > 0.9
    assert second[1] < -0.9


def test_the_length_space_charges_a_metre(scene):
    value = at(scene, "length-space", -40.0, 2.0)
    assert value == pytest.approx(10 * at(scene, "personal-space", -4.0, 2.0) * scene.lattice.step_m)
    # The sum along a straight path past a person is the integral along it, whatever the size of the cells.
    sums = []
    for side in (0.1, 0.05, 0.02):
        columns = round(4 / side)
        grid = replace(make.open_grid(columns, 3), resolution_m=side)
        line = make.scene_on(grid, [0, 1], [columns - 1, 1], [[2.0, 1.5 * side]])
        row = line.lattice.states_of(np.array([[c, 1] for c in range(columns)]))
        sums.append(at(line, "length-space", -40.0, 2.0)[row, 0].sum())
    assert sums == pytest.approx([-40 * np.sqrt(np.pi / 2)] * 3, rel=1e-3)


def test_a_turn_is_90_degrees_or_more():
    sharp = TERMS["turn"].on(None, [-2.0]).value[0]
    for before in [*range(8), None]:
        for move in range(8):
            assert sharp[8 if before is None else before, move] == -2.0 * oracles.is_sharp(before, move)


def test_the_reward_of_a_cell_is_that_of_a_straight_step_without_what_moves_alone_cost(scene):
    terms = tuple(TERMS[name] for name in ("length", "personal-space", "length-space", "turn"))
    reward = Reward((-50.0, -4.0, 2.0, -30.0, 1.0, -1.0), terms)
    expected = at(scene, "personal-space", -4.0, 2.0)[:, 0] + at(scene, "length-space", -30.0, 1.0)[:, 0]
    assert reward.by_cell(scene) == pytest.approx(expected)
