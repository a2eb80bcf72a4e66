"""The simulation: same seed, same bytes, and physics as stated."""

import numpy as np
import pytest
from mcap.reader import make_reader
from truth import read_record, read_truth

from navirl_cli.artefacts.plans import Planned, plan_document, read_line, write_plan
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import ArtefactError, SceneError
from navirl_cli.evaluation.lines import Lines
from navirl_cli.irl.reward import Reward
from navirl_cli.logs.load import load_recording
from navirl_cli.planning.paths import Mode, Planner
from navirl_cli.planning.problem import problem_of
from navirl_cli.planning.smooth import Limits, smoothed
from navirl_cli.simulation import person, protocol, sensors
from navirl_cli.simulation.behaviour import Behaviour, Displeasure, Joystick
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
        assert (size[: round(Behaviour().delay_s / STEP_S)] == 0).all()
        touching = one.drive.xy_m[: len(size)][size > 1]
        # The hand lets go within a moment after the robot leaves its reach.
        assert np.hypot(*(touching - session.hallway.person_m).T).max() < Behaviour().reach_m + 0.3
        assert size[-1] == 0
    starts = sorted(round(float(one.drive.xy_m[0, 1]), 2) for one in pushed[:2])
    assert starts == [-0.35, 0.45]


def test_passes_stay_on_free_cells_and_arrive(written):
    _, session = written
    for one in session.passes:
        cells = session.hallway.free.cells_of(one.drive.xy_m)
        assert not session.hallway.free.is_occupied(cells).any()
        assert np.hypot(*(one.drive.xy_m[-1] - one.plan.xy_m[-1])) < 0.3


def test_evaluate_finds_a_driven_path_where_it_was_planned(written, tmp_path):
    path, session = written
    (demonstration,) = (one for one in demonstrations_of(path) if one.id == "p01/3")
    planner = Planner(problem_of(demonstration), Reward(person.PUBLISHED))
    planned = planner.plan(Mode.EXPECTED)[0]
    smooth = smoothed(planner.problem, planned.line_m, 0.1, Limits())
    line = smooth.xy_m
    document = plan_document(planner, [Planned(planned, smooth)], Mode.EXPECTED, 0, [])
    for ending in (".csv", ".json"):
        write_plan(tmp_path / f"path{ending}", document, force=False)
        np.testing.assert_allclose(read_line(tmp_path / f"path{ending}"), line, atol=1e-6)
    driven = write_log(1, 5, tmp_path / "p01.mcap", driven_m=line, force=False)
    assert np.array_equal(driven.hallway.person_m, session.hallway.person_m)
    first, second, alone = demonstrations_of(tmp_path / "p01.mcap")
    assert [one.condition.value for one in (first, second, alone)] == ["force", "force", "autonomous"]
    assert (first.cycle, alone.cycle) == (2, None)
    assert not alone.corrected
    # localisation errs by some centimetres
    away = np.hypot(*(alone.xy_m[:, None] - line).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 0.12
    least = [
        float(Lines(one[None], planner.problem.nominal_m, demonstration.people_m, 0.3).min_distance_m[0])
        for one in (line, alone.xy_m)
    ]
    assert least[1] == pytest.approx(least[0], abs=0.04)


def demonstrations_of(path):
    return extract(load_recording(path), ExtractSettings()).demonstrations


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ([(-3.0, 0.0), (9.0, 0.0)], r"in an obstacle or outside; plan it on the map of a simulated log"),
        ([(-3.0, 0.05), (3.0, 0.05)], r"around the simulated person at .* touches them"),
    ],
)
def test_a_path_that_the_robot_cannot_drive_is_refused(line, message):
    with pytest.raises(SceneError, match=message):
        protocol.session(1, 5, driven_m=np.array(line))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n1,2\n", "expected a CSV table with numbers under x_m and y_m"),
        ("x_m,y_m\n1,two\n", "expected a CSV table with numbers"),
        ("x_m,y_m\n1,2\n1,2\n", "expected a path of at least 0.5 m, found 2 points"),
        ("", "expected a path of at least 0.5 m, found 0 points"),
    ],
)
def test_what_is_no_path_is_refused(tmp_path, text, message):
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(ArtefactError, match=message):
        read_line(tmp_path / "path.csv")


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


