"""Which topics serve which roles in recordings as robots with Nav2, mocap and simulators make them."""

import nav_log as nav
import numpy as np
import pytest

from navirl_cli.errors import LogError
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.messages.reader import scan
from navirl_cli.logs.roles.message_types import WRENCHES
from navirl_cli.logs.roles.topics import ROLES, Topic, choose, refusal, short_name, topics_of

GRID = "nav_msgs/msg/OccupancyGrid"
POSE = "geometry_msgs/msg/PoseStamped"
AMCL = "geometry_msgs/msg/PoseWithCovarianceStamped"
POSES = "geometry_msgs/msg/PoseArray"
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
WRENCH, BARE_WRENCH = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench"
ODOMETRY, PATH, JOY, TF = "nav_msgs/msg/Odometry", "nav_msgs/msg/Path", "sensor_msgs/msg/Joy", "tf2_msgs/msg/TFMessage"
MARKERS = "visualization_msgs/msg/MarkerArray"
PEOPLE, TRACKS, AGENTS = (
    "people_msgs/msg/People",
    "spencer_tracking_msgs/msg/TrackedPersons",
    "hunav_msgs/msg/Agents",
)

#: What `ros2 bag record -a` sees of a TurtleBot with Nav2 and a force sensor.
NAV2 = {
    "/amcl_pose": AMCL,
    "/cmd_vel": TWIST,
    "/cmd_vel_nav": TWIST,
    "/cmd_vel_smoothed": TWIST,
    "/cmd_vel_teleop": TWIST,
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/ft_sensor/wrench": WRENCH,
    "/ft_sensor/wrench_filtered": WRENCH,
    "/global_costmap/costmap": GRID,
    "/goal_pose": POSE,
    "/goal_update": POSE,
    "/initialpose": AMCL,
    "/keepout_filter_mask": GRID,
    "/local_costmap/costmap": GRID,
    "/local_plan": PATH,
    "/map": GRID,
    "/mocap/robot/pose": POSE,
    "/odom": ODOMETRY,
    "/particlecloud": POSES,
    "/plan": PATH,
    "/plan_smoothed": PATH,
    "/received_global_plan": PATH,
    "/scan": "sensor_msgs/msg/LaserScan",
    "/tf": TF,
    "/tf_static": TF,
    "/transformed_global_plan": PATH,
    "/waypoints": MARKERS,
}


@pytest.fixture
def choose_topics(tmp_path):
    """The choices of a recording with one message on each topic."""

    def chosen(topics, **requested):
        log = nav.Log()
        log.messages = [nav.Message(topic, typename, 1, b"") for topic, typename in topics.items()]
        path = log.write(tmp_path / "run.mcap")
        return choose("run.mcap", topics_of([scan(path)]), {role: (wish,) for role, wish in requested.items()})

    return chosen


def without(*left_out):
    return {topic: typename for topic, typename in NAV2.items() if topic not in left_out}


def named(found, role):
    assert not found[role].ambiguous
    return [topic.name for topic in found[role].topics]


def test_a_recording_of_nav2(choose_topics):
    topics = without("/goal_update")
    found = choose_topics(topics)
    assert {role: named(found, role) for role in found} == {
        "wrench": ["/ft_sensor/wrench"],
        "odometry": ["/odom"],
        "map": ["/map"],
        "people": [],
        "goal": ["/goal_pose"],
        "joystick": ["/cmd_vel_teleop"],
        "tf": ["/tf"],
        "tf_static": ["/tf_static"],
    }
    assert found["wrench"].reason == (
        "unfiltered before filtered, since extract filters without delay; not /ft_sensor/wrench_filtered"
    )
    assert found["map"].reason.startswith(
        "a map before a costmap, a global one before a local one; not /global_costmap"
    )
    assert found["tf"].reason == "the only one that fits"
    problem = found["people"].problem
    assert problem.startswith("no people: expected a topic of type people_msgs/People or spencer_tracking_msgs/")
    assert problem.endswith("give their places with `person` x,y")


