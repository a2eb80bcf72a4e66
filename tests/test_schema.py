"""Definitions that must be refused, and JSON, which has no definitions."""

import json
import re

import log_factory as forge
import numpy as np
import pytest

from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.layout import derive
from navirl_cli.logs.messages.reader import read
from navirl_cli.logs.messages.schema import DecodeError, JsonSchema, SchemaError

#: Chunks of a message each.
TINY = {"chunk_size": 1}


def test_names_and_definitions_as_recorders_write_them():
    assert parse_definition("a_msgs/A", "ros2msg", "float64 x # metres\r\n\r\nint32 y\r\n").name == "a_msgs/msg/A"
    assert parse_definition("a_msgs/A", "ros1msg", "time t\nduration[2] d\n", "ros1").leaf("d[]").value_type == "time"
    full = "a_msgs/B b\n" + "=" * 80 + "\nMSG: a_msgs/msg/B\nstring<=9[<=3] words\nfloat32[4] q 1.0\nuint8 ANY=3\n"
    assert parse_definition("a_msgs/msg/A", "ros2msg", full).leaf("b.q").count == 4


@pytest.mark.parametrize(
    ("encoding", "text", "message"),
    [
        ("jsonschema", "{}", "the messages' encoding is 'cdr' and the schema's encoding is 'jsonschema'"),
        ("ros2idl", "module a {", "its definition does not parse"),
        ("ros2msg", "a_msgs/A same\n", "its definition does not parse (TypesysError: a_msgs/msg/A contains itself)"),
        ("ros2msg", "a_msgs/A[] children\n", "(TypesysError: a_msgs/msg/A contains itself)"),
        ("ros2msg", "float64[-3] x\n", "(TypesysError: x is an array of -3 entries)"),
        ("ros2msg", "float64[99999999999999999999] x\n", "(TypesysError: x is an array of 99999999999999999999 entr"),
        ("ros2msg", "string[1000000000] names\n", "(TypesysError: names is an array of 1000000000 entries)"),
        ("ros2msg", "builtin_interfaces/Time[1001] t\n", "(TypesysError: t is an array of 1001 entries)"),
        ("ros2msg", "wstring name\n", "(TypesysError: no definition of a_msgs/msg/wstring)"),
        ("ros2msg", "float64 class\nfloat64 class_\n", "has conflicting Python names: 'class' and 'class_'"),
        (
            "ros2msg",
            "int8 x\n" + "=" * 80 + "\nMSG: builtin_interfaces/Time\nuint32 sec\n",
            "Type 'builtin_interfaces/msg/Time' is already present with different definition.",
        ),
        (
            "ros2idl",
            "module a_msgs { module msg { struct A { double x; long double y; }; }; };",
            "(TypesysError: y is a float128, which cannot be read)",
        ),
        (
            "ros2idl",
            "module a_msgs { module msg { struct A { wstring y; }; }; };",
            "(TypesysError: y is a wstring, which cannot be read)",
        ),
    ],
)
def test_invalid_definitions_are_refused(encoding, text, message):
    with pytest.raises(SchemaError) as caught:
        parse_definition("a_msgs/msg/A", encoding, text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_messages_without_fields():
    """They take one byte in CDR and none in ROS 1, where a damaged length could claim billions of them."""
    text = "a_msgs/E[] all\n" + "=" * 80 + "\nMSG: a_msgs/E\n"
    assert parse_definition("a_msgs/msg/A", "ros2msg", text).deserialize(b"\0\1\0\0\2\0\0\0\0\0").all is not None
    with pytest.raises(SchemaError, match="all is a sequence of messages without fields"):
        parse_definition("a_msgs/msg/A", "ros1msg", text, "ros1")
    one = parse_definition("a_msgs/msg/A", "ros1msg", text.replace("[]", "") + "\n", "ros1")
    assert one.deserialize(b"").__msgtype__ == "a_msgs/msg/A"


def read_json(tmp_path, messages, *fields, name="x/J", **options):
    """Read topic /j, whose messages are given as objects or as text."""
    log = [
        forge.Message("/j", name, k, one.encode() if isinstance(one, str) else json.dumps(one).encode())
        for k, one in enumerate(messages)
    ]
    definitions = {name: ("jsonschema", "{}") if name else ("", "")}
    path = forge.forge(tmp_path / "j.mcap", log, definitions=definitions, encodings={"/j": "json"}, **options)
    # with more threads, the first message that is learnt from may be in another chunk
    result = read(path, {"/j": fields}, threads=1)
    return result.series["/j"], [note.reason for note in result.damage]


@pytest.mark.parametrize(
    "spelling",
    [
        {"sec": 1_700_000_000, "nanosec": 123_456_789},
        {"sec": 1_700_000_000, "nsec": 123_456_789},
        {"secs": 1_700_000_000, "nsecs": 123_456_789},
        {"sec": "1700000000", "nanosec": "123456789"},
        {"sec": 1_700_000_000.0, "nanosec": 123_456_789.0},
    ],
)
@pytest.mark.parametrize("name", ["x/J", ""])
def test_spellings_of_times(tmp_path, spelling, name):
    messages = [{"header": {"stamp": spelling}, "all": [{"t": spelling}] * k} for k in range(3)]
    series, notes = read_json(tmp_path, messages, "header.stamp", "all[].t", name=name)
    assert notes == []
    assert series.columns["header.stamp"].tolist() == [1_700_000_000_123_456_789] * 3
    assert series.columns["all[].t"].tolist() == [1_700_000_000_123_456_789] * 3
    assert series.columns["all[].t"].dtype == np.int64
    assert series.counts["all[]"].tolist() == [0, 1, 2]


def test_numbers(tmp_path):
    """A number is a double, even if the first is written as an integer; null in JSON stands for NaN."""
    messages = [{"x": 3, "y": [1, 2]}, {"x": 0.25, "y": [None, 1e300]}, {"x": None, "y": [True, -0.0]}]
    series, notes = read_json(tmp_path, messages, "x", "y", "y[]")
    assert notes == []
    assert np.array_equal(series.columns["x"], [3.0, 0.25, np.nan], equal_nan=True)
    assert np.array_equal(series.columns["y"], [[1.0, 2.0], [np.nan, 1e300], [1.0, 0.0]], equal_nan=True)
    assert np.array_equal(series.columns["y[]"], series.columns["y"].ravel(), equal_nan=True)
    assert {column.dtype for column in series.columns.values()} == {np.dtype(np.float64)}


GOOD = {"t": {"sec": 1, "nanosec": 2}, "x": 1.5, "s": "a", "three": [1, 2, 3], "all": [{"n": "b"}]}


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"x": "1.5"}, "expected a number, found '1.5'"),
        ({"x": {"v": 1}}, "expected a number, found {'v': 1}"),
        ({"x": [1.5]}, r"expected a number, found \[1.5\]"),
        ({"x": 10**400}, "int too large to convert to float"),
        ({"s": 3}, "expected a text, found int"),
        ({"s": None}, "expected a text, found NoneType"),
        ({"t": {"seconds": 1}}, "expected a time with sec and nanosec, found keys seconds"),
        ({"t": {"sec": 1.5, "nanosec": 0}}, "expected whole seconds and nanoseconds, found 1.5"),
        ({"t": {"sec": "now", "nanosec": 0}}, "invalid literal for int"),
        ({"t": {"sec": 10**30, "nanosec": 0}}, "int too large to convert to C long"),
        ({"t": 3}, "expected a time, found int"),
        ({"t": None}, "expected a time, found NoneType"),
        ({"three": [1, 2]}, r"expected 3 numbers, found \[1, 2\]"),
        ({"three": 7}, "expected 3 numbers, found 7"),
        ({"three": [1, 2, "3"]}, "expected a number, found '3'"),
        ({"three": [1, 2, [3]]}, r"expected a number, found \[3\]"),
        ({"all": "b"}, "'all' is not a sequence"),
        ({"all": {"n": "b"}}, "'all' is not a sequence"),
        ({"all": [{"n": "b"}, None]}, r"no field 'n' of 'n'"),
        ({"all": [{"n": "b"}, {"n": 3}]}, "expected a text, found int"),
        ("{", "not JSON: Expecting property name"),
        ("[1]", "expected a JSON object, found list"),
        ("[" * 100_000, "not JSON: maximum recursion depth"),
        ("{}", "no field 't' of 't'"),
    ],
)
def test_a_message_of_another_type_is_lost_and_counted(tmp_path, wrong, error):
    odd = wrong if isinstance(wrong, str) else GOOD | wrong
    series, (note,) = read_json(tmp_path, [GOOD, odd, GOOD], "t", "x", "s", "three", "all[].n")
    assert series.log_time_ns.tolist() == [0, 2]
    assert series.columns["t"].tolist() == [1_000_000_002] * 2
    assert series.columns["three"].tolist() == [[1.0, 2.0, 3.0]] * 2
    assert series.columns["all[].n"].tolist() == ["b"] * 2
    assert re.match(rf"1 of 3 messages of /j does not decode as x/J and is lost \(.*{error}", note), note


