"""Where the robot was, from every source of poses, through tf that rotates, jumps, pauses or is missing."""

import nav_log as nav
import numpy as np
import pytest

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.findings import Kind
from navirl_cli.logs.load import Forces, LoadOptions, load_recording
from navirl_cli.logs.messages.reader import read
from navirl_cli.logs.roles.clocks import TimeSource
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.message_types import POSES, TF, TF_STATIC
from navirl_cli.logs.roles.space import in_one_frame
from navirl_cli.logs.roles.times import on_one_clock


class Run:
    """A robot on a circle of 2 m, 10 s a round; odometry at 20 Hz, wrench at 10 Hz, and a map."""

    def __init__(self, lasts_s=20.0):
        self.log = nav.Log()
        self.seconds = np.arange(0.0, lasts_s, 0.05)
        for second in self.seconds[::2].tolist():
            at = int(nav.unix(second))
            self.log.add("/wrench", nav.wrench(at, 1.0), at)
        self.log.add("/map", nav.grid(), nav.START_NS)

    def true(self, second):
        angle = 2 * np.pi * second / 10
        return 2 * np.cos(angle), 2 * np.sin(angle), angle + np.pi / 2

    def say(self, topic, make, seconds=None):
        for second in (self.seconds if seconds is None else seconds).tolist():
            at = int(nav.unix(second))
            self.log.add(topic, make(at, second), at + 2_000_000)
        return self

    def odometry(self, **frames):
        return self.say("/odom", lambda t, s: nav.odometry(t, *self.true(s), v=1.2, **frames))

    def static(self, *transforms):
        self.log.add("/tf_static", nav.tf(*transforms), nav.START_NS)
        return self

    def tf(self, where, seconds=None, parent="map", child="odom"):
        times = np.arange(0.0, self.seconds[-1] + 0.1, 0.1) if seconds is None else seconds
        return self.say("/tf", lambda t, s: nav.tf(nav.transform(t, parent, child, *where(s))), times)


@pytest.fixture
def load(tmp_path):
    def loaded(run, **options):
        return load_recording(run.log.write(tmp_path / "run.mcap"), LoadOptions(**options))

    return loaded


def check_true(recording, run, seconds=None, xy_m=(0.0, 0.0)):
    """The poses are those of the circle, moved by xy_m."""
    seconds = run.seconds if seconds is None else seconds
    assert recording.t_ns.tolist() == nav.unix(seconds).tolist()
    x, y, yaw = run.true(seconds)
    assert recording.xy_m == pytest.approx(np.column_stack([x + xy_m[0], y + xy_m[1]]), abs=1e-6)
    assert np.cos(recording.yaw_rad - yaw) == pytest.approx(1.0)


# sources


def test_odometry_that_is_in_the_map_already(load):
    run = Run().odometry(frame="map")
    recording = load(run)
    check_true(recording, run)
    assert recording.velocity_m_s[:, 0] == pytest.approx(1.2)
    assert recording.notes == recording.damage == recording.jumps == ()


def test_odometry_through_a_tree_that_turns(load):
    run = Run().tf(lambda s: (1.0, -2.0, 0.1 * s))

    def seen(t, s):
        x, y, yaw = run.true(s)
        cos, sin, dx, dy = np.cos(0.1 * s), np.sin(0.1 * s), x - 1.0, y + 2.0
        return nav.odometry(t, cos * dx + sin * dy, -sin * dx + cos * dy, yaw - 0.1 * s)

    recording = load(run.say("/odom", seen))
    check_true(recording, run)
    assert recording.notes == recording.damage == recording.jumps == ()


def test_poses_of_the_localisation(load):
    run = Run().static(nav.transform(0, "base_footprint", "base_link"))
    run.say("/amcl_pose", lambda t, s: nav.amcl_pose(t, *run.true(s)))
    recording = load(run)
    check_true(recording, run)
    assert recording.velocity_m_s is None
    assert recording.notes == recording.damage == ()