@pytest.mark.parametrize(
    ("topics", "role", "expected"),
    [
        (without("/map"), "map", "/global_costmap/costmap"),
        (without("/map", "/global_costmap/costmap"), "map", "/local_costmap/costmap"),
        ({"/robot1/map": GRID, "/map_server/other": GRID}, "map", "/robot1/map"),
        ({"/speed_filter_mask": GRID}, "map", "/speed_filter_mask"),
        (without("/odom"), "odometry", "/amcl_pose"),
        (without("/odom", "/amcl_pose"), "odometry", "/mocap/robot/pose"),
        ({"/mocap/robot/pose": POSE, "/mocap/person/pose": POSE}, "odometry", "/mocap/robot/pose"),
        ({"/tracked_pose": POSE}, "odometry", "/tracked_pose"),
        (without("/ft_sensor/wrench"), "wrench", "/ft_sensor/wrench_filtered"),
        ({"/wrench": BARE_WRENCH, "/arm/wrench_filtered": WRENCH}, "wrench", "/arm/wrench_filtered"),
        ({"/wrench": BARE_WRENCH}, "wrench", "/wrench"),
        (without("/goal_pose", "/goal_update"), "goal", "/plan"),
        (without("/goal_pose", "/goal_update", "/plan", "/plan_smoothed"), "goal", "/received_global_plan"),
        ({"/some_pose": POSE, "/plan": PATH}, "goal", "/some_pose"),
        ({"/people": POSES, "/cluster_centres": POSES}, "people", "/people"),
        ({"/cluster_centres": POSES}, "people", "/cluster_centres"),
        ({"/tracks": TRACKS, "/people_poses": POSES}, "people", "/tracks"),
        ({"/states": AGENTS}, "people", "/states"),
        ({"/anything": PEOPLE, "/tracks": TRACKS}, "people", "/anything"),
        ({"/pedestrian_markers": MARKERS, "/waypoints": MARKERS}, "people", "/pedestrian_markers"),
        ({"/human_pose": AMCL, "/odom": ODOMETRY}, "people", "/human_pose"),
        ({"/cmd_vel_key": TWIST_STAMPED}, "joystick", "/cmd_vel_key"),
    ],
)
def test_the_best_of_several(choose_topics, topics, role, expected):
    assert named(choose_topics(topics), role) == [expected]


@pytest.mark.parametrize(
    ("topics", "role"),
    [
        ({"/particlecloud": POSES}, "people"),
        ({"/waypoints": MARKERS, "/tracked_pose": POSE, "/amcl_pose": AMCL}, "people"),
        ({"/cmd_vel": TWIST, "/cmd_vel_nav": TWIST}, "joystick"),
        ({"/initialpose": AMCL}, "odometry"),
        ({"/person1/pose": POSE, "/mocap/robot/pose": POSE}, "goal"),
        ({"/transformed_global_plan": PATH, "/local_plan": PATH, "/path": PATH}, "goal"),
        ({"/tf_static": TF}, "tf"),
        ({"/tf": TF}, "tf_static"),
    ],
)
def test_topics_that_do_not_fit_are_not_taken(choose_topics, topics, role):
    found = choose_topics(topics)[role]
    assert found.topics == ()
    assert not found.ambiguous
    assert found.problem.startswith(f"no {role}: expected a topic of type ")


def test_one_person_a_topic_and_namespaced_frames(choose_topics):
    found = choose_topics(
        {
            "/mocap/person1/pose": POSE,
            "/mocap/person2/pose": POSE,
            "/robot1/tf": TF,
            "/robot2/tf": TF,
            "/robot1/tf_static": TF,
            "/joy": JOY,
            "/cmd_vel_teleop": TWIST,
        }
    )
    assert named(found, "people") == ["/mocap/person1/pose", "/mocap/person2/pose"]
    assert named(found, "tf") == ["/robot1/tf", "/robot2/tf"]
    assert named(found, "tf_static") == ["/robot1/tf_static"]
    assert named(found, "joystick") == ["/cmd_vel_teleop", "/joy"]


@pytest.mark.parametrize(
    ("topics", "role", "types"),
    [
        ({"/left/wrench": WRENCH, "/right/wrench": WRENCH}, "wrench", "geometry_msgs/WrenchStamped"),
        ({"/odom": ODOMETRY, "/odometry/filtered": ODOMETRY}, "odometry", "nav_msgs/Odometry"),
        ({"/a/map": GRID, "/map": GRID}, "map", "nav_msgs/OccupancyGrid"),
        ({"/goal_pose": POSE, "/goal_update": POSE}, "goal", "geometry_msgs/PoseStamped"),
        ({"/left/people": PEOPLE, "/right/people": PEOPLE}, "people", "people_msgs/People"),
    ],
)
def test_the_user_chooses_between_equal_candidates(choose_topics, topics, role, types):
    first, second = topics
    found = choose_topics(topics)[role]
    assert found.ambiguous
    assert found.problem == (
        f"several topics could be the {role} ({types}): {first}, {second}; choose one with `topic` {role}={first}"
    )
    chosen = choose_topics(topics, **{role: second})[role]
    assert ([topic.name for topic in chosen.topics], chosen.reason) == ([second], "named by `topic`")


