"""From a recording to demonstrations, on a small log whose every number is known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from robot_log import DRIVE_S, LENGTH_M, PUSH_N, PUSH_S, STAND_S, START_NS, Run, position_m, write_run

from navirl_cli.demos.contact import PushSettings, pushes_of
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings, extract, numbered
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.trials import Split, trials_of
from navirl_cli.errors import DemonstrationError, LogError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.recording import Jump

GOAL_S = 1.5


@pytest.fixture
def make(tmp_path):
    def recording(**changes):
        path = tmp_path / "run.mcap"
        path.unlink(missing_ok=True)
        return load_recording(write_run(path, replace(Run(), **changes)))

    return recording


def one(recording, **settings):
    (demonstration,) = extract(recording, ExtractSettings(**settings)).demonstrations
    return demonstration


def test_poses_come_into_the_map_frame_through_tf(make):
    recording = make()
    seconds = (recording.t_ns - START_NS) / 1e9
    assert recording.xy_m == pytest.approx(position_m(seconds), abs=1e-9)
    assert recording.yaw_rad == pytest.approx(0.0, abs=1e-9)
    assert recording.goal_m == pytest.approx(np.array([[4.0, 0.0]]))
    assert recording.people[0].xy_m == pytest.approx(np.array([[2.0, 0.9]]))


def test_a_trial_becomes_a_demonstration(make):
    d = one(make())
    assert (d.id, d.participant, d.condition, d.corrected, d.cycle) == ("run/1", "run", Condition.FORCE, True, None)
    assert d.start_ns == pytest.approx(START_NS + GOAL_S * 1e9, abs=34e6)
    assert d.xy_m[-1] == pytest.approx([LENGTH_M, 0.0], abs=0.02)
    assert d.duration_s == pytest.approx(STAND_S - GOAL_S + DRIVE_S, abs=0.3)
    assert d.cells[0].tolist() == d.grid.cells_of([0.0, 0.0]).tolist()
    assert d.cells[-1].tolist() == d.grid.cells_of(d.xy_m[-1]).tolist()
    assert len(d.cells) == pytest.approx(41, abs=1)
    assert d.goal_m == (4.0, 0.0)


def test_the_push_is_found_with_its_force_in_the_map_frame(make):
    d = one(make())
    (contact,) = d.contacts
    assert contact.start_s == pytest.approx(PUSH_S[0] - GOAL_S, abs=0.1)
    assert contact.end_s == pytest.approx(PUSH_S[1] - GOAL_S, abs=0.1)
    assert contact.impulse_n_s == pytest.approx(tuple(PUSH_N * 2.0), abs=0.6)
    assert contact.direction_rad == pytest.approx(np.pi / 2, abs=0.03)
    assert contact.peak_force_n == pytest.approx(12.0, abs=1.0)
    quiet = (d.t_s < 3) | (d.t_s > 6)
    assert np.abs(d.force_n[quiet].mean(axis=0)).max() < 0.05


def test_a_threshold_within_the_noise_is_reported(make):
    settings = ExtractSettings(push=PushSettings(begins_n=0.2))
    note, guessed = extract(make(), settings).notes
    assert guessed.startswith("run.mcap: guessed, because it is not stated: ")
    assert note.startswith("run.mcap: without contact the force varies by 0.0")
    assert "contacts from 0.2 N on may be noise; raise `contact_force` to 0." in note


def test_a_threshold_above_the_push_leaves_no_contact(make):
    d = one(make(), push=PushSettings(begins_n=30.0))
    assert d.contacts == ()
    assert (d.condition, d.corrected) == (Condition.AUTONOMOUS, False)


def test_a_deflected_joystick_makes_a_joystick_trial(make):
    d = one(make(joystick="moved"))
    assert (d.condition, d.corrected) == (Condition.JOYSTICK, True)


def test_the_session_record_gives_participant_cycle_and_condition(make):
    entry = {"t_ns": START_NS + 1_500_000_000, "cycle": 2, "condition": "force"}
    d = one(make(session={"participant": "ann", "trials": json.dumps([entry])}))
    assert (d.id, d.cycle, d.condition) == ("ann/1", 2, Condition.FORCE)
    assert one(make(), participant="bob").id == "bob/1"


@pytest.mark.parametrize("trials", ["no json", '{"t_ns": 1}', '[{"cycle": 1}]', "[1]"])
def test_a_broken_session_record_is_reported(make, trials):
    with pytest.raises(LogError, match=r"run\.mcap: metadata record navirl\.session, key trials: expected a JSON list"):
        make(session={"trials": trials})


def test_an_unknown_condition_is_reported_and_the_trial_skipped(make):
    entry = {"t_ns": START_NS, "condition": "telepathy"}
    with pytest.raises(
        DemonstrationError,
        match=r"expected a condition \(force, joystick, autonomous, unknown\), found 'telepathy'; correct it",
    ):
        extract(make(session={"trials": json.dumps([entry])}), ExtractSettings())


def test_announcing_the_same_goal_again_starts_no_trial(make):
    goals = ((1.5, 4.0, 0.0), (4.0, 4.0, 0.01), (6.0, 4.01, 0.0))
    assert len(trials_of(make(goals=goals), Split.GOAL)) == 1


def test_a_new_goal_during_a_drive_starts_a_trial(make):
    extraction = extract(make(goals=((1.5, 4.0, 1.0), (7.0, 4.0, 0.0))), ExtractSettings())
    first, second = extraction.demonstrations
    assert first.xy_m[-1, 0] == pytest.approx(2.0, abs=0.05)
    assert "ended 2.25 m from its goal" in first.notes[0]
    assert second.xy_m[0, 0] == pytest.approx(2.0, abs=0.05)
    assert second.notes == ()
    assert [d.id for d in extraction.demonstrations] == ["run/1", "run/2"]


def test_a_goal_that_cannot_be_reached_is_reported(make):
    for goal in ((1.5, 40.0, 0.0), (1.5, 3.0, 1.2)):
        walls = tuple((column, 25) for column in range(60))
        with pytest.raises(DemonstrationError, match=r"goal unreachable: no free path on the map from x -?0\.00 m"):
            extract(make(goals=(goal,), obstacles=walls), ExtractSettings(robot_radius_m=0.2))


def test_splits_at_rests_and_none(make):
    recording = make(goals=())
    (trial,) = trials_of(recording, Split.STOP)
    seconds = (recording.t_ns[[trial.first, trial.stop - 1]] - START_NS) / 1e9
    assert seconds == pytest.approx([STAND_S, STAND_S + DRIVE_S], abs=0.3)
    d = one(recording, split=Split.NONE)
    assert d.duration_s == pytest.approx(14.0, abs=0.1)
    assert d.goal_m == pytest.approx((LENGTH_M, 0.0))


def test_goal_and_people_can_be_given(make):
    d = one(make(goals=(), people=None), goal_m=(4.0, 0.0), people_m=((2.0, -1.0), (1.0, 1.0)))
    assert d.goal_m == (4.0, 0.0)
    assert d.people_m.tolist() == [[2.0, -1.0], [1.0, 1.0]]
    assert d.notes == ()
    assert "no people in the scene; give their places with `person` x,y" in one(make(people=None)).notes


def test_without_goals_the_error_gives_the_remedy(make):
    with pytest.raises(DemonstrationError, match=r"no goal is announced.* `goal` x,y, or choose `split` stop"):
        extract(make(goals=()), ExtractSettings())


def test_a_goal_after_the_last_pose_is_no_trial(make):
    late = make()
    late = replace(late, goal_t_ns=np.array([late.t_ns[-1] + 10**9]), goal_m=np.array([[4.0, 0.0]]))
    with pytest.raises(DemonstrationError, match=r"no trial became a demonstration: no goal is announced while poses"):
        extract(late, ExtractSettings())


def test_driven_cells_that_the_map_calls_occupied_are_freed_and_counted(make):
    # a wall of one cell 0.2 m beside the path: grown by 0.3 m it covers the path
    recording = make(obstacles=((30, 17),))
    d = one(recording)
    walled = one(recording, robot_radius_m=0.05)
    assert walled.notes == ()
    (note,) = d.notes
    count = int(note.split()[0])
    # of the path's cells those nearer than 0.3 m to it: |dx| < sqrt(0.05) = 0.22 m.
    assert note == f"{count} driven cells that are occupied on the map were freed"
    assert count == 5
    assert not d.grid.is_occupied(d.cells).any()


def test_a_loop_that_the_rule_leaves_out_is_reported(make):
    recording = make()
    turn = np.linspace(0, 2 * np.pi, 60)
    loop = np.stack([2 + 0.7 * np.sin(turn), 0.7 - 0.7 * np.cos(turn)], axis=1)
    way = np.concatenate([recording.xy_m[60:210], loop, recording.xy_m[210:]])
    times = recording.t_ns[0] + np.arange(len(way)) * 33_000_000
    changed = replace(recording, t_ns=times, xy_m=way, yaw_rad=np.zeros(len(way)), goal_t_ns=times[:1])
    with pytest.raises(DemonstrationError, match=r"8\.4 m driven become 41 cells: the path crosses itself"):
        extract(changed, ExtractSettings())
    kept = one(changed, rasterizer=Rule.CHAIN)
    assert kept.notes == ()
    assert len(kept.cells) == pytest.approx(41 + 2 * np.pi * 7 * 0.9, abs=3)  # a circle has fewer steps than its length
    shaking = recording.xy_m + np.random.default_rng(0).normal(0, 0.004, recording.xy_m.shape)
    assert one(replace(recording, xy_m=shaking)).notes == ()


def test_a_person_on_the_start_is_refused(make):
    with pytest.raises(DemonstrationError, match=r"a person at x 0\.10 m, y 0\.00 m stands on the path's start"):
        extract(make(people=((0.1, 0.0),)), ExtractSettings())


def test_a_robot_that_does_not_move_is_an_empty_trial(make):
    with pytest.raises(DemonstrationError, match=r"no trial became a demonstration: .*an empty trial"):
        extract(make(moves=False), ExtractSettings())


def test_a_path_beyond_the_map_is_reported(make):
    recording = make()
    small = replace(recording.occupancy, data=recording.occupancy.data[:, :30])
    with pytest.raises(DemonstrationError, match=r"cells of the path lie beyond the map, the first at x 2\.00 m"):
        extract(replace(recording, occupancy=small), ExtractSettings())


def test_another_resolution_gives_other_cells(make):
    d = one(make(), resolution_m=0.2)
    assert d.grid.resolution_m == 0.2
    assert len(d.cells) == pytest.approx(21, abs=1)


def test_too_few_wrench_messages(make):
    recording = make()
    short = replace(recording.wrench, t_ns=recording.wrench.t_ns[:10], force_n=recording.wrench.force_n[:10])
    with pytest.raises(LogError, match="expected a wrench of at least 50 messages, found 10"):
        pushes_of(replace(recording, wrench=short), PushSettings())


def test_numbers_go_on_over_the_logs_of_a_participant(make):
    extraction = extract(make(), ExtractSettings())
    other = replace(extraction, demonstrations=(replace(extraction.demonstrations[0], participant="eve"),))
    three = replace(extraction, trials=3)
    found = numbered([three, other, extraction])
    assert [d.id for d in found] == ["run/1", "eve/1", "run/4"]


def test_a_trial_with_a_gap_in_poses_or_wrench_is_refused(make):
    recording = make()
    seconds = (recording.t_ns - START_NS) / 1e9
    keep = (seconds < 5) | (seconds > 7.5)
    holed = replace(recording, t_ns=recording.t_ns[keep], xy_m=recording.xy_m[keep], yaw_rad=recording.yaw_rad[keep])
    with pytest.raises(DemonstrationError, match=r"trial 1: poses are missing for 2\.\d s"):
        extract(holed, ExtractSettings())
    wrench = recording.wrench
    for since, until, message in ((4.0, 20.0, r"missing for 8\.\d s"), (6.0, 6.9, r"missing for 0\.9 s")):
        seconds = (wrench.t_ns - START_NS) / 1e9
        keep = (seconds < since) | (seconds > until)
        dead = replace(wrench, t_ns=wrench.t_ns[keep], force_n=wrench.force_n[keep])
        with pytest.raises(DemonstrationError, match="the wrench is " + message):
            extract(replace(recording, wrench=dead), ExtractSettings())
    short = (seconds < 6.0) | (seconds > 6.3)
    gapped = replace(wrench, t_ns=wrench.t_ns[short], force_n=wrench.force_n[short])
    note, _ = extract(replace(recording, wrench=gapped), ExtractSettings()).notes
    assert note == "run.mcap: gaps of more than 0.1 s in the wrench: 1; the force is interpolated linearly"


def test_wrench_and_poses_of_different_clocks_are_reported(make):
    recording = make()
    late = replace(recording.wrench, t_ns=recording.wrench.t_ns + 10**18)
    with pytest.raises(LogError, match=r"wrench and poses share no time: .* \+1000000000 s from the poses"):
        extract(replace(recording, wrench=late), ExtractSettings())


def test_the_same_goal_again_after_the_robot_was_there_starts_a_trial(make):
    recording = make()
    there, back = recording.xy_m, recording.xy_m[::-1]
    way = np.concatenate([there, back[30:-30], there])
    times = recording.t_ns[0] + np.arange(len(way)) * 33_000_000
    second = times[len(there) + len(back) - 60]
    # The robot does not rest at its goal, and its UI repeats the goal while it is there.
    goal_times = np.array([times[0], times[len(there) - 5], second])
    twice = replace(
        recording,
        t_ns=times,
        xy_m=way,
        yaw_rad=np.zeros(len(way)),
        goal_t_ns=goal_times,
        goal_m=np.tile((4.0, 0.0), (3, 1)),
    )
    first, again = trials_of(twice, Split.GOAL)
    assert way[first.stop - 1] == pytest.approx([4.0, 0.0], abs=0.05)
    assert again.first == pytest.approx(len(there) + len(back) - 60, abs=1)
    assert way[again.stop - 1] == pytest.approx([4.0, 0.0], abs=0.05)


def test_a_goal_of_the_user_replaces_the_logs(make):
    d = one(make(goals=((1.5, 1.0, 1.0),)), goal_m=(4.0, 0.0))
    assert d.goal_m == (4.0, 0.0)
    assert d.notes == ()


def test_a_map_with_occupied_cells_on_the_path_is_reported(make):
    wall = tuple((column, 15) for column in range(20, 45))
    with pytest.raises(DemonstrationError, match=r"\d+ of 41 driven cells are occupied on the map grown by 0\.3 m"):
        extract(make(obstacles=wall), ExtractSettings())


def test_people_in_a_wall_or_off_the_map_are_noted(make):
    d = one(make(obstacles=((30, 27),)), people_m=((1.95 + 0.03, 1.2), (90.0, 0.0)))
    assert d.notes == (
        "people by `person`: 2; in the log: 1; those of the log are ignored",
        (
            "`person` 90.00,0.00 contradicts the log, whose nearest person is 88.00 m from there, at x 2.00 m, y 0.90 "
            "m; the log's people are ignored"
        ),
        "a person at x 1.98 m, y 1.20 m stands in a wall of the map",
        "a person at x 90.00 m, y 0.00 m stands off the map",
    )


def test_jumps_of_the_localisation_are_noted_with_the_trial(make):
    recording = make()
    start_ns = one(recording).start_ns
    jumps = [
        Jump(start_ns + round(seconds * 1e9), size) for seconds, size in ((-1, 0.9), (3.24, 0.42), (5, 0.3), (20, 1))
    ]
    assert one(replace(recording, jumps=tuple(jumps[:2]))).notes == ("the localisation jumps by 0.42 m at 3.2 s",)
    (note,) = one(replace(recording, jumps=tuple(jumps))).notes
    assert note == "the localisation jumps 2 times, at most by 0.42 m at 3.2 s"
    assert one(replace(recording, jumps=(jumps[0], jumps[3]))).notes == ()
