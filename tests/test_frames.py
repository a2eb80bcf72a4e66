"""Frames that belong to another robot, change, or hold no rotation."""

import nav_log as nav
import numpy as np
import pytest
import robot_scene as forge
from robot_scene import Robot
from shared_cases import case

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.load import LoadOptions, load_recording

NS_PER_S = 10**9


@pytest.fixture
def trial(tmp_path):
    """The only trial of a log, and the recording's notes."""

    def trial_of(log, **options):
        recording = load_recording(log.write(tmp_path / "run.mcap"), LoadOptions(**options))
        (found,) = extract(recording, ExtractSettings()).demonstrations
        return found, recording.notes

    return trial_of


def is_usual(found, place_m=(0.0, 0.0)):
    """Whether a trial is that of the scene: where it went, and a push to the left."""
    (contact,) = found.contacts
    assert found.xy_m[-1] == pytest.approx([forge.LENGTH_M + place_m[0], place_m[1]], abs=0.02)
    assert np.hypot(*contact.impulse_n_s) == pytest.approx(forge.IMPULSE_N_S, rel=0.01)
    assert contact.direction_rad == pytest.approx(np.pi / 2, abs=0.02)
    return True


def left_out(topic):
    return f"run.mcap: {topic} is left out: it is not in the namespace of odometry, wrench and map"


def test_the_scene_is_sound(trial):
    found, notes = trial(forge.scene())
    assert is_usual(found)
    assert notes == ()


# namespaces


def test_another_robots_mounting_of_the_same_frame_does_not_count(trial):
    log = forge.scene()
    log.add("/robot2/tf_static", forge.mounting(-0.4), nav.START_NS + 5)
    found, notes = trial(log)
    assert is_usual(found)
    assert notes == (left_out("/robot2/tf_static"),)


def test_the_shared_case_of_two_robots():
    recording = load_recording(case("two_robots_tf_static"))
    (found,) = extract(recording, ExtractSettings()).demonstrations
    assert np.degrees(found.contacts[0].direction_rad) == pytest.approx(122, abs=1)
    assert any("/robot2/tf_static is left out" in note for note in recording.notes)


def test_tf_of_the_robot_that_has_the_odometry_counts(trial):
    own, other = Robot("/robot1"), Robot("/robot2", place_m=(0.0, 9.0), mounted_rad=0.0, odometry=(), wrench=False)
    found, notes = trial(forge.scene(own, other))
    assert is_usual(found)
    assert notes == (left_out("/robot2/tf"), left_out("/robot2/tf_static"))


def test_two_whole_robots_are_asked_about_and_the_namespace_decides(trial):
    def log():
        first, second = Robot("/robot1"), Robot("/robot2", place_m=(0.0, 0.5))
        return forge.scene(first, second)

    with pytest.raises(
        LogError,
        match=r"several topics could be the wrench .*: /robot1/wrench, /robot2/wrench; choose one with `topic` "
        r"wrench=/robot1/wrench, or the robot with `namespace` /robot1;",
    ):
        trial(log())
    for name, place_m in (("/robot1", (0.0, 0.0)), ("robot2/", (0.0, 0.5))):
        found, _ = trial(log(), namespace=name)
        assert found.contacts[0].direction_rad == pytest.approx(np.pi / 2, abs=0.02)
        assert found.xy_m[-1, 1] == pytest.approx(place_m[1], abs=0.02)


def test_a_wrench_of_one_robot_and_the_odometry_of_another_are_asked_about(trial):
    log = forge.scene(Robot("/robot1", wrench=False), Robot("/robot2", odometry=()))
    with pytest.raises(LogError, match=r"transforms of several robots .*their topics are of several of these; choose"):
        trial(log)
    with pytest.raises(LogError, match=r"no wrench: expected a topic"):
        trial(log, namespace="/robot1")


def test_a_namespace_that_only_tf_has(trial):
    assert is_usual(trial(forge.scene(Robot(tf_namespace="/robot1")))[0])


def test_two_namespaces_that_only_tf_has_are_asked_about(trial):
    log = forge.scene(Robot(tf_namespace="/robot1"))
    log.add("/robot2/tf", nav.tf(nav.transform(forge.at(1), "map", "odom", 3.0, 3.0)), forge.at(1))
    with pytest.raises(
        LogError,
        match=r"several robots \(/robot1/tf, /robot1/tf_static, /robot2/tf\).*found /odom, /wrench, /map: they are in "
        r"none of these namespaces; choose the robot with `namespace` /robot1",
    ):
        trial(log)
    assert is_usual(trial(log, namespace="/robot1")[0])


def test_a_sole_namespace_with_tf_and_odometry_of_its_own_is_another_robot(trial):
    log = forge.scene(Robot(), Robot("/robot2", wrench=False))
    log.messages = [one for one in log.messages if not one.topic.startswith("/tf")]
    with pytest.raises(
        FrameError, match=r"/robot2/tf, /robot2/tf_static left out as another robot's; if it is this one"
    ):
        trial(log, topics={"odometry": ["/odom"]})


def test_robots_on_a_common_tf_with_prefixes_of_frames(trial):
    own, other = (
        Robot("/robot1", "robot1/", tf_namespace=""),
        Robot("/robot2", "robot2/", tf_namespace="", mounted_rad=0.0),
    )
    assert is_usual(trial(forge.scene(own, other), namespace="/robot1")[0])


