"""Written logs: read back, byte by byte the same, and nothing left after an error."""

import log_factory as forge
import numpy as np
import pytest
from mcap.reader import make_reader

from navirl_cli import __version__
from navirl_cli.errors import ArtefactError, LogError
from navirl_cli.logs.messages.reader import read, scan
from navirl_cli.logs.messages.writer import LogWriter, header, message_type, time_message


def wrench(t_ns, x, frame_id="ft"):
    vector = message_type("geometry_msgs/msg/Vector3")
    body = message_type("geometry_msgs/msg/Wrench")(force=vector(x=x, y=0.0, z=0.0), torque=vector(x=0.0, y=0.0, z=1.0))
    return message_type("geometry_msgs/msg/WrenchStamped")(header=header(t_ns, frame_id), wrench=body)


def write(path, **options):
    rng = np.random.default_rng(3)
    with LogWriter(path, **options) as log:
        log.metadata("navirl", {"seed": "3"})
        for number in range(500):
            log.message("/wrench", wrench(number, float(rng.normal())), 10**18 + number, 10**18 - number)
    return path


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_written_messages_are_read_back(tmp_path, compression):
    path = write(tmp_path / "a.mcap", compression=compression)
    result = read(path, {"/wrench": ("header.stamp", "header.frame_id", "wrench.force.x")})
    series = result.series["/wrench"]
    assert result.damage == ()
    assert series.log_time_ns.tolist() == [10**18 + number for number in range(500)]
    assert series.columns["header.stamp"].tolist() == list(range(500))
    assert np.array_equal(series.columns["wrench.force.x"], np.random.default_rng(3).normal(size=500))
    contents = scan(path)
    assert (contents.profile, contents.library) == ("ros2", f"navirl {__version__}")
    assert contents.metadata == {"navirl": ({"seed": "3"},)}
    with path.open("rb") as file:
        schema, channel, message = next(make_reader(file).iter_messages())
    assert (schema.encoding, channel.message_encoding, message.publish_time) == ("ros2msg", "cdr", 10**18)
    assert (message.sequence, b"MSG: geometry_msgs/Vector3\n" in schema.data) == (0, True)


def test_the_same_calls_write_the_same_bytes(tmp_path):
    assert write(tmp_path / "a.mcap").read_bytes() == write(tmp_path / "b.mcap").read_bytes()


def test_columns_write_what_messages_write(tmp_path):
    x = np.random.default_rng(4).normal(size=200)
    t_ns = 5_000_000_000 + np.arange(200) * 7
    with LogWriter(tmp_path / "a.mcap") as log:
        for number in range(200):
            log.message("/wrench", wrench(t_ns[number], float(x[number])), t_ns[number])
    with LogWriter(tmp_path / "b.mcap") as log:
        log.columns("/wrench", wrench(0, 0.0), t_ns, {"header.stamp": t_ns, "wrench.force.x": x})
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_columns_of_fixed_arrays(tmp_path):
    covariance = np.arange(72.0).reshape(2, 36)
    with LogWriter(tmp_path / "a.mcap") as log:
        log.columns("/odom", forge.odometry(0, 1.0, 2.0), [1, 2], {"pose.covariance": covariance})
    columns = read(tmp_path / "a.mcap", {"/odom": ("pose.covariance", "child_frame_id")}).series["/odom"].columns
    assert np.array_equal(columns["pose.covariance"], covariance)
    assert columns["child_frame_id"].tolist() == ["base_link"] * 2


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"wrench.force.x": [1.0]}, r"topic /w: wrench.force.x: expected shape \(2,\), found \(1,\)"),
        (
            {"header.frame_id": ["a", "b"]},
            "topic /w: header.frame_id: expected numbers or times, found a text; set it in the template",
        ),
        (
            {"wrench.mass": [1.0, 2.0]},
            "geometry_msgs/msg/Wrench has no field 'mass' of 'wrench.mass'; its fields are force, torque",
        ),
    ],
)
def test_wrong_columns_are_named_and_nothing_is_left(tmp_path, columns, message):
    with pytest.raises(LogError, match=message), LogWriter(tmp_path / "a.mcap") as log:
        log.columns("/w", wrench(0, 0.0), [1, 2], columns)
    assert list(tmp_path.iterdir()) == []


def test_an_exception_leaves_nothing_and_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_text("old")
    with pytest.raises(LogError, match="has no field 'x'"), LogWriter(path, force=True) as log:
        log.columns("/wrench", wrench(0, 0.0), [1], {"x": [1.0]})
    assert [item.name for item in tmp_path.iterdir()] == ["a.mcap"]
    assert path.read_text() == "old"
    write(path, force=True)
    assert scan(path).topic_count("/wrench") == 500


def test_invalid_names_and_types_are_refused(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_text("old")
    with (
        pytest.raises(ArtefactError, match=r"a\.mcap: exists already; choose another name, or replace it with `force`"),
        LogWriter(path),
    ):
        pass
    with (
        pytest.raises(ArtefactError, match=r"expected an existing folder, found none at .*no"),
        LogWriter(tmp_path / "no" / "a.mcap"),
    ):
        pass
    with pytest.raises(LogError, match="expected compression zstd, lz4 or none, found 'bz2'"):
        LogWriter(tmp_path / "b.mcap", compression="bz2")
    with pytest.raises(LogError, match="message type 'a_msgs/msg/A': expected a standard ROS 2 type"):
        message_type("a_msgs/msg/A")
    with LogWriter(tmp_path / "b.mcap") as log:
        log.message("/w", wrench(0, 0.0), 1)
        with pytest.raises(
            LogError, match="topic /w: expected messages of type geometry_msgs/msg/WrenchStamped, found one of built"
        ):
            log.message("/w", time_message(3), 1)


def test_times_before_zero_and_after():
    assert (time_message(-1).sec, time_message(-1).nanosec) == (-1, 999_999_999)
    assert (time_message(1_500_000_000).sec, time_message(1_500_000_000).nanosec) == (1, 500_000_000)
