import log_factory as forge
import numpy as np
import pytest

from navirl_cli.logs.layout import derive
from navirl_cli.logs.schema import Leaf, Schema, SchemaError, parse_definition


@pytest.fixture
def odometry():
    return parse_definition(forge.ODOMETRY, *forge.definition(forge.ODOMETRY, {}))


def test_offsets_by_hand(odometry):
    """CDR of a header: 4 bytes encapsulation, sec, nanosec, length 5, "odom" and NUL, 3 of padding, length 3, ..."""
    payload = forge.cdr(forge.odometry(1, 2.0, 3.0, "odom", "bl"))
    layout = derive(odometry, payload, ["header.stamp", "header.frame_id", "child_frame_id", "pose.pose.position.x"])
    offsets = {name: place[1] for name, place in layout.dtype.fields.items()}
    assert offsets["header.stamp/sec"] == 4
    assert offsets["header.stamp/nanosec"] == 8
    assert offsets["header.frame_id"] == 16
    assert offsets["child_frame_id"] == 28
    # 24 + 4 + 3 = 31 of the message's bytes are used: the next double stands at 32, behind 4 bytes of encapsulation
    assert offsets["pose.pose.position.x"] == 36
    assert layout.dtype.itemsize == len(payload)
    assert list(layout.checks.values()) == [0x0100, 5, 0, 3, 0]


def test_a_payload_that_is_no_such_message_has_no_layout(odometry):
    payload = forge.cdr(forge.odometry(1, 2.0, 3.0))
    assert derive(odometry, payload, []) is not None
    assert derive(odometry, payload + bytes(3), []) is not None
    for wrong in (payload[:-1], payload[:14], payload + bytes(4), b"\0\0" + payload[2:], b"\0\3" + payload[2:], b""):
        assert derive(odometry, wrong, []) is None
    assert derive(odometry, payload[:12] + bytes(4) + payload[16:], []) is None
    assert derive(odometry, payload[:12] + b"\xff" * 4 + payload[16:], []) is None


def test_leaves(odometry):
    assert odometry.leaf("header.stamp") == Leaf("time", "<i8")
    assert odometry.leaf("child_frame_id") == Leaf("string", "O")
    assert odometry.leaf("pose.covariance") == Leaf("number", "<f8", 36)
    assert odometry.leaf("header.stamp.sec").dtype == "<i4"
    with pytest.raises(SchemaError, match="'' in"):
        parse_definition("a_msgs/msg/A", "ros2msg", "float64 x\n").leaf("x.")


def test_names_and_texts_as_recorders_write_them():
    assert parse_definition("a_msgs/A", "ros2msg", "float64 x # metres\r\n\r\nint32 y\r\n").name == "a_msgs/msg/A"
    empty = parse_definition("std_msgs/msg/Empty", "ros2msg", "")
    assert derive(empty, b"\0\1\0\0\0", []) is not None
    with pytest.raises(SchemaError, match="encoding is 'jsonschema'"):
        parse_definition("a", "jsonschema", "{}")
    with pytest.raises(SchemaError, match="does not parse"):
        parse_definition("a_msgs/msg/A", "ros2idl", "module a {")


def test_sequences_of_messages_and_of_texts():
    text = (
        "P[] points\nstring[] names\nfloat64[] numbers\nP[2] two\nint8 last\n"
        + "=" * 80
        + "\nMSG: a_msgs/P\nfloat64 x\nstring s\n"
    )
    schema = parse_definition("a_msgs/msg/A", "ros2msg", text)
    store = schema.store
    point = store.types["a_msgs/msg/P"]
    for count in (0, 1, 3):
        points = [point(x=float(k), s="t" * k) for k in range(count)]
        message = store.types["a_msgs/msg/A"](
            points=points,
            names=["ab"] * count,
            numbers=np.arange(float(count)),
            two=[point(x=1.0, s=""), point(x=2.0, s="z")],
            last=-7,
        )
        payload = bytes(store.serialize_cdr(message, schema.name, little_endian=True))
        layout = derive(schema, payload, ["last"])
        assert np.frombuffer(payload, dtype=layout.dtype)["last"].tolist() == [-7]


def test_a_schema_is_parsed_once(odometry):
    assert isinstance(odometry, Schema)
    assert parse_definition(forge.ODOMETRY, *forge.definition(forge.ODOMETRY, {})) is odometry