def test_poses_from_tf_alone_are_those_of_the_robot_of_the_namespace(trial):
    def moving(log, robot, y):
        for second in forge.times(10):
            x = float(forge.x_m(second))
            link = nav.transform(forge.at(second), "map", f"{robot}/base_link", x, y)
            log.add("/tf", nav.tf(link), forge.at(second))

    log = forge.scene(Robot("/robot1", "robot1/", tf_namespace="", odometry=(), tf=()))
    moving(log, "robot1", 0.0)
    assert is_usual(trial(log)[0])
    moving(log, "robot2", 0.5)
    assert is_usual(trial(log, namespace="/robot1")[0])
    with pytest.raises(FrameError, match=r"expected one robot's frame, found robot1/base_link, robot2/base_link"):
        trial(log)


def test_the_namespace_narrows_all_roles_and_shares_what_no_robot_owns(trial):
    log = forge.scene(Robot("/robot1"), Robot("/robot2"), world=False)
    log.add("/robot2/map", forge.free(value=100), nav.START_NS)
    log.add("/robot1/map", forge.free(), nav.START_NS)
    log.add("/robot2/goal_pose", nav.pose_stamped(forge.at(0.5), 2.0, 0.0), forge.at(0.5))
    log.add("/people", nav.people(forge.at(0), [("a", 2.0, 1.0)]), forge.at(0))
    found, _ = trial(log, namespace="/robot1")
    assert is_usual(found)
    assert found.people_m.tolist() == [[2.0, 1.0]]
    assert found.goal_m == (4.0, 0.0)


def test_an_unknown_namespace_names_the_robots(trial):
    with pytest.raises(LogError, match=r"`namespace`: expected one of '/robot1', '/robot2', found '/robot3'"):
        trial(forge.scene(Robot("/robot1"), Robot("/robot2")), namespace="/robot3")
    log = forge.scene()
    log.messages = [one for one in log.messages if one.topic.count("/") == 1]
    with pytest.raises(LogError, match=r"`namespace`: expected topics in /robot1, found all topics in the root; leave"):
        trial(log, namespace="robot1")


# static transforms that change


def test_a_static_transform_counts_from_when_it_was_sent(trial):
    log = forge.scene()
    log.add("/tf_static", forge.mounting(0.0), forge.at(13))
    found, notes = trial(log)
    assert is_usual(found)
    assert notes == (
        (
            "run.mcap: the static transform base_link -> ft is sent again with another value: at first (0.1, 0, 0) m "
            "turned by (0, 0, 68.8) deg, from 13.0 s on (0.1, 0, 0) m turned by (0, 0, 0) deg; each counts from when "
            "it was sent"
        ),
    )


def test_a_mounting_that_changes_before_the_push(trial):
    log = forge.scene(Robot(mounted_rad=-0.5))
    log.add("/tf_static", forge.mounting(forge.MOUNTED_RAD), forge.at(3))
    assert is_usual(trial(log)[0])


def test_a_static_transform_that_is_sent_again_is_no_finding(trial):
    log = forge.scene()
    for second in range(1, 16):
        log.add("/tf_static", forge.mounting(forge.MOUNTED_RAD), forge.at(second))
    found, notes = trial(log)
    assert is_usual(found)
    assert notes == ()


def test_the_shared_case_of_static_changes():
    recording = load_recording(case("static_changes"))
    (found,) = extract(recording, ExtractSettings()).demonstrations
    assert np.degrees(found.contacts[0].direction_rad) == pytest.approx(122, abs=1)
    assert any("turned by (0, 0, 90) deg, from 15.0 s on" in note for note in recording.notes)


# quaternions


def turned(link, **numbers):
    """A transform with another quaternion."""
    for name, value in numbers.items():
        setattr(link.transform.rotation, name, value)
    return link


def test_quaternions_of_zeros_are_named(trial):
    log = forge.scene(Robot(tf=()))
    for second in forge.times(5):
        link = turned(nav.transform(forge.at(second), "map", "odom"), w=0.0)
        log.add("/tf", nav.tf(link), forge.at(second))
    with pytest.raises(FrameError, match=r"ignored: map -> odom \(80 with a quaternion of zeros\)"):
        trial(log)


def test_the_shared_case_of_zero_quaternions():
    with pytest.raises(FrameError, match=r"ignored: map -> odom \(106 with a quaternion of zeros\)"):
        load_recording(case("tf_quat_zero"))


@pytest.mark.parametrize(("length", "told"), [(1.0004, False), (0.96, True), (1.05, True)])
def test_quaternions_beyond_rounding_are_normalised_and_told(trial, length, told):
    log = forge.scene(Robot(tf=()))
    for second in forge.times(5):
        link = turned(nav.transform(forge.at(second), "map", "odom"), w=length)
        log.add("/tf", nav.tf(link), forge.at(second))
    found, notes = trial(log)
    assert is_usual(found)
    note = f"transforms map -> odom: 80 quaternions have lengths from {length:.3f} to {length:.3f}, not 1; normalised"
    assert notes == ((f"run.mcap: {note}",) if told else ())


def test_odometry_whose_quaternions_are_all_zeros_says_so(trial):
    log = forge.scene(Robot(odometry=()))
    for second in forge.times(10):
        message = nav.odometry(forge.at(second), 0.0, 0.0)
        message.pose.pose.orientation.w = 0.0
        log.add("/odom", message, forge.at(second))
    with pytest.raises(
        LogError, match=r"/odom: expected poses, found none .*\(160 with a quaternion of zeros\); record"
    ):
        trial(log)
