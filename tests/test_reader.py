"""The reader against mcap's own reader and rosbags, for every variant of the format."""

import os
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import log_factory as forge
import mcap.writer
import nav_log as nav
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from navirl_cli.logs.messages.reader import read, scan

WRENCH_FIELDS = ("header.stamp", "header.frame_id", "wrench.force.x", "wrench.force.z", "wrench.torque.y")
TF_FIELDS = tuple(
    f"transforms[].{name}" for name in ("header.stamp", "child_frame_id", "transform.translation.y", "header.frame_id")
)
ODOM_FIELDS = ("header.stamp", "child_frame_id", "pose.pose.position.x", "pose.covariance", "twist.twist.angular.z")


def check_same(paths, topic, fields, *, expected_count=None):
    """The columns must be those that the slow twin reads."""
    result = read(paths, {topic: fields})
    assert result.damage == ()
    series = result.series[topic]
    slow = forge.slow_read(paths, topic)
    assert len(series) == len(slow) == (expected_count or len(slow))
    assert series.log_time_ns.dtype == np.int64
    assert series.log_time_ns.tolist() == [t_ns for t_ns, _ in slow]
    for name in fields:
        found = [forge.entries(message, name) for _, message in slow]
        if "[]" in name:
            assert series.counts[name.partition("[]")[0] + "[]"].tolist() == [len(some) for some in found]
        if name.endswith("stamp"):
            assert series.columns[name].dtype == np.int64
        values = [one for some in found for one in some]
        assert np.array_equal(series.columns[name], np.array(values)), name
    return series


@pytest.mark.parametrize("variant", forge.WAYS)
def test_every_variant_reads_as_the_slow_twin(tmp_path, variant):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), **forge.WAYS[variant])
    check_same(path, "/wrench", WRENCH_FIELDS, expected_count=600)
    check_same(path, "/odom", ODOM_FIELDS, expected_count=60)


@pytest.mark.parametrize("variant", forge.WAYS)
def test_scan_counts_every_variant(tmp_path, variant):
    metadata = [("rosbag2", {"a": "1"}), ("navirl", {"person": "ann"}), ("navirl", {"person": "bob"})]
    path = forge.forge(tmp_path / "run.mcap", forge.run(), metadata=metadata, **forge.WAYS[variant])
    contents = scan(path)
    assert (contents.profile, contents.library) == ("ros2", "forged")
    assert [contents.topic_count(topic) for topic in ("/wrench", "/odom", "/camera", "/none")] == [600, 60, 30, 0]
    assert (contents.start_ns, contents.end_ns) == (forge.START_NS, forge.START_NS + 599 * 2_000_000)
    assert contents.metadata == {"rosbag2": ({"a": "1"},), "navirl": ({"person": "ann"}, {"person": "bob"})}
    assert contents.damage == ()
    channel = next(channel for channel in contents.channels if channel.topic == "/wrench")
    assert (channel.schema_name, channel.schema_encoding, channel.message_encoding) == (forge.WRENCH, "ros2msg", "cdr")
    assert "geometry_msgs/Wrench wrench" in channel.schema_text


def test_zstd_frames_without_content_size(tmp_path, monkeypatch):
    compress = zstandard.ZstdCompressor(write_content_size=False).compress
    monkeypatch.setattr(mcap.writer.zstandard, "compress", compress)
    path = forge.forge(tmp_path / "run.mcap", forge.run())
    check_same(path, "/wrench", WRENCH_FIELDS, expected_count=600)


def test_big_endian_reads_as_the_slow_twin(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(80, little_endian=False))
    check_same(path, "/wrench", WRENCH_FIELDS, expected_count=80)
    check_same(path, "/odom", ODOM_FIELDS, expected_count=8)


@pytest.mark.parametrize(
    "frame_ids", [("a", "bb", "", "ccc"), ("aa", "bb"), tuple("abcdefghijklmnopqrstuvwxyz"), ("ü",)]
)
def test_changing_frame_ids(tmp_path, frame_ids):
    path = forge.forge(tmp_path / "run.mcap", forge.run(200, frame_ids=frame_ids))
    series = check_same(path, "/wrench", WRENCH_FIELDS)
    assert series.columns["header.frame_id"][1] == frame_ids[1 % len(frame_ids)]


def test_little_and_big_endian_messages_mixed(tmp_path):
    little, big = forge.run(60), forge.run(60, little_endian=False)
    mixed = [(little, big)[number % 2][number] for number in range(len(little))]
    check_same(forge.forge(tmp_path / "run.mcap", mixed), "/wrench", WRENCH_FIELDS)


