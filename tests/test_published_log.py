"""The log of a published participant: as a robot would have recorded it, with no more than was published."""

import json

import numpy as np
import published_factory as forge
import pytest
import study_data
from mcap.reader import make_reader
from published_factory import demonstration

from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.logs.load import Forces, LoadOptions, load_recording
from navirl_cli.logs.recording import PUBLISHED_RECORD, SESSION_RECORD, Occupancy
from navirl_cli.published.log import EPOCH_NS, HOUR_NS, NOTE, laid_out, ring_m, write_log
from navirl_cli.published.participant import Part, PublishedPath, participant_of
from navirl_cli.published.runs import Run, runs_in

S = 1_000_000_000
#: The lists of a published participant, in the order in which the study was run.
PUBLISHED = [
    *["force_demos/passing_1"] * 2,
    *["force_demos/passing_2"] * 2,
    "force_demos/replay",
    "force_demos/obstacle_course",
    *["joystick_demos/passing"] * 2,
    "joystick_demos/replay",
    "obs_avoidance_demos/replay",
]


@pytest.fixture(scope="module")
def participant():
    return participant_of(Run("7", "runs/7", forge.participant()))


@pytest.fixture(scope="module")
def path(participant, tmp_path_factory):
    path = tmp_path_factory.mktemp("published") / "7.mcap"
    write_log(participant, 2, path, force=False)
    return path


@pytest.fixture(scope="module")
def demonstrations(path):
    return extracted(path)


def extracted(path):
    found = extract(load_recording(path, LoadOptions(forces=Forces.IGNORED)), ExtractSettings())
    assert found.skipped == ()
    assert found.damage == ()
    assert all(found.published.values())
    return found.demonstrations


def distinct(xy_m):
    """Without positions that follow an equal one."""
    return xy_m[np.concatenate([[True], (np.diff(xy_m, axis=0) != 0).any(axis=1)])].tolist()


def metadata(path):
    with path.open("rb") as stream:
        return {record.name: record.metadata for record in make_reader(stream).iter_metadata()}


def published(xy_m):
    cells = np.array([[0, 0]])
    return PublishedPath("force_demos/passing_1/1", Part(Condition.FORCE), np.array(xy_m), np.zeros((0, 2), int), cells)


def check_same(participant, demonstrations):
    """Every published path comes back as it was, and by its poses become the published cells."""
    for one, found in zip(participant.paths, demonstrations, strict=True):
        assert distinct(found.xy_m) == distinct(one.xy_m)
        assert found.cells.tolist() == one.cells.tolist()
        assert found.people_m.tolist() == participant.grid.centres_of(one.people).tolist()
        assert found.goal_m == tuple(participant.grid.centres_of(one.cells[-1]))
        assert (found.grid.occupied == participant.grid.freed(one.cells).occupied).all()
        assert (found.condition, found.cycle, found.set) == (one.part.condition, one.part.cycle, one.part.set)
        assert (found.contacts, found.corrected, found.laid_out_m_s) == (None, None, 0.4)
        assert found.participant == participant.name
        # half a second from the goal to the first motion, then the path; noticed rest follows
        length_m = np.hypot(*np.diff(one.xy_m, axis=0).T).sum()
        assert found.duration_s == pytest.approx(0.5 + length_m / 0.4, abs=0.4)


def test_every_published_path_comes_back_bit_for_bit(participant, demonstrations):
    assert len(participant.paths) == 10
    check_same(participant, demonstrations)


@pytest.mark.skipif(not study_data.ROOT.is_dir(), reason=study_data.REASON)
def test_every_path_of_the_study_comes_back_bit_for_bit(tmp_path):
    runs, lost = runs_in(study_data.ROOT)
    assert lost == []
    for number, run in enumerate(runs):
        one = participant_of(run)
        assert one.lost == ()
        assert [path.name.rpartition("/")[0] for path in one.paths] == PUBLISHED
        write_log(one, number, tmp_path / "x.mcap", force=True)
        check_same(one, extracted(tmp_path / "x.mcap"))
        assert json.loads(metadata(tmp_path / "x.mcap")[SESSION_RECORD]["robot_radius_m"]) == 0.4


def test_the_log_holds_what_was_published_and_neither_wrench_nor_joystick(path):
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    counts = summary.statistics.channel_message_counts
    topics = {one.topic: (summary.schemas[one.schema_id].name, counts[i]) for i, one in summary.channels.items()}
    assert {name: kind for name, (kind, _) in topics.items()} == {
        "/goal_pose": "geometry_msgs/msg/PoseStamped",
        "/map": "nav_msgs/msg/OccupancyGrid",
        "/odom": "nav_msgs/msg/Odometry",
        "/people": "geometry_msgs/msg/PoseArray",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
    }
    assert topics["/goal_pose"][1] == 10
    # 25 positions that differ in a row, 20 poses of rest before and 30 after
    assert topics["/odom"][1] == topics["/tf"][1] == 10 * (25 + 20 + 30)
    assert summary.statistics.message_start_time == EPOCH_NS + 2 * HOUR_NS


def test_the_map_is_the_published_one(path):
    recording = load_recording(path, LoadOptions(forces=Forces.IGNORED))
    occupancy = recording.occupancy
    assert (occupancy.data == forge.DATA).all()
    assert (occupancy.resolution_m, occupancy.origin_m) == (0.1, (-3.0, -1.0))
    assert recording.jumps == ()
    assert recording.notes == ()