def test_tf_alone(load):
    run = Run().tf(lambda _: (5.0, 0.0))
    run.tf(run.true, parent="odom", child="base_footprint")
    run.static(nav.transform(0, "base_footprint", "base_link"))
    recording = load(run)
    assert recording.notes == ("run.mcap: no odometry: poses are those of 'base_footprint' in tf",)
    check_true(recording, run, np.arange(201) / 10, (5.0, 0.0))
    assert recording.velocity_m_s is None


@pytest.mark.parametrize("ahead_s", [0.0, 0.5])
def test_tf_alone_without_a_wrench(load, ahead_s):
    """Stamps of the frame that moves most often are the clock, not those of a localisation that stamps ahead."""
    run = Run()
    run.log.messages = [one for one in run.log.messages if one.topic != "/wrench"]
    run.tf(run.true, parent="odom", child="base_link")
    for at in range(0, 20, 1):
        ahead = int(nav.unix(at + ahead_s))
        run.log.add("/tf", nav.tf(nav.transform(ahead, "map", "odom", 5.0, 0.0)), int(nav.unix(at)))
    recording = load(run, forces=Forces.IGNORED)
    assert recording.notes == ("run.mcap: no odometry: poses are those of 'base_link' in tf",)
    x, y, _ = run.true((recording.t_ns - nav.START_NS) / 1e9)
    assert recording.xy_m == pytest.approx(np.column_stack([x + 5.0, y]), abs=0.02)
    assert recording.t_ns[-1] - recording.t_ns[0] > 18e9


def test_tf_that_does_not_move_is_no_source(load):
    still = Run().static(nav.transform(0, "map", "base_link"), nav.transform(0, "map", "odom"))
    still.tf(lambda _: (0, 0), parent="map", child="door")
    message = r"^run.mcap: no odometry, and in tf 'base_link' does not move on 'map'; record the robot's odometry$"
    with pytest.raises(LogError, match=message):
        load(still)
    lost = Run().tf(lambda _: (0, 0)).static(nav.transform(0, "base_footprint", "base_link"))
    message = (
        r"^run.mcap: no odometry, and tf does not give poses in its place: transform from 'base_footprint' to 'map': "
        r"expected connected frames, found base_footprint -> base_link; map -> odom; record /tf and /tf_static of "
        r"the entire run, or name other frames; record the robot's odometry$"
    )
    with pytest.raises(FrameError, match=message):
        load(lost)


def test_neither_odometry_nor_tf(load):
    with pytest.raises(
        LogError, match=r"^run.mcap: no odometry: expected a topic of type nav_msgs/Odometry or geometry_"
    ):
        load(Run())


def test_a_chosen_frame(load):
    run = Run().odometry().tf(lambda _: (5.0, 0.0))
    assert load(run).xy_m[0] == pytest.approx([7.0, 0.0])
    recording = load(run, frame="odom")
    check_true(recording, run)
    assert recording.occupancy.origin_m == pytest.approx((-6.0, -2.0))


# names of frames


def test_leading_slashes(load):
    run = Run().odometry(frame="/odom", child="/base_link").tf(lambda _: (5.0, 0.0), parent="/map", child="/odom")
    recording = load(run)
    check_true(recording, run, xy_m=(5.0, 0.0))
    assert recording.wrench.to_base.tolist() == np.eye(3).tolist()


@pytest.mark.parametrize("base", ["base_footprint", "base_link", "base"])
def test_an_empty_child_frame_is_the_base_by_its_usual_name(load, base):
    run = Run().odometry(child="").tf(lambda _: (5.0, 0.0))
    run.static(nav.transform(0, base, "ft", 0.3, 0.0, np.pi / 2))
    recording = load(run, wrench_frame="ft")
    check_true(recording, run, xy_m=(5.0, 0.0))
    assert recording.wrench.to_base == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-9)


def test_a_base_without_any_usual_name(load):
    run = Run().odometry(child="").tf(lambda _: (5.0, 0.0))
    assert any(
        "no message names the robot's own frame, and tf knows none of base_footprint, base_link, base; base_link is "
        "assumed" in note
        for note in load(run).notes
    )