@pytest.mark.parametrize("path", ["values", "x.count", "y.real", "s.upper", "z.append"])
def test_attributes_of_python_objects_are_not_fields(tmp_path, path):
    series, (note,) = read_json(tmp_path, [{"x": [1], "y": 2, "s": "a", "z": []}], path)
    assert len(series) == 0
    assert f"the only message of /j does not decode as x/J and is lost (no field '{path.split('.')[-1]}' of" in note


def test_types_are_learnt_from_the_first_message_with_the_field(tmp_path):
    """Empty lists and messages without the field come first and are skipped."""
    first = [{"names": [], "three": [], "all": []}, {"pad": "x"}, "no JSON"]
    then = {"names": ["a", "b"], "three": [1, 2, 3], "all": [{"t": {"sec": 1, "nsec": 0}}]}
    series, (note,) = read_json(tmp_path, [*first, then, then], "names[]", "three", "all[].t")
    assert series.columns["names[]"].tolist() == ["a", "b"] * 2
    assert series.columns["three"].tolist() == [[1.0, 2.0, 3.0]] * 2
    assert series.columns["all[].t"].tolist() == [10**9] * 2
    # a fixed array cannot be empty: the first message is lost too
    assert note.startswith("3 of 5 messages of /j")


def test_times_are_exact_if_the_first_chunk_lacks_the_field(tmp_path):
    then = {"t": {"sec": 1_700_000_000, "nanosec": 123_456_789}}
    series, _ = read_json(tmp_path, [{}, *[then] * 9], "t", **TINY)
    assert series.columns["t"].tolist() == [1_700_000_000_123_456_789] * 9


