"""Verdicts on the paper's claims, on numbers whose answers are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from navirl_cli.evaluation.compare import DRIVEN, LEARNT, ON_GRID
from navirl_cli.evaluation.groups import GroupMetrics, Measured
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.evaluation.paired import Paired, paired
from navirl_cli.study.claims import Claim, Difference, Verdict, claims_of, scatter_within

FORCE, JOYSTICK, REPLAY, AVOIDANCE = "force, cycle 2", "joystick", "replay of the learnt policy", "obstacle avoidance"


def values(*three):
    return dict(zip((metric.name for metric in PAPER_METRICS), three, strict=True))


def row(participant, group, length=6.8, distance=0.7, area=2.4, onset=2.0, on_grid=None):
    found = values(length, distance - 0.4, area)
    driven = {**found, "min_center_distance_m": distance, "onset_m": onset}
    return Measured("", participant, group, {DRIVEN: driven, ON_GRID: on_grid or found})


def difference(lower, upper, margin=None):
    """Two participants whose Student's interval reaches from one number to another."""
    half = (upper - lower) / 2 / stats.t.ppf(0.975, 1)
    middle = (lower + upper) / 2
    return Difference("", "m", Paired({"a": middle - half, "b": middle + half}), margin)


def titled(claims, title):
    (found,) = [claim for claim in claims if claim.title == title]
    return found


def test_differences_are_paired_with_students_interval():
    (found,) = titled(claims_of(study(3), []), "joystick").differences
    values = np.array(list(found.paired.differences.values()))
    assert found.paired.student == pytest.approx(stats.t.interval(0.95, 2, values.mean(), stats.sem(values)))
    assert found.paired.bootstrap is None


def test_one_participant_settles_nothing():
    assert Difference("length", "m", paired({"a": 2.0}, {"a": 1.0})).verdict is Verdict.OPEN


@pytest.mark.parametrize(
    ("lower", "upper", "margin", "verdict"),
    [
        (0.1, 0.5, None, Verdict.HOLDS),
        (-0.1, 0.5, None, Verdict.OPEN),
        (-0.5, -0.1, None, Verdict.FAILS),
        (-0.1, 0.2, 0.3, Verdict.HOLDS),
        (-0.1, 0.4, 0.3, Verdict.OPEN),
        (-0.4, -0.1, 0.3, Verdict.OPEN),
        (0.31, 0.5, 0.3, Verdict.FAILS),
        (-0.5, -0.31, 0.3, Verdict.FAILS),
        (-1.0, 1.0, 0.3, Verdict.OPEN),
    ],
)
def test_a_verdict_is_where_the_interval_lies(lower, upper, margin, verdict):
    assert difference(lower, upper, margin).verdict is verdict


def test_who_speaks_against_a_claim_is_named():
    found = Paired({"a": 0.1, "b": -0.2, "c": 0.0})
    assert Difference("", "m", found).against == ["b", "c"]
    assert Difference("", "m", found, margin=0.15).against == ["b"]


def test_a_claim_is_as_good_as_its_worst_difference():
    good, open_, bad = difference(0.1, 0.2), difference(-0.1, 0.2), difference(-0.2, -0.1)
    assert Claim("", "", "", (good, good)).verdict is Verdict.HOLDS
    assert Claim("", "", "", (good, open_)).verdict is Verdict.OPEN
    assert Claim("", "", "", (open_, bad, good)).verdict is Verdict.FAILS


def study(participants=13, seed=0, **shift):
    """Rows of a made-up study; a shift moves what the groups differ by."""
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(participants):
        name, own = f"p{number}", rng.normal(0, 0.1)
        for _ in range(2):
            rows.append(
                row(
                    name,
                    FORCE,
                    length=6.8 + rng.normal(0, 0.1),
                    distance=0.7 + own + rng.normal(0, 0.06),
                    area=2.4 + rng.normal(0, 0.2),
                )
            )
            rows.append(row(name, JOYSTICK, distance=0.7 + own + shift.get("joystick", 0.2) + rng.normal(0, 0.02)))
        replayed = 0.7 + own + shift.get("replay", 0.0) + rng.normal(0, 0.02)
        rows.append(row(name, REPLAY, distance=replayed, area=2.4 + rng.normal(0, 0.05)))
        late = {
            "area": shift.get("area", 0.8) + rng.normal(0, 0.02),
            "onset": shift.get("onset", 0.6) + rng.normal(0, 0.1),
        }
        rows.append(row(name, AVOIDANCE, **late))
    return rows