def test_odometry_in_a_frame_that_tf_does_not_know(load):
    message = (
        r"^run.mcap: /odom places 'base_link' in frame 'wheel_odom': transform from 'wheel_odom' to 'map': expected "
        r"connected frames, found map -> odom; wheel_odom is in no transform; record /tf"
    )
    with pytest.raises(FrameError, match=message):
        load(Run().odometry(frame="wheel_odom").tf(lambda _: (5.0, 0.0)))
    without = r"^run.mcap: /odom places 'base_link' in frame 'odom': .*found no frames; odom is in no transform; map "
    with pytest.raises(FrameError, match=without):
        load(Run().odometry())


def test_a_wrench_in_a_frame_that_tf_does_not_know(load):
    run = Run().odometry(frame="map", child="base")
    message = (
        r"^run.mcap: the wrench is given in frame 'base_link': transform from 'base_link' to 'base': expected .*; "
        r"or name a frame with parallel axes with `wrench_frame`$"
    )
    with pytest.raises(FrameError, match=message):
        load(run)
    assert load(run, wrench_frame="base").wrench.to_base.tolist() == np.eye(3).tolist()


def test_a_slash_makes_no_other_frame(load):
    run = Run()
    run.say("/odom", lambda t, s: nav.odometry(t, *run.true(s), frame="/map" if s < 5 else "map"))
    recording = load(run)
    check_true(recording, run)
    assert recording.damage == ()


def test_of_two_frames_in_turn_the_commoner_one_counts(load):
    run = Run()

    def seen(t, s):
        x, y, yaw = run.true(s)
        return nav.odometry(t, x, y, yaw, frame="map" if s < 15 else "odom")

    recording = load(run.say("/odom", seen))
    check_true(recording, run, run.seconds[run.seconds < 15])
    assert recording.damage == ("run.mcap: 100 messages on /odom are not in frame 'map', as the others are; left out",)


# time


def test_poses_before_the_first_transform_are_left_out(load):
    run = Run().odometry().tf(lambda _: (5.0, 0.0), np.arange(60, 201) / 10)
    recording = load(run)
    check_true(recording, run, run.seconds[run.seconds >= 5.0], (5.0, 0.0))
    assert recording.notes == ("run.mcap: 100 poses lie outside the time that tf covers; left out",)
    assert recording.damage == ()


def test_tf_of_another_time(load):
    run = Run().odometry().tf(lambda _: (5.0, 0.0), 1000 + np.arange(20) / 10)
    message = (
        r"^run.mcap: the transform from 'odom' to 'map' is known at no time of /odom; check that tf and odometry are "
        r"stamped by the same clock, or try `time` log$"
    )
    with pytest.raises(FrameError, match=message):
        load(run)


def test_stamps_of_another_clock_can_be_set_aside(load):
    run = Run()
    for second in run.seconds.tolist():
        at = int(nav.unix(second))
        run.log.add("/odom", nav.odometry(10**12 + at, *run.true(second)), at)
        run.log.add("/tf", nav.tf(nav.transform(at, "map", "odom", 5.0, 0.0)), at)
    with pytest.raises(FrameError, match=r"known at no time of /odom; .*, or try `time` log$"):
        load(run)
    check_true(load(run, time=TimeSource.LOG), run, xy_m=(5.0, 0.0))


def test_long_gaps_in_tf_are_not_interpolated(load):
    quiet = np.arange(201) / 10
    run = (
        Run()
        .odometry()
        .tf(lambda _: (5.0, 0.0), quiet[(quiet <= 2.0) | ((quiet >= 6.0) & (quiet <= 8)) | (quiet >= 15)])
    )
    recording = load(run)
    # 4 s are interpolated, 7 s are not
    check_true(recording, run, run.seconds[(run.seconds < 8.025) | (run.seconds > 14.975)], (5.0, 0.0))
    assert recording.damage == ("run.mcap: 139 poses lie in gaps of tf longer than 5 s; left out",)


