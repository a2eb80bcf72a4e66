"""The simulation: same seed, same bytes, and physics as stated."""

import numpy as np
import pytest
from mcap.reader import make_reader
from truth import read_truth

from navirl_cli.simulation import person, protocol, sensors
from navirl_cli.simulation.driving import FORWARD_M_S, GAIN_S_KG, SIDEWAYS_M_S, STEP_S, Path, drive
from navirl_cli.simulation.log import write_log


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("simulated") / "p01.mcap"
    return path, write_log(1, 5, path, force=False)


def test_the_same_seed_writes_the_same_bytes_and_another_does_not(written, tmp_path):
    path, _ = written
    write_log(1, 5, tmp_path / "again.mcap", force=False)
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()
    write_log(1, 6, tmp_path / "other.mcap", force=False)
    assert read_truth(tmp_path / "other.mcap").theta != read_truth(path).theta


def test_a_log_holds_what_a_robot_would_have_recorded(written):
    path, _ = written
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        counts = summary.statistics.channel_message_counts
        topics = {c.topic: (summary.schemas[c.schema_id].name, counts[i]) for i, c in summary.channels.items()}
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
    seconds = (times[-1] - times[0]) / 1e9
    rates = {topic: count / seconds for topic, (_, count) in topics.items()}
    assert rates["/wrench"] == pytest.approx(100, rel=0.01)
    assert rates["/odom"] == pytest.approx(30, rel=0.01)
    assert rates["/joy"] == pytest.approx(20, rel=0.01)
    assert {topic: name for topic, (name, _) in topics.items()} == {
        "/wrench": "geometry_msgs/msg/WrenchStamped",
        "/odom": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/map": "nav_msgs/msg/OccupancyGrid",
        "/people": "geometry_msgs/msg/PoseArray",
        "/goal_pose": "geometry_msgs/msg/PoseStamped",
        "/plan": "nav_msgs/msg/Path",
        "/joy": "sensor_msgs/msg/Joy",
    }
    assert topics["/goal_pose"][1] == topics["/plan"][1] == 7
    assert times == sorted(times)
    assert summary.statistics.metadata_count == 2


def test_the_person_pushes_late_with_limited_force_within_reach(written):
    _, session = written
    pushed = [one for one in session.passes if one.condition == "force"]
    assert [one.cycle for one in pushed] == [1, 1, 2, 2]
    for one in pushed:
        force = one.steering / GAIN_S_KG
        size = np.hypot(*force.T)
        assert 5 < size.max() < 1.15 * person.MOST_FORCE_N
        assert (size[: round(person.REACTION_S / STEP_S)] == 0).all()
        touching = one.drive.xy_m[: len(size)][size > 1]
        # The hand lets go within a moment after the robot leaves its reach.
        assert np.hypot(*(touching - session.hallway.person_m).T).max() < person.REACH_M + 0.3
        assert size[-1] == 0
    starts = sorted(round(float(one.drive.xy_m[0, 1]), 2) for one in pushed[:2])
    assert starts == [-0.35, 0.45]


def test_passes_stay_on_free_cells_and_arrive(written):
    _, session = written
    for one in session.passes:
        cells = session.hallway.free.cells_of(one.drive.xy_m)
        assert not session.hallway.free.is_occupied(cells).any()
        assert np.hypot(*(one.drive.xy_m[-1] - one.plan.xy_m[-1])) < 0.3


def test_driving_follows_equation_1():
    path = Path.along(np.array([(0.0, 0.0), (4.0, 0.0)]))
    pull = np.array([0.0, 0.3])
    result = drive(path, np.array([0.0, 0.4]), lambda t, _: pull if t < 1 else np.zeros(2))
    velocity = np.diff(result.xy_m, axis=0) / STEP_S
    # Far off the path the robot pulls back at its limit, and the push adds to it.
    assert velocity[0] == pytest.approx([FORWARD_M_S, 0.3 - SIDEWAYS_M_S])
    assert velocity[150] == pytest.approx([FORWARD_M_S, -SIDEWAYS_M_S], abs=1e-6)
    assert np.abs(result.xy_m[-1] - (4, 0)).max() < 0.06


def test_smoothing_keeps_the_ends_of_a_path():
    corners = np.array([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    path = Path.along(corners, 0.2)
    assert path.xy_m[[0, -1]] == pytest.approx(corners[[0, -1]])
    assert path.xy_m[:, 1].max() < 0.95
    assert np.hypot(*path.tangent.T) == pytest.approx(1.0)


def test_drifting_odometry_and_correction_give_back_the_truth():
    rng = np.random.default_rng(3)
    t = np.arange(2000) * STEP_S
    true = sensors.Poses(np.stack([0.4 * t, np.sin(t)], axis=1), 0.1 * np.sin(t))
    odometry = sensors.odometry_of(true, rng)
    assert np.abs(odometry.xy_m - true.xy_m).max() > 0.5
    back = true.after(odometry.inverse()).after(odometry)
    assert back.xy_m == pytest.approx(true.xy_m)
    assert back.yaw_rad == pytest.approx(true.yaw_rad)


def test_the_wrench_is_biased_turned_and_quantised():
    rng = np.random.default_rng(4)
    force = np.tile([10.0, 0.0], (4000, 1))
    measured, torque = sensors.wrench_of(force, np.zeros(4000), rng)
    idle, _ = sensors.wrench_of(np.zeros((4000, 2)), np.zeros(4000), np.random.default_rng(4))
    mean = (measured - idle).mean(axis=0)
    assert np.linalg.norm(mean) == pytest.approx(10, abs=0.05)
    assert mean[0] < 0  # turned by 120 degrees
    assert np.all(measured / sensors.FORCE_STEP_N == np.round(measured / sensors.FORCE_STEP_N))
    assert np.linalg.norm(torque.mean(axis=0)) == pytest.approx(1.0, abs=0.02)


def test_driving_back_passes_the_person_at_a_distance():
    back = protocol.drive_back(np.array([3.15, 0.05]), np.array([-3.15, 0.45]))
    assert np.hypot(*(back.xy_m - (0.1, 0.05)).T).min() > 1.0
    assert back.xy_m[-1] == pytest.approx([-3.15, 0.45], abs=0.06)
