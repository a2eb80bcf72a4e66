"""Decoding: definitions of all kinds, and what does not decode."""

import log_factory as forge
import numpy as np
import pytest

from navirl_cli.errors import LogError
from navirl_cli.logs.reader import read

WRENCH_FIELDS = ("header.stamp", "header.frame_id", "wrench.force.x", "wrench.force.z", "wrench.torque.y")


def test_conflicting_definitions_of_two_channels_do_not_meet(tmp_path):
    texts = {
        "a_msgs/msg/A": "x_msgs/X x\n" + "=" * 80 + "\nMSG: x_msgs/X\nfloat32 v\n",
        "b_msgs/msg/B": "x_msgs/X x\n" + "=" * 80 + "\nMSG: x_msgs/X\nint64 v\n",
    }
    messages = [
        forge.Message("/a", "a_msgs/msg/A", 1, b"\0\1\0\0" + np.float32(1.5).tobytes()),
        forge.Message("/b", "b_msgs/msg/B", 2, b"\0\1\0\0" + np.int64(-7).tobytes()),
    ]
    path = forge.forge(
        tmp_path / "run.mcap", messages, definitions={name: ("ros2msg", text) for name, text in texts.items()}
    )
    series = read(path, {"/a": ("x.v",), "/b": ("x.v",)}).series
    assert series["/a"].columns["x.v"].tolist() == [1.5]
    assert series["/b"].columns["x.v"].tolist() == [-7]


def test_idl_with_every_primitive(tmp_path):
    text = (
        "="
        * 80
        + "\nIDL: d_msgs/msg/D\nmodule d_msgs { module msg { struct D { boolean b; string s; octet o; int16 i; "
        "sequence<string> names; double d[2]; uint64 u; }; }; };\n"
    )
    body = b"\1" + bytes(3) + b"\3\0\0\0hi\0" + b"\x7f" + np.int16(-3).tobytes() + bytes(2)
    body += b"\2\0\0\0" + b"\2\0\0\0a\0" + bytes(2) + b"\1\0\0\0\0"
    body += bytes(-len(body) % 8) + np.array([0.5, 2.0]).tobytes() + np.uint64(2**63).tobytes()
    path = forge.forge(
        tmp_path / "run.mcap",
        [forge.Message("/d", "d_msgs/msg/D", k, b"\0\1\0\0" + body) for k in range(3)],
        definitions={"d_msgs/msg/D": ("ros2idl", text)},
    )
    columns = read(path, {"/d": ("b", "s", "o", "i", "d", "u")}).series["/d"].columns
    assert columns["b"].dtype == np.bool_
    assert columns["d"].tolist() == [[0.5, 2.0]] * 3
    assert [columns[name][2] for name in ("b", "s", "o", "i", "u")] == [True, "hi", 127, -3, 2**63]
    slow = read(path, {"/d": None}).series["/d"].messages[0]
    assert (slow.s, slow.names, slow.u) == ("hi", ["a", ""], 2**63)


def test_unwanted_channels_never_spoil_a_read(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(40), encodings={"/camera": "json"})
    assert len(read(path, {"/wrench": WRENCH_FIELDS}).series["/wrench"]) == 40


@pytest.mark.parametrize(
    ("topic", "fields", "options", "message"),
    [
        (
            "/camera",
            None,
            {},
            (
                r"run.mcap: topic /camera: expected cdr with ros2msg or ros2idl, found message encoding 'cdr', schema "
                r"'camera_msgs/msg/Blob' \(ros2msg\): its definition does not parse .*; record the topic again"
            ),
        ),
        (
            "/camera",
            None,
            {"encodings": {"/camera": "json"}},
            "topic /camera: expected cdr .*, found message encoding 'json'.*; record or convert it as ROS 2",
        ),
        (
            "/wrench",
            ("header.stamp",),
            {"definitions": {forge.WRENCH: ("protobuf", "")}},
            "topic /wrench: .*the schema's encoding is 'protobuf'",
        ),
        (
            "/wrench",
            ("header.stamp",),
            {"definitions": {forge.WRENCH: ("ros2msg", "std_msgs/Header header\n")}},
            "no definition of std_msgs/msg/Header",
        ),
        (
            "/wrench",
            ("wrench.force.w",),
            {},
            "topic /wrench: geometry_msgs/msg/Vector3 has no field 'w' of 'wrench.force.w'; its fields are x, y, z; ",
        ),
        (
            "/wrench",
            ("wrench.force",),
            {},
            "'wrench.force' is no number, text, time or fixed array of numbers; read whole messages instead",
        ),
        (
            "/wrench",
            ("wrench.force.x.y",),
            {},
            "'y' in 'wrench.force.x.y' lies below a field that is no single message",
        ),
    ],
)
def test_a_topic_that_cannot_be_decoded_is_named(tmp_path, topic, fields, options, message):
    path = forge.forge(tmp_path / "run.mcap", forge.run(40), **options)
    with pytest.raises(LogError, match=message) as caught:
        read(path, {topic: fields})
    assert "\n" not in str(caught.value)


def test_two_types_on_one_topic_are_refused(tmp_path):
    one, two = forge.run(1)[:2]
    mixed = [forge.Message("/x", one.typename, 1, one.payload), forge.Message("/x", two.typename, 2, two.payload)]
    path = forge.forge(tmp_path / "run.mcap", mixed, channel_for={1: 1})
    with pytest.raises(
        LogError, match="topic /x: expected geometry_msgs/msg/WrenchStamped, as in its other channels, found nav_msgs"
    ):
        read(path, {"/x": ("header.stamp",)})


def test_a_channel_that_claims_cdr_and_is_not(tmp_path):
    lies = [forge.Message("/wrench", forge.WRENCH, k, b'{"force": 3}') for k in range(5)]
    path = forge.forge(tmp_path / "run.mcap", lies)
    with pytest.raises(
        LogError,
        match=r"topic /wrench: expected CDR messages of type .*, found none among 5 \(Invalid or unsupported CDR",
    ):
        read(path, {"/wrench": ("wrench.force.x",)})


def test_one_message_that_does_not_decode_is_damage(tmp_path):
    messages = forge.run(30)
    messages[0] = forge.Message("/wrench", forge.WRENCH, messages[0].log_time_ns, messages[0].payload[:20])
    path = forge.forge(tmp_path / "run.mcap", messages)
    for fields in (WRENCH_FIELDS, None):
        result = read(path, {"/wrench": fields})
        assert len(result.series["/wrench"]) == 29
        assert "1 of 30 messages of /wrench do not decode as geometry_msgs/msg/WrenchStamped and are lost" in str(
            result.damage[0]
        )
    assert np.array_equal(
        result.series["/wrench"].log_time_ns, [m.log_time_ns for m in messages[1:] if m.topic == "/wrench"]
    )