def test_claims_hold_where_the_numbers_say_so():
    claims = claims_of(study(), [])
    assert [claim.title for claim in claims] == ["replays", "joystick", "late avoidance", "smallest area"]
    verdicts = {claim.title: claim.verdict for claim in claims}
    assert set(verdicts.values()) == {Verdict.HOLDS}
    assert [one.margin is None for one in titled(claims, "replays").differences] == [False] * 3
    (joystick,) = titled(claims, "joystick").differences
    assert joystick.paired.mean == pytest.approx(0.2, abs=0.02)
    assert (joystick.paired.n, joystick.against) == (13, [])


@pytest.mark.parametrize(
    ("shift", "title"),
    [({"joystick": -0.2}, "joystick"), ({"onset": 3.0}, "late avoidance"), ({"area": 3.0}, "smallest area")],
)
def test_claims_fail_where_the_numbers_say_so(shift, title):
    assert titled(claims_of(study(**shift), []), title).verdict is Verdict.FAILS


def test_replays_that_are_far_are_not_close():
    replays = titled(claims_of(study(replay=0.5), []), "replays")
    assert replays.differences[1].verdict is Verdict.FAILS


def test_autonomous_trials_without_a_set_count_as_obstacle_avoidance():
    rows = [
        row(one.participant, one.group.replace(AVOIDANCE, "autonomous"), onset=one.values[DRIVEN]["onset_m"])
        for one in study()
    ]
    claim = titled(claims_of(rows, []), "late avoidance")
    assert "- autonomous" in claim.question
    assert claim.text.startswith("The robot by itself (autonomous) leaves")


def test_claims_without_data_are_left_out():
    rows = [one for one in study() if one.group == FORCE]
    assert claims_of(rows, []) == []


def near(expected):
    return SimpleNamespace(near=SimpleNamespace(learnt=GroupMetrics("", LEARNT, 2, values(*expected), {})))


def test_expected_paths_are_held_against_those_on_the_grid():
    rows = [row(f"p{k}", FORCE, on_grid=values(7.0, 0.3 + s, 2.0)) for k in range(3) for s in (-0.1, 0.1)]
    learnt = [SimpleNamespace(participant=f"p{k}", first=None, second=near((7.5, 0.32, 2.0))) for k in range(3)]
    learnt.append(SimpleNamespace(participant=None, first=near((99, 99, 99)), second=near((99, 99, 99))))
    claims = claims_of(rows, learnt)
    assert [claim.title for claim in claims] == ["goodness of fit"]
    # Length is a feature of the reward, and no evidence of its own.
    assert [one.quantity for one in claims[0].differences] == ["min. distance", "area under path"]
    distance = claims[0].differences[0]
    assert distance.paired.mean == pytest.approx(0.02)
    # Each participant has two paths 0.2 m apart: 0.1 m about their mean, with one degree of freedom each.
    assert distance.margin == pytest.approx(0.1 * np.sqrt(2))


def test_the_margin_is_the_scatter_within_participants_whatever_lies_between_them():
    rows = [row(f"p{k}", FORCE, length=6.0 + k + s) for k in range(4) for s in (-0.05, 0.05)]
    assert scatter_within(rows, DRIVEN, "length_m") == pytest.approx(0.05 * np.sqrt(2))
    assert np.isnan(scatter_within(rows[::2], DRIVEN, "length_m"))


def test_trials_without_people_do_not_count():
    rows = [*study(), row("alone", FORCE, distance=float("nan"), area=99.0), row("alone", AVOIDANCE, area=0.0)]
    area = titled(claims_of(rows, []), "smallest area").differences[0]
    assert "alone" not in area.paired.differences