def someone(behaviour, seed=5):
    """A person of the published reward in a hallway."""
    rng = np.random.default_rng(seed)
    hallway = protocol.Hallway.with_person(rng)
    return protocol.Someone(hallway, person.personal_reward(rng, behaviour.scatter), behaviour, rng)


def one_pass(seed=5, **behaviour):
    """The person's push off the straight path, and its size, N."""
    who = someone(Behaviour(**behaviour), seed)
    found = protocol.pushed(who, protocol.nominal_path(), 0.0, 1)
    return who, found, np.hypot(*found.steering.T) / GAIN_S_KG


def test_a_free_joystick_follows_the_wish_and_passes_farther_away_than_force():
    least = {"force": [], "joystick": []}
    for seed in range(4):
        who, by_force, _ = one_pass(seed, scatter=0.0)
        assert who.truth.theta == pytest.approx(person.PUBLISHED)
        stick = protocol.steered(someone(Behaviour(joystick=Joystick.FREE, scatter=0.0), seed))
        away = np.hypot(*(stick.drive.xy_m[::20, None] - stick.wanted.xy_m[None]).transpose(2, 0, 1)).min(axis=1)
        assert away.max() < 0.16
        assert np.hypot(*stick.steering.T).max() < 1.3 * person.STICK_M_S
        for one in (by_force, stick):
            least[one.condition].append(np.hypot(*(one.drive.xy_m - who.hallway.person_m).T).min())
    assert np.mean(least["joystick"]) > np.mean(least["force"]) + 0.02


def test_people_push_within_their_reach_only():
    who, found, force = one_pass(reach_m=1.2)
    touching = found.drive.xy_m[: len(force)][force > 1]
    assert 0.3 < np.hypot(*(touching - who.hallway.person_m).T).max() < 1.2 + 0.3


def test_people_of_great_tolerance_do_not_intervene_and_of_little_they_do():
    contact = [(one_pass(tolerance_nats=nats)[2] > 3).sum() for nats in (0.0, 0.5, 1000.0)]
    assert contact[0] >= contact[1] > contact[2] == 0


def test_a_late_person_acts_later():
    early, late = (np.flatnonzero(one_pass(delay_s=delay)[2])[0] for delay in (0.1, 1.0))
    assert late - early >= 50


def test_displeasure_is_least_on_the_most_visited_way():
    hallway = protocol.Hallway.with_person(np.random.default_rng(0))
    scene = protocol.scene_of(hallway, 0.0)
    found = Displeasure.of(Reward(person.PUBLISHED), scene, protocol.nominal_path())
    x, y = hallway.person_m
    through, aside, behind = (found.at(np.array(at)) for at in ((x - 0.6, y), (x - 0.1, y + 0.8), (x + 2.0, y)))
    assert through > aside > behind == 0
    line = found.predicted_m(np.array([-2.0, 0.85]))
    assert line[0] == pytest.approx([-2.0, 0.85], abs=0.03)
    assert (np.diff(line[:, 1]) <= 1e-9).all()
    # as the robot truly drives
    true = drive(protocol.nominal_path(), np.array([-2.0, 0.85]), person.no_hand).xy_m
    assert np.interp(true[:800:50, 0], *line.T) == pytest.approx(true[:800:50, 1], abs=0.02)


def test_what_differs_from_the_defaults_stands_in_the_truth(written, tmp_path):
    path, _ = written
    assert "behaviour" not in read_record(path)
    behaviour = Behaviour(reach_m=1.2, joystick=Joystick.FREE)
    assert behaviour.changed() == {"reach_m": 1.2, "joystick": "free"}
    write_log(1, 5, tmp_path / "p.mcap", behaviour, force=False)
    assert read_record(tmp_path / "p.mcap")["behaviour"] == behaviour.changed()
