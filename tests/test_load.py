"""A log's columns on one clock and in one frame, and without implausible numbers."""

import json
from dataclasses import replace

import nav_log as nav
import numpy as np
import pytest
from log_factory import BROKEN, Message
from robot_log import LENGTH_M, START_NS, Run, position_m, write_run
from scipy.spatial.transform import Rotation

from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import LogError
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.sources import sources_of


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
    note = "run.mcap: 2 messages on /goal_pose are stamped 0; their times of receipt are used"
    assert recording.notes == (note,)
    assert len(extract(recording, ExtractSettings()).demonstrations) == 2


def test_a_joystick_stamped_0_still_steers(load):
    assert condition_of(load(joystick="moved", unstamped=("/joy",))) is Condition.JOYSTICK


def test_where_an_axis_rests_is_no_deflection(load):
    assert condition_of(load(joystick="still", stick_rest=1.0)) is Condition.FORCE
    assert condition_of(load(joystick="moved", stick_rest=1.0)) is Condition.JOYSTICK
    assert condition_of(load(joystick="still", stick_rest=float("nan"))) is Condition.FORCE


def test_implausible_poses_are_left_out_and_counted(load):
    recording = load(odometry_nan=3, odometry_zero=4)
    assert recording.damage == (
        "run.mcap: 7 messages on /odom hold implausible values (3 not finite, 4 with a quaternion of zeros); left out",
    )
    seconds = (recording.t_ns - START_NS) / 1e9
    assert recording.xy_m == pytest.approx(position_m(seconds), abs=1e-9)
    with pytest.raises(LogError, match=r"topic /odom: expected poses, found none that are finite"):
        load(odometry_nan=1000)


def test_implausible_forces_are_left_out_and_counted(load):
    recording = load(wrench_nan=5)
    assert np.isfinite(recording.wrench.force_n).all()
    assert recording.damage == ("run.mcap: 5 messages on /wrench hold implausible values (5 not finite); left out",)


def test_a_sensor_that_moves_on_the_robot_is_turned_back(load):
    recording = load(sensor_turns=0.2)
    seconds = (recording.wrench.t_ns - START_NS) / 1e9
    assert recording.wrench.to_base.shape == (len(seconds), 3, 3)
    turned = Rotation.from_matrix(recording.wrench.to_base).as_rotvec()
    assert turned == pytest.approx(np.outer(0.2 * seconds, (0, 0, 1)), abs=1e-9)
    assert "the wrench's frame 'sensor' moves on 'base'; the handle's weight may not cancel out" in recording.notes[0]


def test_people_and_goals_in_other_frames_come_into_the_maps(load):
    # map -> odom: turned by 90 degrees, moved by (1, 2).
    recording = load(people_frame="odom", people=((0.5, 0.0),), goal_frame="odom", goals=((1.5, -2.0, -3.0),))
    assert recording.people[0].xy_m == pytest.approx(np.array([[1.0, 2.5]]))
    assert recording.goal_m == pytest.approx(np.array([[4.0, 0.0]]))
    assert recording.xy_m[-1] == pytest.approx([LENGTH_M, 0.0])


def test_people_in_an_unknown_frame_do_not_spoil_the_log(load):
    recording = load(people_frame="moon")
    (note,) = recording.damage
    assert note.startswith("run.mcap: 1 place on /people left out: transform from 'moon' to 'map'")
    assert recording.people == ()


def test_goals_that_are_not_finite_are_left_out(load):
    recording = load(goals=((1.0, float("nan"), 0.0), (1.5, 4.0, 0.0)))
    assert len(recording.goal_t_ns) == 1
    assert "1 message on /goal_pose left out: its numbers are not finite" in recording.damage[0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"map_short_by": 7}, "run.mcap: topic /map: expected a map of 30 x 60 cells, found 1793"),
        ({"resolution_m": 0.0}, "run.mcap: topic /map: expected cells of 0.001 to 100 m, found 0 m"),
        ({"resolution_m": float("nan")}, "run.mcap: topic /map: expected cells of 0.001 to 100 m, found nan m"),
    ],
)
def test_invalid_maps_are_refused(load, changes, message):
    with pytest.raises(LogError, match=message):
        load(**changes)


@pytest.mark.parametrize("entry", [{"cycle": "2"}, {"cycle": 2.5}, {"cycle": True}, {"cycle": 0}, {"condition": 3}])
def test_a_session_record_of_wrong_types_is_refused(load, entry):
    with pytest.raises(LogError, match=r"key trials: expected a JSON list of objects with t_ns .* must be"):
        load(session={"trials": json.dumps([{"t_ns": 1, **entry}])})
    with pytest.raises(LogError, match="must be whole numbers"):
        load(session={"trials": '[{"t_ns": Infinity}]'})


# steering by hand


def commands_of(tmp_path, say, seconds):
    """Times (s) and deflections of a run's joystick."""
    log = nav.drive(10.0)
    for second in seconds.tolist():
        at = int(nav.unix(second))
        log.add(*say(at, second), at + 1)
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    assert recording.damage == ()
    return (recording.command_t_ns - nav.START_NS) / 1e9, recording.command


TEN_S = np.arange(200) / 20


def test_a_stick_that_is_pushed_most_of_the_time_still_rests_at_0(tmp_path):
    pushed = (TEN_S >= 1.0) & (TEN_S < 9.0)

    def say(t, s):
        return "/joy", nav.joy(t, [0.02, 1.0 if 1.0 <= s < 9.0 else 0.0, 1.0])

    seconds, deflection = commands_of(tmp_path, say, TEN_S)
    assert seconds == pytest.approx(TEN_S)
    assert deflection == pytest.approx(np.where(pushed, 1.0, 0.0))


