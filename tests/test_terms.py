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
    return np.broadcast_to(array, (scene.lattice.size, 8))


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
    assert slopes(theta) == pytest.approx(oracles.derivative(value, theta), rel=1e-7, abs=1e-9)
    bends = oracles.derivative(slopes, theta)
    for j in range(len(theta)):
        for k in range(len(theta)):
            second = spread(scene, jet.second.get((min(j, k), max(j, k)), np.zeros((1, 1))))
            assert second == pytest.approx(bends[..., j, k], rel=1e-7, abs=1e-9)


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


def test_every_file_of_terms_is_named_and_no_parameter_twice():
    files = {path.stem for path in Path(terms.__file__).parent.glob("*.py")} - {"__init__", "term"}
    assert {type(term).__module__.rpartition(".")[2]: name for name, term in TERMS.items()} == {
        name: name for name in files
    }
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
    assert terms_with(["c0", "a_p", "sigma_p"]) == (TERMS["step_length"], TERMS["personal_space"])
    for names in (["c0", "c0"], ["a_p"], ["sigma_p", "a_p"], ["c0", "c1"]):
        with pytest.raises(RewardError, match=r"known terms \(c0; a_g; a_p, sigma_p.*\), found " + ", ".join(names)):
            terms_with(names)


def test_a_reward_with_a_new_term_is_fitted_written_and_read_back(tmp_path, monkeypatch):
    monkeypatch.setitem(TERMS, "egg", Egg())
    scene = make.scene_on(make.open_grid(12, 8), [0, 3], [11, 4], [[0.6, 0.6]])
    start = Reward.named({}, (TERMS["step_length"], TERMS["egg"]))
    demonstrations = make.drawn(scene, start, 5, seed=2)
    found = fit(evidence_of(demonstrations), start)
    path = tmp_path / "reward.json"
    write_json(path, "reward", reward_document(found, demonstrations, [], 0.1), force=False)
    assert read_reward(path).reward == found.reward
    assert [parameter.name for parameter in found.reward.parameters] == ["c0", "a_e", "s_x", "s_y"]
