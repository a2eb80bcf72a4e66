"""Layouts by hand, and decoding by layouts against decoding one by one, for random types and messages."""

from unittest import mock

import log_factory as forge
import numpy as np
import pytest
import schema_factory as factory
from hypothesis import given, settings
from hypothesis import strategies as st

from navirl_cli.logs.container.batches import Batch, Channel
from navirl_cli.logs.messages import decode
from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.layout import derive
from navirl_cli.logs.messages.schema import Leaf, Schema, SchemaError

#: The encoders of a run of examples, of which each message uses one.
WIRES = {
    "cdr": (factory.Wire("cdr"),),
    "cdr, big-endian": (factory.Wire("cdr", ">"),),
    "cdr, mixed": (factory.Wire("cdr"), factory.Wire("cdr", ">")),
    "ros1": (factory.Wire("ros1"),),
}


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
    # 24 + 4 + 3 = 31 of the message's bytes are used: the next double stands at 32, after 4 bytes of encapsulation
    assert offsets["pose.pose.position.x"] == 36
    assert layout.dtype.itemsize == len(payload)
    assert list(layout.checks.values()) == [0x0100, 5, 0, 3, 0]


def test_an_invalid_payload_has_no_layout(odometry):
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
    assert odometry.leaf("pose.covariance[]") == Leaf("number", "<f8", None, "pose.covariance[]")
    assert odometry.leaf("header.stamp.sec").dtype == "<i4"
    with pytest.raises(SchemaError, match="'' in"):
        parse_definition("a_msgs/msg/A", "ros2msg", "float64 x\n").leaf("x.")


def test_leaves_in_sequences():
    schema = parse_definition(forge.TF, *forge.definition(forge.TF, {}))
    assert schema.leaf("transforms[].header.stamp") == Leaf("time", "<i8", None, "transforms[]")
    assert schema.leaf("transforms[].child_frame_id") == Leaf("string", "O", None, "transforms[]")
    for path, message in (
        ("transforms", "'transforms' is not a number, text, time or fixed array of numbers"),
        ("transforms[]", r"'transforms\[\]' is not a number, text, time or fixed array of numbers"),
        ("transforms.header.stamp", "'header' in .* is below a field that is not a single message"),
        ("transforms[].header[].stamp", r"'header\[\]' in .* is not a sequence, or is inside two others"),
        ("transforms[].pose", "TransformStamped has no field 'pose' of .*; its fields are header, child_frame_id, tr"),
    ):
        with pytest.raises(SchemaError, match=message):
            schema.leaf(path)
    nested = "a_msgs/B[] b\n" + "=" * 80 + "\nMSG: a_msgs/B\nfloat64[2] x\n"
    with pytest.raises(SchemaError, match=r"'b\[\]\.x' is an array in a sequence"):
        parse_definition("a_msgs/msg/A", "ros2msg", nested).leaf("b[].x")


def test_an_array_and_its_entries_are_columns_side_by_side():
    schema = parse_definition("a_msgs/msg/A", "ros2msg", "float64[2] d\n")
    layout = derive(schema, b"\0\1\0\0" + np.array([1.5, 2.5]).tobytes(), ["d", "d[]"])
    assert (layout.dtype.fields["d"], layout.counts) == (layout.dtype.fields["d[]"], {"d[]": 2})


def test_no_python_is_parsed_for_a_layout(odometry, monkeypatch):
    """numpy parses "(3,)f8" with `ast`, and two threads at once sometimes get a SystemError (CPython issue 106905)."""
    monkeypatch.setattr("ast.literal_eval", pytest.fail)
    assert derive(odometry, forge.cdr(forge.odometry(1, 2.0, 3.0)), ["pose.covariance", "child_frame_id"]).head


def test_a_schema_is_parsed_once(odometry):
    assert isinstance(odometry, Schema)
    assert parse_definition(forge.ODOMETRY, *forge.definition(forge.ODOMETRY, {})) is odometry