def test_gaps_count_where_poses_come_from_tf_alone(load):
    quiet = np.arange(201) / 10
    run = Run().tf(lambda _: (5.0, 0.0), quiet[(quiet <= 8) | (quiet >= 15)])
    run.tf(run.true, parent="odom", child="base_link")
    recording = load(run)
    check_true(recording, run, quiet[(quiet <= 8) | (quiet >= 15)], (5.0, 0.0))
    assert recording.damage == ("run.mcap: 69 poses lie in gaps of tf longer than 5 s; left out",)


def test_parents_that_change_are_reported(load):
    run = Run().odometry().static(nav.transform(0, "map", "floor", 1.0, 0.0))
    early, late = np.arange(100) / 10, np.arange(100, 200) / 10
    run.tf(lambda _: (5.0, 0.0), early).tf(lambda _: (4.0, 0.0), late, parent="floor")
    recording = load(run)
    check_true(recording, run, xy_m=(5.0, 0.0))
    assert recording.notes == ("run.mcap: tf gives 'odom' several parents in turn: floor, map",)


# jumps


@pytest.mark.parametrize("at_s", [4.0, 7.3, 19.6])
def test_a_jump_of_the_localisation_is_found_once(load, at_s):
    run = Run().odometry().tf(lambda s: (0.42, 0.0) if s >= at_s else (0.0, 0.0))
    (jump,) = load(run).jumps
    assert jump.size_m == pytest.approx(0.42)
    assert (jump.t_ns - nav.START_NS) / 1e9 == pytest.approx(at_s, abs=0.11)


def test_two_jumps_are_two(load):
    run = Run().odometry().tf(lambda s: (0.0, np.select([s >= 12, s >= 5], [0.1, 0.42])))
    assert [jump.size_m for jump in load(run).jumps] == pytest.approx([0.42, 0.32])


def test_a_turn_of_the_map_moves_a_robot_that_is_far_from_where_it_began(load):
    far = Run().tf(lambda s: (0.0, 0.0, 0.2 if s >= 5 else 0.0))
    far.say("/odom", lambda t, s: nav.odometry(t, 3.0 + s / 100, 0.0))
    (jump,) = load(far).jumps
    assert jump.size_m == pytest.approx(2 * np.sin(0.1) * 3.05, abs=0.01)
    near = Run().tf(lambda s: (0.0, 0.0, 0.2 if s >= 5 else 0.0))
    assert load(near.say("/odom", lambda t, s: nav.odometry(t, s / 100, 0.0))).jumps == ()


def test_smooth_corrections_are_no_jumps(load):
    # 5 cm at every update of AMCL, all to one side
    run = Run().odometry().tf(lambda s: (0.05 * np.floor(s / 0.7), 0.0))
    assert load(run).jumps == ()
    drifting = Run().odometry().tf(lambda s: (0.02 * s, 0.01 * s, 0.002 * s))
    assert load(drifting).jumps == ()


def test_odometry_that_is_reset_leaps_too(load):
    run = Run().tf(lambda s: (0.42, 0.0) if s >= 3.05 else (0.0, 0.0))
    run.say("/odom", lambda t, s: nav.odometry(t, (s - 12 if s >= 12 else s) / 10, 0.0))
    jumps = load(run).jumps
    assert [jump.size_m for jump in jumps] == pytest.approx([0.42, 1.195])
    assert [(jump.t_ns - nav.START_NS) / 1e9 for jump in jumps] == pytest.approx([3.1, 12.0], abs=0.06)


def test_poses_in_the_map_that_leap(load):
    run = Run().static(nav.transform(0, "base_footprint", "base_link"))
    run.say("/amcl_pose", lambda t, s: nav.amcl_pose(t, s / 10 + (0.42 if s >= 8 else 0.0), 0.0))
    (jump,) = load(run).jumps
    assert jump.size_m == pytest.approx(0.425)
    assert jump.t_ns == nav.unix(8.0)
    slow = Run().static(nav.transform(0, "base_footprint", "base_link"))
    slow.say("/amcl_pose", lambda t, s: nav.amcl_pose(t, s, 0.0), np.arange(20) * 1.0)
    assert load(slow).jumps == ()


