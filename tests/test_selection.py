"""Which demonstrations and steps a reward is learnt from."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.demonstration import Condition, Contact
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.selection import Steps, common_resolution_m, select

GRID = make.open_grid(8, 4)
CELLS = [[0, 1], [1, 1], [2, 2], [3, 2]]


def trial(number, **fields):
    return make.demonstration(GRID, CELLS, number=number, **fields)


PUSHED = trial(1, cycle=2, contacts=(Contact(0.2, 0.4, 5.0, (0.0, 1.0)),), force_n=np.zeros((4, 2)))
LEFT_ALONE = trial(2, cycle=1, corrected=False)
STICK = trial(3, cycle=2, condition=Condition.JOYSTICK)
UNKNOWN = trial(4, corrected=None, contacts=None)
ALL = (PUSHED, LEFT_ALONE, STICK)


@pytest.mark.parametrize(
    ("choice", "expected"),
    [
        ({}, ALL),
        ({"subset": Subset(("force",))}, (PUSHED, LEFT_ALONE)),
        ({"subset": Subset(("force", "joystick"), (2,))}, (PUSHED, STICK)),
        ({"only_corrected": True}, (PUSHED, STICK)),
        ({"steps": Steps.CONTACT}, (PUSHED,)),
    ],
)
def test_the_requested_demonstrations_are_selected(choice, expected):
    found = select(ALL, **choice)
    assert [one.id for one in found.demonstrations] == [one.id for one in expected]
    assert found.resolution_m == 0.1
    assert found.evidence.count == len(expected)


def test_steps_in_contact_are_fewer_than_all_steps():
    assert select([PUSHED]).evidence.steps == 3
    assert select([PUSHED], steps=Steps.CONTACT).evidence.steps == 2


def test_an_unknown_intervention_is_not_treated_as_no_intervention():
    with pytest.raises(
        DemonstrationError, match=r"^`only_corrected`: expected demonstrations with a wrench, found p1/4"
    ):
        select([PUSHED, UNKNOWN], only_corrected=True)
    select([PUSHED, UNKNOWN])


def test_an_empty_selection_is_refused():
    with pytest.raises(DemonstrationError, match=r"^`cycle`: expected one of '1', .*found '7'"):
        select(ALL, Subset(("force",), (7,)))
    with pytest.raises(
        DemonstrationError, match=r"^`condition` and `cycle`: expected one of 'f.* found 'joystick, cycle 1'"
    ):
        select(ALL, Subset(("joystick",), (1,)), steps=Steps.CONTACT)
    with pytest.raises(DemonstrationError, match=r"^`only_corrected`: the person intervened in none of the demonstr"):
        select([LEFT_ALONE], only_corrected=True)
    with pytest.raises(DemonstrationError, match=r"^no demonstration to learn from"):
        select([])
    with pytest.raises(DemonstrationError, match=r"^`steps` contact: none of the demonstrations holds a contact"):
        select([LEFT_ALONE], steps=Steps.CONTACT)


def test_cells_of_different_size_are_not_learnt_from_together():
    coarse = make.demonstration(replace(make.open_grid(4, 4), resolution_m=0.2), CELLS, number=5)
    with pytest.raises(DemonstrationError, match=r"expected cells of one size, found 0\.1, 0\.2 m.*one `resolution`"):
        select([PUSHED, coarse])
    assert common_resolution_m([coarse]) == 0.2