def test_arrays_are_read_if_the_first_chunk_lacks_the_field(tmp_path):
    series, _ = read_json(tmp_path, [{}, *[{"q": [1, 2, 3]}] * 9], "q", **TINY)
    assert series.columns["q"].shape == (9, 3)


def test_channels_do_not_learn_from_each_other(tmp_path):
    assert parse_definition("", "", "", "json") is not parse_definition("", "", "", "json")
    for value, expected in ((1.5, [1.5]), ("text", ["text"])):
        series, notes = read_json(tmp_path, [{"x": value}], "x", name="")
        assert (series.columns["x"].tolist(), notes) == (expected, [])


def test_types_that_were_learnt_stay():
    schema = JsonSchema("x/J")
    assert schema.leaf("x").value_type == "number"
    assert not schema.learn(b'{"y": 1}', ("x", "y"))
    assert schema.learn(b'{"x": "a", "y": "b"}', ("x", "y"))
    assert (schema.leaf("x").value_type, schema.leaf("y").value_type) == ("string", "number")


def huge(count):
    return "".join(f"float64 field_{number}\n" for number in range(count))


def test_no_code_is_generated_for_a_definition_of_many_fields():
    """rosbags needs minutes for 60,000 fields; its parser and the layout take time in proportion."""
    schema = parse_definition("x_msgs/msg/Huge", "ros2msg", huge(6000))
    assert schema.leaf("field_5999").value_type == "number"
    payload = b"\0\1\0\0" + np.arange(6000.0).tobytes()
    layout = derive(schema, payload, ["field_5999"])
    assert layout is not None
    assert np.frombuffer(payload, layout.dtype)["field_5999"][0] == 5999.0
    assert "store" not in vars(schema)
    with pytest.raises(DecodeError, match="its definition has 6004 fields; at most 5000 are decoded one by one"):
        schema.deserialize(payload)


def test_messages_within_messages_have_a_depth():
    def nested(depth):
        parts = [f"A{number + 1} a\n" + "=" * 80 + f"\nMSG: a_msgs/A{number + 1}\n" for number in range(depth)]
        return "".join(parts) + "int8 x\n"

    assert parse_definition("a_msgs/msg/A0", "ros2msg", nested(40)).leaf(".".join("a" * 40) + ".x")
    for depth in (60, 2000):
        with pytest.raises(SchemaError, match="its definition does not parse"):
            parse_definition("a_msgs/msg/A0", "ros2msg", nested(depth))