def damaged(payload, rng):
    """A damaged payload."""
    at = int(rng.integers(len(payload) + 1))
    return factory.pick(
        rng,
        (
            payload[:at],
            payload[:at] + rng.bytes(int(rng.integers(9))) + payload[at:],
            payload[:at] + rng.bytes(min(4, len(payload) - at)) + payload[at + 4 :],
            payload[:at] + b"\xff\xff\xff\xff" + payload[at + 4 :],
            payload + bytes(int(rng.integers(6))),
            rng.bytes(len(payload)),
            b"\0" + rng.bytes(1) + payload[2:],
        ),
    )


def written(types, wires, rng, n=16):
    """Bytes with messages of several channels; by channel: number, place, size and message, None if damaged."""
    raw = bytearray()
    rows = [[] for _ in types]
    for number in range(n):
        channel = int(rng.integers(len(types)))
        # few plans of lengths, so that messages share their layouts
        plan = np.random.default_rng(int(rng.integers(3)))
        message = factory.value(factory.FieldType(types[channel]), plan, rng)
        payload = factory.pick(rng, wires).payload(types[channel], message)
        if rng.random() < 0.25:
            payload, message = damaged(payload, rng), None
        rows[channel].append((number, len(raw), len(payload), message))
        raw += payload + bytes(int(rng.integers(3)))
    return bytes(raw), rows


def decoded(decoder, raw, rows):
    number, start, size = (np.array([row[k] for row in rows]) for k in range(3))
    return decoder.decode(Batch(Channel(1, "/t", "t_msgs/M0", "", "", ""), raw, start, size, 7 * number, number))


def bits(column):
    """Type, shape and bytes of a column; all NaN count as one, because some machines change them when they are read."""
    if column.dtype == object:
        return column.dtype, column.shape, column.tolist()
    plain = np.where(np.isnan(column), np.nan, column) if column.dtype.kind == "f" else column
    return column.dtype, column.shape, plain.astype(column.dtype).tobytes()


def check_both_methods(fields, schema, raw, rows):
    """Check that both methods of decoding give the same columns, and for intact messages what was written."""
    paths = {path: (sequence, field_type) for path, sequence, field_type in factory.columns(fields)}
    fast, slow = decode.Decoder(schema, tuple(paths)), decode.Decoder(schema, tuple(paths))
    for some in filter(None, (rows[:4], rows[4:])):
        gathered = decoded(fast, raw, some)
        with mock.patch.object(decode, "derive", return_value=None):
            plain = decoded(slow, raw, some)
        assert gathered.order.tolist() == plain.order.tolist()
        assert gathered.log_time_ns.tolist() == [7 * number for number in plain.order]
        assert (gathered.count, bool(gathered.error)) == (len(some), len(plain.order) < len(some))
        intact = [row for row in some if row[3] is not None]
        assert {row[0] for row in intact} <= set(plain.order.tolist())
        assert all(derive(schema, raw[start : start + size], paths) for _, start, size, _ in intact)
        right = np.isin(gathered.order, [row[0] for row in intact])
        for path, (sequence, field_type) in paths.items():
            column, counts = factory.expected([row[3] for row in intact], path, sequence, field_type)
            assert bits(gathered.columns[path]) == bits(plain.columns[path])
            taken = right
            if sequence:
                assert gathered.counts[sequence].tolist() == plain.counts[sequence].tolist()
                assert gathered.counts[sequence][right].tolist() == counts.tolist()
                taken = np.repeat(right, gathered.counts[sequence])
            assert bits(gathered.columns[path][taken]) == bits(column)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@settings(max_examples=25, deadline=None, derandomize=True)
@given(types=st.lists(factory.messages(3), min_size=1, max_size=2), seed=st.integers(0, 2**32))
def test_both_methods_of_decoding_give_what_was_written(encoding, types, seed):
    ros = 1 if encoding == "ros1" else 2
    schemas = [
        parse_definition("t_msgs/M0", f"ros{ros}msg", factory.definition(fields, ros), encoding) for fields in types
    ]
    for wires in [wires for name, wires in WIRES.items() if name.startswith(encoding)]:
        raw, rows = written(types, wires, np.random.default_rng(seed))
        for fields, schema, mine in zip(types, schemas, rows, strict=True):
            check_both_methods(fields, schema, raw, mine)