# a real robot


@nav.needs_real
def test_a_real_robots_odometry_agrees_with_its_localisation():
    types = {"odometry": POSES[0], "amcl": POSES[1], "tf": TF, "tf_static": TF_STATIC}
    topics = {"odometry": "/odom", "amcl": "/amcl_pose", "tf": "/tf", "tf_static": "/tf_static"}
    found = read(nav.REAL, {topics[role]: tuple(one.fields.values()) for role, one in types.items()})
    assert found.damage == ()
    columns = {role: [Columns.of(found.series[topics[role]], one)] for role, one in types.items()}
    (amcl,) = columns.pop("amcl")
    timed = on_one_clock("real", columns, TimeSource.HEADER)
    placed = in_one_frame("real", timed.tables, "map", None, None)
    poses = placed.poses
    assert [one.kind for one in (*timed.findings, *placed.findings)] == [Kind.SIMULATED, Kind.STAMPED_AHEAD]
    assert len(poses.t_ns) == 2639
    assert poses.base == "base_link"
    begin, times = int(poses.t_ns[0]), amcl["stamp"]
    both = (times >= begin) & (times <= poses.t_ns[-1])
    # the first pose was published, and latched, before the recording began
    assert (both.sum(), len(both)) == (134, 135)
    at = (times[both] - begin) / 1e9
    placed = np.column_stack([np.interp(at, (poses.t_ns - begin) / 1e9, axis) for axis in poses.xy_m.T])
    apart = np.hypot(*(placed - amcl.stacked("px", "py")[both]).T)
    assert np.median(apart) < 0.005
    assert np.quantile(apart, 0.95) < 0.01


# two publishers

#: When the poses of the second publisher come, s after those of the first, which come ten times a second.
PATTERNS = {
    "in turn": lambda _: 0.05,
    "together": lambda _: 0.0,
    "first one, then the other": lambda k: 0.01 if k % 2 else -0.01,
    "more seldom": lambda k: 0.05 if k % 4 == 0 else None,
}


def two_publishers(apart_m, pattern):
    log = nav.drive(20.0, skip=["/odom"])
    for k in range(200):
        for late_s, y in ((0.0, 0.0), (PATTERNS[pattern](k), apart_m)):
            if late_s is not None:
                second = k / 10 + late_s
                log.add("/odom", nav.odometry(int(nav.unix(second)), 0.4 * second, y), int(nav.unix(second)) + 10**6)
    return log


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("apart_m", [0.3, 1.5, 30.0])
def test_poses_of_two_publishers_are_refused(tmp_path, pattern, apart_m):
    message = rf"^run.mcap: topic /odom: poses jump to and fro between two tracks {apart_m:.2f} m apart \(\d+ times\)"
    with pytest.raises(LogError, match=message):
        load_recording(two_publishers(apart_m, pattern).write(tmp_path / "run.mcap"))


def test_a_robot_that_turns_back_again_and_again_is_one(tmp_path):
    log = nav.drive(40.0, skip=["/odom"])
    for second in np.arange(0.0, 40.0, 0.1).tolist():
        # at 1.5 m/s to and fro
        x = abs((1.5 * second) % 2.0 - 1.0)
        log.add("/odom", nav.odometry(int(nav.unix(second)), x, 0.0), int(nav.unix(second)))
    assert len(load_recording(log.write(tmp_path / "run.mcap")).t_ns) == 400


def test_noise_is_no_second_track(tmp_path):
    rng = np.random.default_rng(3)
    log = nav.drive(20.0, skip=["/odom"])
    for second in np.arange(0.0, 20.0, 0.1).tolist():
        x, y = rng.normal(0.0, 0.15, 2)
        log.add("/odom", nav.odometry(int(nav.unix(second)), 0.4 * second + x, y), int(nav.unix(second)))
    assert len(load_recording(log.write(tmp_path / "run.mcap")).t_ns) == 200