MAPS = ", ".join(repr(name) for name, type_name in NAV2.items() if type_name == GRID)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        (
            {"wheel": ("/odom",)},
            f"`topic`: expected one of {', '.join(repr(role.name) for role in ROLES)}, found 'wheel'",
        ),
        (
            {"tf": ("/odom",)},
            "run.mcap: `topic` tf: expected a topic of type tf2_msgs/TFMessage, found '/odom' of type "
            + short_name(ODOMETRY),
        ),
        (
            {"map": ("/maps",)},
            f"run.mcap: `topic` map: expected one of {MAPS}, found '/maps'; did you mean '/map'?",
        ),
        (
            {"map": ("/map", "/local_costmap/costmap")},
            "run.mcap: `topic` map: expected one topic, found /map and /local_costmap/costmap; choose one",
        ),
    ],
)
def test_choices_that_do_not_fit(tmp_path, chosen, message):
    log = nav.Log()
    log.messages = [nav.Message(topic, typename, 1, b"") for topic, typename in NAV2.items()]
    topics = topics_of([scan(log.write(tmp_path / "run.mcap"))])
    with pytest.raises(LogError) as caught:
        choose("run.mcap", topics, chosen)
    assert str(caught.value) == message


def test_a_topic_named_twice_counts_once(tmp_path):
    log = nav.Log()
    log.messages = [nav.Message(topic, POSES, 1, b"") for topic in ("/left", "/right")]
    topics = topics_of([scan(log.write(tmp_path / "run.mcap"))])
    found = choose("run.mcap", topics, {"people": ("/right", "/left", "/right")})
    assert named(found, "people") == ["/right", "/left"]


def test_a_topic_without_messages_is_reported(choose_topics, tmp_path):
    found = choose_topics({"/scan": "sensor_msgs/msg/LaserScan", "/map": GRID, "/a_pose": POSE})
    assert "if /a_pose is meant, `topic` odometry=/a_pose; record the robot's odometry" in found["odometry"].problem
    topics = topics_of([scan(tmp_path / "run.mcap")])
    types = " or ".join(short_name(one.name) for one in WRENCHES)
    assert str(refusal("run.mcap", topics, found["wrench"])) == (
        f"run.mcap: no wrench: expected a topic of type {types}; record the force-torque sensor's topic, for example "
        "with ros2_control's force_torque_sensor_broadcaster, or extract with `no_wrench`; the log holds "
        "/a_pose (geometry_msgs/PoseStamped), /map (nav_msgs/OccupancyGrid), /scan (sensor_msgs/LaserScan)"
    )
    empty = nav.Log().write(tmp_path / "run.mcap")
    assert str(refusal("run.mcap", topics_of([scan(empty)]), found["wrench"])).startswith("run.mcap: holds no messages")


def test_a_topic_that_is_only_announced_does_not_count():
    silent = Topic("/wrench", WRENCH, 0)
    both = (silent, Topic("/ft", WRENCH, 3))
    assert named(choose("run.mcap", both, {}), "wrench") == ["/ft"]
    alone = choose("run.mcap", (silent,), {})["wrench"]
    assert "; /wrench has no messages; record" in alone.problem


def test_a_topic_of_two_types_stands_once_for_each(tmp_path):
    log = nav.Log()
    log.add("/place", nav.odometry(1, 0, 0), 1)
    for number in range(3):
        log.add("/place", nav.pose_stamped(number + 2, 0, 0), number + 2)
    path = log.write(tmp_path / "run.mcap", channel_for=dict.fromkeys((1, 2, 3), 1))
    topics = topics_of([scan(path)])
    assert [(one.name, one.type_name, one.count) for one in topics] == [("/place", POSE, 3), ("/place", ODOMETRY, 1)]
    for wish in ({}, {"odometry": ["/place"]}):
        (chosen,) = choose("run.mcap", topics, wish)["odometry"].topics
        assert chosen.type_name == ODOMETRY


