"""Terms of the reward: what holds of every one, so that a new term needs only its own file and its name in TERMS."""

import re
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module

import factories as make
import numpy as np
import pytest

from navirl_cli.irl.reward import PAPER_TERMS
from navirl_cli.irl.terms.term import Term


@pytest.fixture(scope="module")
def scene():
    return make.random_scene(np.random.default_rng(11), 9, 7, density=0.15, people=2)


def initial(term: Term) -> Sequence[float]:
    return [parameter.initial for parameter in term.parameters]


@pytest.mark.parametrize("term", PAPER_TERMS, ids=lambda term: type(term).__name__)
def test_terms_cite_the_equation_of_the_paper(scene, term):
    # Eq. 11: what leads to the goal (step length and deviation). Eq. 12: personal space. Eq. 13: their sum.
    alone = replace(scene, people_m=make.NOBODY)
    about_people = not np.array_equal(term.on(scene, initial(term)).value, term.on(alone, initial(term)).value)
    cited = re.findall(r"Eq\. (\d+)", import_module(type(term).__module__).__doc__)
    assert cited == (["12"] if about_people else ["11"])