def test_more_layouts_than_are_derived_at_once(tmp_path):
    # all of one total size (the alignment hides the lengths) but with eight different lengths
    names = ["x" * length for length in range(1, 9)]
    messages = [
        forge.Message(
            "/odom",
            forge.ODOMETRY,
            number,
            forge.cdr(forge.odometry(0, 1.0, 2.0, names[number % 8], names[-1 - number % 8])),
        )
        for number in range(64)
    ]
    check_same(forge.forge(tmp_path / "run.mcap", messages), "/odom", (*ODOM_FIELDS, "header.frame_id"))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    rows=st.lists(
        st.tuples(
            st.integers(0, 2**31 - 1),
            st.floats(allow_nan=False),
            st.text(alphabet=st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
            st.text(alphabet="ab", max_size=3),
            st.booleans(),
        ),
        min_size=1,
        max_size=30,
    )
)
def test_any_texts_and_numbers_read_as_the_slow_twin(tmp_path_factory, rows):
    messages = [
        forge.Message(
            "/odom",
            forge.ODOMETRY,
            sec * 1000,
            forge.cdr(forge.odometry(sec * 10**9 + 5, x, -x, frame, child), little_endian=little),
        )
        for sec, x, frame, child, little in rows
    ]
    path = forge.forge(tmp_path_factory.mktemp("any") / "run.mcap", messages, chunk_size=2000)
    check_same(path, "/odom", ("header.stamp", "header.frame_id", "child_frame_id", "pose.pose.position.y"))


def test_several_files_are_sorted_by_time_and_ties_keep_their_order(tmp_path):
    def single(name, times, force):
        messages = [
            forge.Message("/wrench", forge.WRENCH, t, forge.cdr(forge.wrench(t, (force + k, 0, 0))))
            for k, t in enumerate(times)
        ]
        return forge.forge(tmp_path / name, messages)

    first, second = single("a.mcap", [10, 30, 20, 30], 100.0), single("b.mcap", [5, 30, 40], 200.0)
    series = read([first, second], {"/wrench": ("wrench.force.x",)}).series["/wrench"]
    assert series.log_time_ns.tolist() == [5, 10, 20, 30, 30, 30, 40]
    assert series.columns["wrench.force.x"].tolist() == [200.0, 100.0, 102.0, 101.0, 103.0, 201.0, 202.0]


def test_several_channels_of_one_topic_keep_the_order_of_the_file(tmp_path):
    messages = [
        forge.Message("/wrench", forge.WRENCH, 1000, forge.cdr(forge.wrench(0, (float(k), 0, 0)))) for k in range(40)
    ]
    path = forge.forge(tmp_path / "run.mcap", messages, channel_for={k: k % 2 for k in range(40)}, chunk_size=1500)
    series = read(path, {"/wrench": ("wrench.force.x",)}).series["/wrench"]
    assert series.columns["wrench.force.x"].tolist() == list(range(40))


def tf_log(path, times_ns, seed, topics=("/tf",), **options):
    """Transforms of 0 to 4 children with names of different lengths, in random order of time."""
    rng = np.random.default_rng(seed)
    messages = []
    for number, t_ns in enumerate(times_ns):
        children = ["b" * int(size) for size in rng.integers(1, 7, size=rng.integers(5))]
        payload = forge.cdr(forge.transforms(int(t_ns), children, float(number)), little_endian=bool(number % 3))
        messages.append(forge.Message(topics[number % len(topics)], forge.TF, int(t_ns), payload))
    return forge.forge(path, messages, **options)


def test_sequences_in_the_order_of_time(tmp_path):
    times = np.random.default_rng(5).integers(0, 300, size=200)
    path = tf_log(tmp_path / "run.mcap", times, 6, chunk_size=1500)
    series = check_same(path, "/tf", TF_FIELDS)
    assert (np.diff(times) < 0).any()
    assert set(series.counts["transforms[]"].tolist()) == {0, 1, 2, 3, 4}


def test_sequences_of_several_files_and_channels(tmp_path):
    rng = np.random.default_rng(7)
    channels = {number: int(channel) for number, channel in enumerate(rng.integers(3, size=120))}
    paths = [
        tf_log(tmp_path / f"{k}.mcap", rng.integers(0, 90, size=120), k, channel_for=channels, chunk_size=2000)
        for k in range(3)
    ]
    assert len(check_same(paths, "/tf", TF_FIELDS)) == 360


def test_sequences_of_numbers_and_texts_and_fields_beside_them(tmp_path):
    rng = np.random.default_rng(8)
    times = rng.integers(0, 50, size=90)
    messages = [
        forge.Message("/joy", forge.JOY, int(t), forge.cdr(forge.joy(int(t), rng.normal(size=k % 4), [k] * (k % 3))))
        for k, t in enumerate(times)
    ]
    path = forge.forge(tmp_path / "run.mcap", messages, chunk_size=1000)
    series = check_same(path, "/joy", ("axes[]", "header.stamp", "buttons[]"))
    assert (series.columns["axes[]"].dtype, series.columns["buttons[]"].dtype) == (np.float32, np.int32)
    text = "string[] names\nbuiltin_interfaces/Time[2] t\n"
    names = [forge.Message("/n", "a_msgs/msg/N", int(t), named("abc"[: k % 4], k)) for k, t in enumerate(times)]
    path = forge.forge(tmp_path / "n.mcap", names, definitions={"a_msgs/msg/N": ("ros2msg", text)})
    series = check_same(path, "/n", ("names[]", "t[]"))
    assert series.columns["names[]"].dtype == object
    assert series.counts["t[]"].tolist() == [2] * 90