@pytest.mark.parametrize("topic", ["/odom", "/tf", "/wrench", "/map"])
def test_messages_of_another_type_on_a_topic_change_nothing(tmp_path, topic):
    plain, shared = nav.drive(4.0), nav.drive(4.0)
    for number in range(60):
        shared.add(topic, nav.joy(int(nav.unix(number / 20)), [0.0]), int(nav.unix(number / 20)))
    ordered = sorted(shared.messages, key=lambda one: one.log_time_ns)
    own = {number: 1 for number, one in enumerate(ordered) if one.typename == JOY}
    expected = load_recording(plain.write(tmp_path / "plain.mcap"))
    found = load_recording(shared.write(tmp_path / "run.mcap", channel_for=own))
    assert found.xy_m == pytest.approx(expected.xy_m)
    assert found.damage == ()
    (note,) = found.notes
    assert note.startswith(f"run.mcap: {topic} holds messages of several types: ")
    assert "sensor_msgs/Joy (60)" in note
    assert set(note.partition("; used: ")[2].split(", ")) > {"sensor_msgs/Joy"}


# through a complete recording


@pytest.fixture
def nav2(tmp_path):
    """A run in which every candidate holds other numbers: what was read shows which was taken."""
    log = nav.drive(6.0)
    log.add("/global_costmap/costmap", nav.grid(value=50), nav.START_NS)
    log.add("/local_costmap/costmap", nav.grid(frame="odom", value=60), nav.START_NS)
    for step in range(12):
        at = int(nav.unix(step / 2))
        for late in range(0, 500, 100):
            log.add("/wrench_filtered", nav.wrench(at + late * 10**6, -7.0), at + late * 10**6)
        log.add("/amcl_pose", nav.amcl_pose(at, 100.0, 100.0), at)
        log.add("/cmd_vel", nav.twist(0.4), at)
        log.add("/cmd_vel_teleop", nav.twist(0.3 if step < 9 else 0.0), at)
        log.add("/joy", nav.joy(at, [0.0, 0.8 if step == 10 else 0.0]), at)
        log.add("/particlecloud", nav.pose_array(at, [(5.0, 5.0)] * 30), at)
        log.add("/plan", nav.path(at, [(0.0, 0.0), (3.0, 1.0)]), at)
        log.add("/mocap/person/pose", nav.pose_stamped(at, 2.0, 1.0), at)
    log.add("/tf_static", nav.tf(nav.transform(0, "base_footprint", "base_link")), nav.START_NS)
    log.add("/goal_pose", nav.pose_stamped(nav.START_NS, 4.0, 1.0), nav.START_NS)
    return log.write(tmp_path / "run.mcap")


def test_a_nav2_recording_is_read_by_the_right_topics(nav2):
    recording = load_recording(nav2)
    assert recording.damage == recording.notes == ()
    assert recording.wrench.force_n[:, 0].tolist() == pytest.approx((np.arange(600) / 100).tolist())
    assert recording.xy_m[-1] == pytest.approx([0.595, 0.0], abs=0.01)
    assert set(recording.occupancy.data.ravel().tolist()) == {0}
    assert recording.goal_m.tolist() == [[4.0, 1.0]]
    assert [(track.name, track.xy_m[0].tolist()) for track in recording.people] == [("1", [2.0, 1.0])]
    # by hand for 4.5 s through the teleoperation, then once with the stick
    deflected = (recording.command_t_ns[recording.command > 0.1] - nav.START_NS) / 1e9
    assert deflected.tolist() == pytest.approx([*(np.arange(9) / 2), 5.0], abs=0.01)


def test_a_choice_by_the_user_goes_before_rules(nav2):
    chosen = {
        "wrench": ("/wrench_filtered",),
        "odometry": ("/amcl_pose",),
        "map": ("/global_costmap/costmap",),
        "goal": ("/plan",),
        "people": ("/particlecloud",),
        "joystick": ("/joy",),
    }
    recording = load_recording(nav2, LoadOptions(topics=chosen))
    assert set(recording.wrench.force_n[:, 0].tolist()) == {-7.0}
    assert set(recording.xy_m.ravel().tolist()) == {100.0}
    assert set(recording.occupancy.data.ravel().tolist()) == {50}
    assert len(recording.goal_m) == 12
    assert recording.goal_m[0].tolist() == [3.0, 1.0]
    assert len(recording.people) == 30
    assert (recording.command > 0.1).sum() == 1


def test_with_a_map_of_the_user_the_log_needs_no_map(nav2, tmp_path):
    occupancy = load_recording(nav2).occupancy
    bare = nav.drive(6.0, skip=["/map"]).write(tmp_path / "bare.mcap")
    with pytest.raises(LogError, match=r"bare.mcap: no map: expected a topic of type nav_msgs/OccupancyGrid; give the"):
        load_recording(bare)
    assert load_recording(bare, LoadOptions(occupancy=occupancy)).occupancy is occupancy
    assert load_recording(nav2, LoadOptions(occupancy=occupancy)).occupancy is occupancy
