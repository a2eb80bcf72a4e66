"""The reach of people, the steps that it makes evidence, and what it does to a fit."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.demonstration import Condition, Contact, PersonTrack
from navirl_cli.demos.reach import Reach, centre_distances_m, reach_of, steps_within_reach
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.reach import reach_effect
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps, select
from navirl_cli.reports.evidence import evidence_remarks, reach_line, reach_unused, reach_warnings

GRID = make.open_grid(20, 9)
#: A straight path along the middle, and a person above its tenth cell.
STRAIGHT = [[column, 4] for column in range(20)]
PERSON = (1.05, 0.65)
PUSH = Contact(2.0, 2.3, 8.0, (0.0, 1.0))


def trial(number=1, **fields):
    return make.demonstration(GRID, STRAIGHT, [PERSON], number=number, **fields)


def test_the_reach_is_the_largest_distance_at_which_people_pushed():
    pushed = trial(contacts=(PUSH, Contact(3.0, 3.5, 5.0, (0.0, 1.0))))
    near = trial(2, contacts=(Contact(2.5, 2.5, 5.0, (0.0, 1.0)),))
    # 0.25 s a cell: at 2 s the robot is in cell 8, at 3.5 s in cell 14.
    assert reach_of([near, pushed]) == Reach(pytest.approx(np.hypot(0.4, 0.2)), "p1/1")
    assert reach_of([near]).reach_m == pytest.approx(0.2)
    for nobody in (trial(contacts=()), trial(contacts=None), make.demonstration(GRID, STRAIGHT, contacts=(PUSH,))):
        assert reach_of([nobody]) is None


def test_people_who_move_are_where_they_were():
    times = np.array([0.0, 4.0])
    track = PersonTrack("a", times, np.array([[0.0, 0.45], [2.0, 0.45]]))
    walking = trial(tracks=(track,))
    assert centre_distances_m(walking, np.array([0.0, 2.0, 4.0])) == pytest.approx([0.05, 0.15, 0.35])
    still = PersonTrack("a", np.zeros(0), np.zeros((0, 2)))
    at = np.linspace(0, 4, 9)
    assert centre_distances_m(trial(tracks=(still,)), at) == pytest.approx(centre_distances_m(trial(), at))


@pytest.mark.parametrize("reach_m", [0.1, 0.25, 0.5, 5.0])
def test_steps_within_reach_are_those_near_or_in_contact(reach_m):
    one = trial(contacts=(Contact(0.3, 0.6, 5.0, (0.0, 1.0)),))
    # slow and obvious: the robot leaves cell k at k / 4 s and enters the next a quarter of a second later
    expected = []
    for step in range(19):
        ends = [np.hypot(*(np.array(PERSON) - one.xy_m[k])) for k in (step, step + 1)]
        expected.append(min(ends) <= reach_m or ((step + 1) / 4 >= 0.3 and step / 4 <= 0.6))
    assert steps_within_reach(one, reach_m).tolist() == expected


def test_a_joystick_reaches_everywhere_and_unknown_contact_is_refused():
    assert steps_within_reach(trial(condition=Condition.JOYSTICK, contacts=None), 0.1).all()
    with pytest.raises(DemonstrationError, match="contact is unknown"):
        steps_within_reach(trial(contacts=None), 0.1)


def test_reachable_steps_are_selected_by_the_contacts_or_by_the_stated_reach():
    pushed, quiet = trial(contacts=(PUSH,)), trial(2, contacts=(), corrected=False)
    by_contacts = select([pushed, quiet], steps=Steps.REACHABLE)
    assert by_contacts.reach.seen_in == "p1/1"
    assert len(by_contacts.demonstrations) == 2, "a trial without a push, but within reach, shows acceptance"
    stated = select([pushed, quiet], steps=Steps.REACHABLE, reach_m=5.0)
    assert stated.reach == Reach(5.0)
    assert by_contacts.evidence.steps < stated.evidence.steps == 38
    assert select([pushed, quiet]).reach is None
    with pytest.raises(
        DemonstrationError, match=r"^`steps` reachable: expected contacts .* found none; state the reach"
    ):
        select([quiet], steps=Steps.REACHABLE)
    with pytest.raises(DemonstrationError, match=r"^`steps` reachable: none of the demonstrations holds a contact or"):
        select([quiet], steps=Steps.REACHABLE, reach_m=0.1)
    steered = trial(condition=Condition.JOYSTICK, contacts=())
    everywhere = select([steered], steps=Steps.REACHABLE)
    assert (everywhere.evidence.steps, everywhere.reach) == (19, None)


@pytest.fixture(scope="module")
def passes():
    """Paths of a wide space, of which only the middle is within reach: before and after the robot drives straight."""
    scene = make.scene_on(make.open_grid(40, 21), [2, 10], [37, 10], [[2.05, 1.05]])
    drawn = make.drawn(scene, Reward((-40.0, -0.5, -3.0, 2.0)), 8, seed=3)
    contact = Contact(3.0, 4.0, 8.0, (0.0, 1.0))
    return [replace(one, contacts=(contact,), force_n=np.zeros((len(one.t_s), 2))) for one in drawn]


def test_both_fits_are_compared_whichever_was_asked_for(passes):
    found = {}
    for steps in Steps:
        selected = select(passes, steps=steps)
        found[steps] = reach_effect(passes, fit(selected.evidence, Reward.named({})), steps)
    whole, contact, reachable = (found[steps] for steps in Steps)
    assert whole.steps_all == evidence_of(passes).steps > whole.steps_reachable > 0
    assert whole.reach == contact.reach == reachable.reach == reach_of(passes)
    for other in (contact, reachable):
        assert other.min_distance_all_m == pytest.approx(whole.min_distance_all_m, abs=0.01)
        assert other.min_distance_reachable_m == pytest.approx(whole.min_distance_reachable_m, abs=0.01)


def test_with_a_long_reach_nothing_differs(passes):
    effect = reach_effect(passes, fit(evidence_of(passes), Reward.named({})), Steps.ALL, 100.0)
    assert effect.steps_reachable == effect.steps_all
    assert effect.min_distance_reachable_m == effect.min_distance_all_m


def test_without_contacts_wrench_or_people_there_is_no_comparison(passes):
    found = fit(evidence_of(passes), Reward.named({}))
    for fields in ({"contacts": ()}, {"contacts": None, "force_n": None}, {"people_m": make.NOBODY}):
        assert reach_effect([replace(one, **fields) for one in passes], found, Steps.ALL) is None


def effect(whole, reachable):
    return {
        "reach": {
            "reach_m": 1.2,
            "seen_in": "p1/1",
            "steps_reachable": 30,
            "steps_all": 60,
            "min_distance_all_m": whole,
            "min_distance_reachable_m": reachable,
        }
    }


def test_a_difference_of_more_than_5_cm_is_a_warning_with_both_numbers():
    (line,) = reach_warnings(effect(0.41, 0.47))
    assert line.startswith("the policy passes people at 0.41 m if it is learnt from all steps, and at 0.47 m if it is")
    assert "(1.20 m between centres, the farthest push, in p1/1)" in line
    assert reach_warnings(effect(0.41, 0.45)) == reach_warnings({"reach": None}) == reach_warnings({}) == []
    assert reach_warnings(effect(0.41, None)) == [
        "the influence of the reach is unknown: a fit to steps within reach has no policy in a scene"
    ]
    (shown,) = reach_line(effect(0.41, 0.45))
    assert "in contact or within reach: 30 of 60 steps. Mean least distance of the policy, from" in shown.text
    assert reach_line({}) == []


def test_a_stated_reach_that_changes_nothing_is_reported():
    (line,) = reach_unused({"reach": None, "learnt_from": "all"}, 1.2)
    assert line.startswith("`reach` has no effect: contact is unknown, ")
    assert reach_unused({"reach": None, "learnt_from": "all"}, None) == []
    assert reach_unused({"reach": None, "learnt_from": "reachable"}, 1.2) == []
    assert reach_unused({**effect(0.4, 0.4), "learnt_from": "all"}, 1.2) == []


def test_without_a_wrench_distances_may_be_too_small():
    (line,) = evidence_remarks([trial(contacts=None), trial(2)], [])
    assert line.startswith("1 of 2 demonstrations has no wrench: where people pushed by hand, the learnt distances may")
    assert evidence_remarks([trial(contacts=None, condition=Condition.JOYSTICK), trial(2)], []) == []