def named(names, seconds):
    payload = struct.pack("<I", len(names)) + b"".join(struct.pack("<I2sH", 2, name.encode(), 0) for name in names)
    return b"\0\1\0\0" + payload + struct.pack("<iIiI", seconds, 1, -seconds, 2)


def test_series_without_entries(tmp_path):
    path = tf_log(tmp_path / "run.mcap", [], 0)
    assert read(path, {"/tf": TF_FIELDS}).series == {}
    empty = forge.Message("/tf", forge.TF, 1, forge.cdr(forge.transforms(0, [])))
    series = check_same(forge.forge(tmp_path / "run.mcap", [empty] * 3), "/tf", TF_FIELDS)
    assert series.counts["transforms[]"].tolist() == [0, 0, 0]
    assert {name.partition(".")[2]: str(column.dtype) for name, column in series.columns.items()} == {
        "header.stamp": "int64",
        "header.frame_id": "object",
        "child_frame_id": "object",
        "transform.translation.y": "float64",
    }


@pytest.mark.parametrize("encoding", [("cdr", "ros2msg"), ("ros1", "ros1msg")])
def test_no_fields_give_times_only(tmp_path, encoding):
    payload = bytes(8) if encoding[0] == "ros1" else b"\0\1\0\0" + bytes(8)
    messages = [forge.Message("/a", "a_msgs/msg/A", k, payload) for k in range(3)]
    definitions = {"a_msgs/msg/A": (encoding[1], "float64 x\n")}
    path = forge.forge(tmp_path / "run.mcap", messages, definitions=definitions, encodings={"/a": encoding[0]})
    result = read(path, {"/a": ()})
    assert (result.series["/a"].log_time_ns.tolist(), result.series["/a"].columns, result.damage) == ([0, 1, 2], {}, ())


def test_a_topic_that_no_file_has_is_left_out_and_an_empty_one_is_empty(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(20))
    assert read(path, {"/nowhere": ("header.stamp",)}).series == {}
    empty = forge.forge(tmp_path / "empty.mcap", [])
    assert scan(empty).start_ns is None
    assert read(empty, {"/wrench": WRENCH_FIELDS}).series == {}


@pytest.mark.parametrize("options", [{}, {"chunk_size": 200}, {"compression": ""}])
def test_packed_sequences_are_those_that_become_columns_otherwise(tmp_path, options):
    """Maps of different sizes, the third one equal to the first; the last payload does not decode."""
    rng = np.random.default_rng(4)
    cells = [rng.integers(-1, 101, size, dtype=np.int8) for size in (24, 0, 24, 35, 24)]
    cells[2] = cells[0]
    made = [replace(nav.grid(), data=one) for one in cells]
    messages = [
        forge.Message("/map", one.__msgtype__, t, forge.cdr(one)[: -5 if t == 4 else None])
        for t, one in enumerate(made)
    ]
    path = forge.forge(tmp_path / "run.mcap", messages, **options)
    wanted = {"/map": ("data[]", "info.width")}
    (packed, plain) = (read([path, path], wanted, packed=topics).series["/map"] for topics in (("/map",), ()))
    assert packed.log_time_ns.tolist() == plain.log_time_ns.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert packed.counts["data[]"].tolist() == plain.counts["data[]"].tolist()
    unpacked = [np.frombuffer(zlib.decompress(one), dtype=np.int8) for one in packed.columns["data[]"]]
    assert np.concatenate(unpacked).tolist() == plain.columns["data[]"].tolist()
    assert packed.columns["data[]"][0] is packed.columns["data[]"][4]


def test_progress_reaches_the_end(tmp_path):
    paths = [forge.forge(tmp_path / f"{k}.mcap", forge.run(100)) for k in range(2)]
    calls = []
    read(paths, {"/wrench": ("header.stamp",)}, progress=lambda done, total: calls.append((done, total)))
    total = sum(path.stat().st_size for path in paths)
    assert calls[-1] == (total, total)
    assert calls == sorted(calls)


def test_a_real_log():
    folder = Path(os.environ.get("NAVIRL_LOGS_DIR", Path(__file__).resolve().parent.parent.parent / "shared" / "logs"))
    path = folder / "nav2_turtlebot.mcap"
    if not path.exists():
        pytest.skip(f"no {path}: set NAVIRL_LOGS_DIR to the folder that holds it")
    series = check_same(
        path, "/odom", ("header.stamp", "header.frame_id", "pose.pose.orientation.w", "pose.covariance")
    )
    assert len(series) == 2639
    assert len(check_same(path, "/tf", TF_FIELDS)) == 5422
    contents = scan(path)
    assert (contents.topic_count("/odom"), contents.topic_count("/tf"), contents.topic_count("/tf_static")) == (
        2639,
        5422,
        1,
    )