def test_a_trigger_that_shows_0_until_it_is_touched_rests_at_1(tmp_path):
    def say(t, s):
        return "/joy", nav.joy(t, [0.0, 0.0 if s < 2.0 else -1.0 if s < 2.5 else 1.0])

    _, deflection = commands_of(tmp_path, say, TEN_S)
    assert deflection[TEN_S >= 2.5].tolist() == [0.0] * 150
    assert deflection[(TEN_S >= 2.0) & (TEN_S < 2.5)].tolist() == [2.0] * 10


@pytest.mark.parametrize("stamped", [True, False])
def test_a_teleoperation_that_only_speaks_while_it_drives(tmp_path, stamped):
    seconds = TEN_S[(TEN_S >= 4.0) & (TEN_S < 6.0)]

    def say(t, _):
        return "/cmd_vel_teleop", nav.twist_stamped(t, 0.3) if stamped else nav.twist(0.0, 0.0, -0.3)

    found, deflection = commands_of(tmp_path, say, seconds)
    assert found == pytest.approx(seconds, abs=0.01)
    assert deflection == pytest.approx(0.3)


def test_a_hand_at_a_laptop_whose_clock_is_off(tmp_path):
    seconds = TEN_S[80:90]
    found, _ = commands_of(tmp_path, lambda t, _: ("/cmd_vel_key", nav.twist_stamped(t + 5 * 10**9, 0.3)), seconds)
    assert found == pytest.approx(seconds, abs=0.01)


def test_joysticks_with_more_axes_later(tmp_path):
    def say(t, s):
        return "/joy", nav.joy(t, [0.0] if s < 5 else [0.0, 0.0, 0.7 if s >= 8 else 0.0])

    _, deflection = commands_of(tmp_path, say, TEN_S)
    assert deflection == pytest.approx(np.where(TEN_S >= 8, 0.7, 0.0))


# what cannot be read


def test_a_log_of_which_something_is_lost_is_refused_where_that_is_asked(tmp_path):
    path = write_run(tmp_path / "run.mcap", replace(Run(), wrench_nan=2, odometry_nan=1))
    assert len(load_recording(path).damage) == 2
    with pytest.raises(LogError) as caught:
        load_recording(path, LoadOptions(strict=True))
    assert str(caught.value) == (
        "run.mcap: damaged, which `strict` refuses: run.mcap: 1 message on /odom holds implausible values "
        "(1 not finite); left out; run.mcap: 2 messages on /wrench hold implausible values (2 not finite); "
        "left out"
    )
    sound = write_run(tmp_path / "sound.mcap", Run())
    assert load_recording(sound, LoadOptions(strict=True)).damage == ()


def test_forces_without_a_frame_are_the_robots(tmp_path):
    log = nav.drive(4.0, skip=["/wrench"])
    for second in np.arange(400) / 100:
        at = int(nav.unix(second))
        log.add("/wrench", nav.wrench(at, second, frame=""), at)
    path = log.write(tmp_path / "run.mcap")
    recording = load_recording(path)
    assert recording.wrench.to_base.tolist() == np.eye(3).tolist()
    assert recording.notes == (
        "run.mcap: /wrench names no frame; 'base_link' is assumed; name another with `wrench_frame`",
    )
    assert load_recording(path, LoadOptions(wrench_frame="base_link")).notes == ()


def test_forces_of_two_sensors_in_turn(tmp_path):
    log = nav.drive(4.0)
    for number in range(7):
        at = int(nav.unix(number / 2)) + 500
        log.add("/wrench", nav.wrench(at, 5.0, frame="other"), at)
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    assert recording.damage == (
        "run.mcap: 7 messages on /wrench are not in frame 'base_link', as the others are; left out",
    )
    assert len(recording.wrench.t_ns) == 400


def test_a_topic_that_cannot_be_read_is_named_with_the_reason(tmp_path):
    log = nav.drive(4.0)
    log.messages = [
        Message(one.topic, one.typename, one.log_time_ns, b"\0\1\0\0short" if one.topic == "/wrench" else one.payload)
        for one in log.messages
    ]
    path = log.write(tmp_path / "run.mcap")
    with pytest.raises(
        LogError, match=r"^run.mcap: no message on the wrench topic /wrench could be read: .*all 400 messa"
    ):
        load_recording(path)


def test_what_is_wrong_with_other_topics_does_not_matter(tmp_path):
    log = nav.drive(4.0)
    log.messages += [Message("/camera", BROKEN, nav.START_NS + number, b"x" * 100) for number in range(50)]
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    assert recording.damage == recording.notes == ()


def test_a_recording_of_several_files_is_one(tmp_path):
    whole = nav.drive(6.0)
    whole.add("/tf_static", nav.tf(nav.transform(0, "base_link", "ft", 0.0, 0.0, np.pi / 2)), nav.START_NS)
    folder = tmp_path / "bag"
    folder.mkdir()
    for number in range(3):
        part = nav.Log()
        begin, end = nav.unix(np.array([2.0 * number, 2.0 * number + 2.0]))
        part.messages = [one for one in whole.messages if begin <= one.log_time_ns < end + (number == 2) * 10**9]
        part.write(folder / f"bag_{number}.mcap")
    (source,) = sources_of([folder])
    told = []
    recording = load_recording(source, LoadOptions(wrench_frame="ft"), lambda done, total: told.append((done, total)))
    assert recording.log == "bag"
    assert len(recording.t_ns) == 120
    assert recording.t_ns.tolist() == load_recording(whole.write(tmp_path / "whole.mcap")).t_ns.tolist()
    # the sensor's mounting stands in the first file only
    assert recording.wrench.to_base == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-9)
    assert recording.damage == recording.notes == ()
    size = sum(file.stat().st_size for file in source.files)
    assert told[-1] == (size, size)
