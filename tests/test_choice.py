"""Which demonstrations a command is about: chosen by the user, by a reward, or all."""

from dataclasses import replace
from pathlib import Path

import factories as make
import numpy as np
import pytest

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.rewards import reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import ArgumentError, DemonstrationError
from navirl_cli.evaluation.choice import choose
from navirl_cli.evaluation.groups import Trained
from navirl_cli.figures.overlay import driven
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward

GRID = make.open_grid(8, 4)
CELLS = [[0, 1], [1, 1], [2, 2], [3, 2]]


def trial(number, participant="p1", **fields):
    return make.demonstration(GRID, CELLS, number=number, participant=participant, **fields)


FIRST, SECOND = trial(1, cycle=1), trial(2, cycle=2)
STICK = trial(3, cycle=2, condition=Condition.JOYSTICK)
COURSE = trial(1, "p2", cycle=1, set="obstacles")
ALL = (FIRST, SECOND, STICK, COURSE)
#: Learnt from the pushes in the second cycle.
LEARNT = Trained(frozenset({SECOND.id}), frozenset({"p1"}), frozenset({"force, cycle 2"}))


@pytest.mark.parametrize(
    ("subset", "expected"),
    [
        (Subset(), ALL),
        (Subset(condition=("force", "joystick"), cycle=(2,)), (SECOND, STICK)),
        (Subset(cycle=(1, 2), participant=("p1",)), (FIRST, SECOND, STICK)),
        (Subset(set=("obstacles",)), (COURSE,)),
        (Subset(set=("main task",)), (FIRST, SECOND, STICK)),
        (Subset(trial=(STICK.id, FIRST.id)), (FIRST, STICK)),
    ],
)
def test_names_of_a_field_are_alternatives_and_fields_hold_at_once(subset, expected):
    assert subset.of(ALL) == list(expected)


@pytest.mark.parametrize(
    ("subset", "message"),
    [
        (Subset(cycle=(2, 7)), "^`cycle`: expected one of '1', '2', found '7'$"),
        (Subset(participant=("p3",)), "^`participant`: expected one of 'p1', 'p2', found 'p3'"),
        (Subset(set=("obstacle",)), "found 'obstacle'; did you mean 'obstacles'"),
        (Subset(trial=("p1/9",)), "^`trial`: expected one of 'p1/1', 'p1/2', 'p1/3', 'p2/1', found 'p1/9'"),
        (
            Subset(("joystick",), (1,)),
            "^`condition` and `cycle`: .* found 'joystick, cycle 1'",
        ),
    ],
)
def test_what_is_not_there_is_refused_with_what_is(subset, message):
    with pytest.raises(DemonstrationError, match=message):
        subset.of(ALL)


def test_a_reward_decides_unless_the_user_does():
    taken = choose(ALL, Subset(), [LEARNT])
    assert taken.demonstrations == (SECOND,)
    assert taken.note == ("1 of 4 demonstrations: those that the reward was learnt from; `all` takes the others too")
    both = choose(ALL, Subset(), [LEARNT], also=[STICK])
    assert both.demonstrations == (SECOND, STICK)
    assert "2 of 4 demonstrations: those that the reward was learnt from, and those to compare with;" in both.note
    for found in (
        choose(ALL, Subset(), [LEARNT], everything=True),
        choose(ALL, Subset(), [LEARNT, None]),  # of one it is unknown
        choose(ALL, Subset()),
    ):
        assert (found.demonstrations, found.note) == (ALL, "")
    chosen = choose(ALL, Subset(cycle=(1,)), [LEARNT])
    assert (chosen.demonstrations, chosen.note) == ((FIRST, COURSE), "")
    with pytest.raises(ArgumentError, match=r"^`all` takes all demonstrations; leave out `cycle`"):
        choose(ALL, Subset(cycle=(1,)), [LEARNT], everything=True)


def test_new_demonstrations_of_the_same_kind_stand_for_those_learnt_from():
    person = np.array([[0.3, 0.3]])
    new = [replace(one, id=f"new/{number}", people_m=person) for number, one in enumerate(ALL)]
    taken = choose(new, Subset(), [LEARNT])
    assert [one.id for one in taken.demonstrations] == ["new/1"]
    assert taken.note.startswith("1 of 4 demonstrations: new ones like those that the reward was learnt from;")
    other = choose([COURSE], Subset(), [LEARNT])
    assert other.demonstrations == (COURSE,)
    assert other.note == "no demonstration is like those that the reward was learnt from (force, cycle 2)"


def test_paths_over_a_scene_are_of_its_participant_and_the_others_are_counted():
    also, far = trial(4), replace(trial(5), grid=make.open_grid(9, 5))
    guest = trial(1, "p2")
    everyone = [FIRST, also, guest, far]
    shown, note = driven(everyone, FIRST)
    assert shown == [FIRST, also]
    assert note == (
        "`overlay` demos: 2 of 4 paths, those of p1 in the scene of p1/1; `overlay` all draws the others too"
    )
    assert driven([FIRST, also], FIRST) == ([FIRST, also], "")
    shown, note = driven(everyone, FIRST, everywhere=True)
    assert shown == [FIRST, also, guest]
    assert note == "`overlay` all: 1 path on other maps is left out"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("plot policy d.json --reward r.json -o a.png --samples 5", "--samples goes with --overlay samples."),
        ("plot properties d.json -o a.png --seed 5", "--seed goes with --reward."),
        ("plot properties d.json -o a.png --all", "--all goes with --reward."),
        ("evaluate d.json --precision 0.1", "--precision goes with --reward."),
    ],
)
def test_options_that_nothing_reads_are_refused(navirl, words, message):
    assert message in navirl(*words.split(), code=2).stderr


def test_the_scene_is_one_that_the_reward_was_learnt_from(navirl, tmp_path):
    write_json(tmp_path / "demos.json", "demonstrations", demonstrations_document(ALL, [], {}), force=False)
    found = fit(evidence_of([SECOND]), Reward.named({}), scan=False)
    write_json(tmp_path / "r.json", "reward", reward_document(found, [SECOND], [], 0.1), force=False)
    words = ("plan", "r.json", "--scene", "demos.json")
    assert (
        "scene of p1/2, the first of 1 of 4 demonstrations: those that the reward was learnt from; "
        "--all takes the others too, --trial another" in navirl(*words).stderr
    )
    for choice in (("--all",), ("--trial", "p1/1"), ("--cycle", "1")):
        assert "scene of" not in navirl(*words, *choice).stderr
    Path("navirl.toml").write_text("robot-radius = 0.4")
    assert "--robot-radius is that of the scene" in navirl(*words, "--all").stderr
    Path("navirl.toml").unlink()
    assert "--cycle goes with --scene DEMOS." in navirl("plan", "r.json", "--cycle", "2", code=2).stderr
    message = navirl(*words, "--cycle", "4", code=1).stderr
    assert "--cycle: expected one of '1', '2', found '4'" in message


def test_some_and_all_are_refused_by_every_command(navirl):
    for words in (["ranks"], ["properties"], ["compare", "--reward", "x.json"], ["policy"]):
        given = ["plot", *words, "demos.json", "--reward", "r.json", "--all", "--cycle", 1, "-o", "x.png"]
        assert "--all takes all demonstrations; leave out --cycle" in navirl(*given, code=2).stderr