def test_what_the_experimenter_knows_stands_in_the_metadata(path, participant):
    found = metadata(path)
    session, told = found[SESSION_RECORD], found[PUBLISHED_RECORD]
    assert {key: session[key] for key in sorted(session) if key != "trials"} == {
        "completion_s": '{"force": [18.7999985218], "joystick": [16.9999983311]}',
        "laid_out_m_s": "0.4",
        "participant": "7",
        "robot_radius_m": "0.2",
    }
    trials = json.loads(session["trials"])
    first = EPOCH_NS + 2 * HOUR_NS + 1_500_000_000
    x = participant.paths[0].xy_m[:, 0]
    y = participant.grid.centres_of(participant.paths[0].cells[-1])[1]
    line = [[x[0], y], [x[-1], y]]
    driven_ns = np.hypot(*np.diff(participant.paths[0].xy_m, axis=0).T).sum() / 0.4 * 1e9
    stop = trials[0].pop("stop_ns")
    assert stop == pytest.approx(first + 500_000_000 + driven_ns, abs=1000)
    assert trials[0] == {"t_ns": first, "condition": "force", "cycle": 1, "nominal_m": line}
    assert y == pytest.approx(0.05)
    assert "nominal_m" not in trials[5], "the obstacle course has another"
    assert [(one["condition"], one.get("cycle"), one.get("set")) for one in trials[4:7]] == [
        ("autonomous", None, "replay of the learnt policy"),
        ("force", None, "obstacle course"),
        ("joystick", None, None),
    ]
    cells = json.loads(told["cells"])
    assert [one["t_ns"] for one in cells] == [one["t_ns"] for one in trials]
    assert [one["name"] for one in cells] == [one.name for one in participant.paths]
    assert cells[0]["cells"] == participant.paths[0].cells.tolist()
    assert told["note"] == NOTE
    for word in ("0.4 m/s", "headings", "wrench", "got back", "Kollmitz et al., IROS 2020"):
        assert word in NOTE


def test_the_same_input_gives_the_same_bytes(path, participant, tmp_path):
    write_log(participant, 2, tmp_path / "again.mcap", force=False)
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()
    write_log(participant, 3, tmp_path / "next.mcap", force=False)
    assert (tmp_path / "next.mcap").read_bytes() != path.read_bytes()


def test_a_map_without_a_ring_gives_no_radius_of_the_robot(tmp_path):
    files = forge.participant() | {"nav_map.pkl": forge.dumped(forge.nav_map([0] * 1000))}
    write_log(participant_of(Run("7", "runs/7", files)), 0, tmp_path / "7.mcap", force=False)
    assert "robot_radius_m" not in metadata(tmp_path / "7.mcap")[SESSION_RECORD]


@pytest.mark.parametrize(
    ("row", "radius_m"),
    [
        ([100, 99, 99, 99, 50, 0], 0.3),
        ([100, 0, 99, 0, 0, 0], 0.2),
        ([100, 0, 0, 0, 0, 0], None),
        ([0, 99, 0, 0, 0, 0], None),
    ],
)
def test_the_ring_around_the_obstacles_gives_the_robots_radius(row, radius_m):
    assert ring_m(Occupancy(np.array([row], dtype=np.int8), 0.1, (0.0, 0.0))) == radius_m


def test_positions_are_laid_out_at_constant_speed_between_rests():
    trial = laid_out(published([(0, 0), (0.4, 0), (0.4, 0), (0.4, 0.3), (0.4, 0.3)]), 5 * S)
    rest = np.arange(20) * S // 10
    after = (np.arange(30) + 1) * S // 10
    assert trial.t_ns.tolist() == [*(5 * S + rest), 7 * S, 8 * S, 8.75 * S, *(8.75 * S + after).astype(int)]
    assert distinct(trial.xy_m) == [[0, 0], [0.4, 0], [0.4, 0.3]]
    assert trial.goal_ns == 6.5 * S
    assert trial.speed_m_s.tolist() == [0] * 20 + [0.4, 0.4] + [0] * 31
    quarter = np.pi / 2
    assert trial.yaw_rad == pytest.approx([0] * 21 + [quarter] * 32)


def test_positions_that_nearly_agree_differ_by_a_nanosecond_and_show_no_heading():
    trial = laid_out(published([(0, 0), (1e-15, 0), (2e-15, 1e-15), (1, 0), (1, 1e-15), (1, -1e-15)]), 0)
    moving = trial.t_ns[20:26] - 2 * S
    assert moving.tolist() == [0, 1, 2, 2.5 * S, 2.5 * S + 1, 2.5 * S + 2]
    assert (np.diff(trial.t_ns) > 0).all()
    assert trial.yaw_rad == pytest.approx(np.zeros(len(trial.t_ns)))
    twitching = laid_out(published([(0, 0), (1e-4, 0), (0, 0)]), 0)
    assert twitching.yaw_rad.tolist() == [0] * len(twitching.t_ns)


def test_a_robot_that_drives_on_after_standing_keeps_its_heading(participant):
    trial = laid_out(participant.paths[0], 0)
    towards = np.pi  # it drives to the left, around the person
    away = np.abs(np.angle(np.exp(1j * (trial.yaw_rad - towards))))
    assert away.max() < 0.5


def test_a_demonstration_without_people_gives_a_scene_without_people(demonstrations):
    assert [len(one.people_m) for one in demonstrations] == [1, 1, 1, 1, 1, 0, 1, 1, 1, 1]


def test_several_people_stand_in_the_centres_of_their_cells(tmp_path):
    files = forge.participant(passing_1=[demonstration(0.3, people=[[25, 9], [30, 7]])])
    write_log(participant_of(Run("7", "runs/7", files)), 0, tmp_path / "7.mcap", force=False)
    assert np.allclose(extracted(tmp_path / "7.mcap")[0].people_m, [[-0.45, -0.05], [0.05, -0.25]])
