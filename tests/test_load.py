"""A log's columns on one clock and in one frame, and what is done with numbers that are none."""

import json
from dataclasses import replace

import numpy as np
import pytest
from robot_log import LENGTH_M, START_NS, Run, position_m, write_run

from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.load import load_recording


@pytest.fixture
def load(tmp_path):
    def loaded(**changes):
        path = tmp_path / "run.mcap"
        path.unlink(missing_ok=True)
        return load_recording(write_run(path, replace(Run(), **changes)))

    return loaded


def condition_of(recording):
    return extract(recording, ExtractSettings()).demonstrations[0].condition


def test_goals_stamped_0_count_from_their_receipt(load):
    recording = load(goals=((1.5, 4.0, 1.0), (7.0, 4.0, 0.0)), unstamped=("/goal_pose",))
    assert (recording.goal_t_ns - START_NS).tolist() == [1_500_000_000, 7_000_000_000]
    note = "run.mcap: 2 messages on /goal_pose are stamped 0; the time of their receipt stands in"
    assert recording.notes == (note,)
    assert len(extract(recording, ExtractSettings()).demonstrations) == 2


def test_a_joystick_stamped_0_still_steers(load):
    assert condition_of(load(joystick="moved", unstamped=("/joy",))) is Condition.JOYSTICK


def test_where_an_axis_rests_is_no_deflection(load):
    assert condition_of(load(joystick="still", stick_rest=1.0)) is Condition.FORCE
    assert condition_of(load(joystick="moved", stick_rest=1.0)) is Condition.JOYSTICK
    assert condition_of(load(joystick="still", stick_rest=float("nan"))) is Condition.FORCE


def test_poses_that_are_none_are_left_out_and_counted(load):
    recording = load(odometry_nan=3, odometry_zero=4)
    assert recording.notes == ("run.mcap: 7 messages on /odom hold no finite numbers; left out",)
    seconds = (recording.t_ns - START_NS) / 1e9
    assert recording.xy_m == pytest.approx(position_m(seconds), abs=1e-9)
    with pytest.raises(LogError, match=r"topic /odom: expected numbers, found none that are finite"):
        load(odometry_nan=1000)


def test_forces_that_are_none_are_left_out_and_counted(load):
    recording = load(wrench_nan=5)
    assert np.isfinite(recording.wrench.force_n).all()
    assert recording.notes == ("run.mcap: 5 messages on /wrench hold no finite numbers; left out",)


def test_a_sensor_that_moves_on_the_robot_is_refused(load):
    with pytest.raises(FrameError, match=r"run\.mcap: the wrench's frame 'sensor' moves on 'base': expected a fixed"):
        load(sensor_turns=0.2)


def test_people_and_goals_in_other_frames_come_into_the_maps(load):
    # map -> odom: turned by 90 degrees, moved by (1, 2).
    recording = load(people_frame="odom", people=((0.5, 0.0),), goal_frame="odom", goals=((1.5, -2.0, -3.0),))
    assert recording.people_m[0] == pytest.approx(np.array([[1.0, 2.5]]))
    assert recording.goal_m == pytest.approx(np.array([[4.0, 0.0]]))
    assert recording.xy_m[-1] == pytest.approx([LENGTH_M, 0.0])


def test_people_in_an_unknown_frame_do_not_spoil_the_log(load):
    recording = load(people_frame="moon")
    (note,) = recording.notes
    assert note.startswith("run.mcap: 1 messages on the people topic left out: transform from 'moon' to 'map'")
    assert recording.people_m == ()


def test_goals_that_are_none_are_left_out(load):
    recording = load(goals=((1.0, float("nan"), 0.0), (1.5, 4.0, 0.0)))
    assert len(recording.goal_t_ns) == 1
    assert "1 messages on the goal topic left out: its numbers are not finite" in recording.notes[0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"map_short_by": 7}, "run.mcap: expected a map of 30 x 60 cells, found 1793"),
        ({"resolution_m": 0.0}, "run.mcap: expected a map with a positive resolution and a finite origin, found 0.0"),
        ({"resolution_m": float("nan")}, "run.mcap: expected a map with a positive resolution"),
    ],
)
def test_maps_that_are_none_are_refused(load, changes, message):
    with pytest.raises(LogError, match=message):
        load(**changes)


@pytest.mark.parametrize("entry", [{"cycle": "2"}, {"cycle": 2.5}, {"cycle": True}, {"cycle": 0}, {"condition": 3}])
def test_a_session_record_of_wrong_types_is_refused(load, entry):
    with pytest.raises(LogError, match=r"key trials: expected a JSON list of objects with t_ns .* must be"):
        load(session={"trials": json.dumps([{"t_ns": 1, **entry}])})
    with pytest.raises(LogError, match="must be whole numbers"):
        load(session={"trials": '[{"t_ns": Infinity}]'})
