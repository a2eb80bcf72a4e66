"""Messages that were compressed one by one, as rosbag2 does in compression_mode "message"."""

import nav_log as nav
import numpy as np
import pytest
import zstandard
from log_factory import Message, forge
from small_logs import messages

from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import read
from navirl_cli.logs.sources import sources_of

FIELDS = {"/wrench": ("header.stamp", "wrench.force.x", "wrench.force.y"), "/odom": ("pose.pose.position.x",)}


def packed(one, **options):
    data = zstandard.ZstdCompressor(**options).compress(one.payload)
    return Message(one.topic, one.typename, one.log_time_ns, data)


def columns(log, path, **options):
    result = read(log.write(path, **options), FIELDS)
    assert result.damage == ()
    return {(topic, name): series.columns[name] for topic, series in result.series.items() for name in series.columns}


@pytest.mark.parametrize("every", [1, 3])
def test_they_read_as_if_they_were_not(tmp_path, every):
    plain = nav.drive(5.0)
    expected = columns(plain, tmp_path / "plain.mcap")
    plain.messages = [one if number % every else packed(one) for number, one in enumerate(plain.messages)]
    found = columns(plain, tmp_path / "run.mcap")
    assert found.keys() == expected.keys()
    for key, column in expected.items():
        assert found[key].tolist() == column.tolist()


def test_a_whole_recording(tmp_path):
    plain, log = nav.drive(5.0), nav.drive(5.0)
    log.messages = [packed(one) for one in log.messages]
    expected, found = (load_recording(one.write(tmp_path / "run.mcap")) for one in (plain, log))
    assert found.xy_m.tolist() == expected.xy_m.tolist()
    assert found.wrench.force_n.tolist() == expected.wrench.force_n.tolist()
    assert found.damage == found.notes == ()


def test_a_bag_whose_metadata_names_the_mode(tmp_path):
    log = nav.drive(5.0)
    log.messages = [packed(one) for one in log.messages]
    (folder := tmp_path / "walk").mkdir()
    log.write(folder / "walk_0.mcap")
    text = "rosbag2_bagfile_information:\n  storage_identifier: mcap\n  relative_file_paths: [walk_0.mcap]\n"
    text += "  compression_format: zstd\n  compression_mode: MESSAGE\n"
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
    (source,) = sources_of([folder])
    recording = load_recording(source)
    assert len(recording.t_ns) == 100
    assert recording.damage == recording.notes == ()


def test_messages_as_json(tmp_path):
    log = nav.Log()
    log.messages = [packed(one) for one in messages("json") if one.topic == "/wrench"]
    result = read(log.write(tmp_path / "run.mcap", encodings={"/wrench": "json"}), {"/wrench": FIELDS["/wrench"]})
    assert result.damage == ()
    assert len(result.series["/wrench"]) == len(log.messages) > 50


@pytest.mark.parametrize("harm", ["cut", "claims too much", "size unknown"])
def test_a_frame_that_cannot_be_decompressed_is_lost_alone(tmp_path, harm):
    log = nav.drive(2.0)
    log.messages = [packed(one, write_content_size=harm != "size unknown") for one in log.messages]
    row = next(number for number, one in enumerate(log.messages) if one.topic == "/wrench")
    data = bytearray(log.messages[row].payload)
    if harm == "cut":
        data = data[:-9]
    elif harm == "claims too much":
        # a frame's header with a size of eight bytes: 2^40
        data = bytearray(b"\x28\xb5\x2f\xfd\xe0" + (1 << 40).to_bytes(8, "little")) + data[6:]
    log.messages[row] = Message("/wrench", log.messages[row].typename, log.messages[row].log_time_ns, bytes(data))
    result = read(log.write(tmp_path / "run.mcap"), FIELDS)
    if harm == "size unknown":
        assert result.damage == ()
        return
    (lost,) = result.damage
    assert "1 of 200 messages of /wrench does not decode as geometry_msgs/msg/WrenchStamped and is lost" in lost.reason
    assert len(result.series["/wrench"]) == 199


def test_bytes_of_ros_1_that_look_like_a_frame_are_none(tmp_path):
    payload = np.array([0xFD2FB528], dtype="<u4").tobytes()
    found = [Message("/x", "x_msgs/msg/X", 1 + number, payload) for number in range(3)]
    definitions = {"x_msgs/msg/X": ("ros1msg", "uint32 x\n")}
    path = forge(tmp_path / "run.mcap", found, definitions=definitions, encodings={"/x": "ros1"})
    result = read(path, {"/x": ("x",)})
    assert result.series["/x"].columns["x"].tolist() == [0xFD2FB528] * 3
