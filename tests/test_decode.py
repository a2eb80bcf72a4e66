"""Decoding: encodings, definitions, and payloads that do not decode."""

import log_factory as forge
import numpy as np
import pytest
from rosbags.interfaces import Nodetype

from navirl_cli.logs.container.batches import Batch, Channel
from navirl_cli.logs.messages import decode
from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.reader import read

WRENCH_FIELDS = ("header.stamp", "header.frame_id", "wrench.force.x", "wrench.force.z", "wrench.torque.y")
TF_FIELDS = tuple(
    f"transforms[].{name}"
    for name in ("header.stamp", "header.frame_id", "child_frame_id", "transform.translation.y", "transform.rotation.z")
)
#: Messages of each type and the fields to read.
SAMPLES = {
    forge.WRENCH: ([forge.wrench(10**9 + k, (k, -k, 0.5), "ab"[: k % 3]) for k in range(9)], WRENCH_FIELDS),
    forge.ODOMETRY: (
        [forge.odometry(k, k, 0.25) for k in range(5)],
        ("header.stamp", "child_frame_id", "pose.covariance", "twist.twist.angular.z"),
    ),
    forge.TF: ([forge.transforms(k, "abc"[: k % 4], k) for k in range(9)], TF_FIELDS),
    forge.JOY: ([forge.joy(k, [0.5] * (k % 3), [k] * 2) for k in range(9)], ("header.stamp", "axes[]", "buttons[]")),
}


def check_same(path, fields):
    """The columns of topic /t must be those that the slow twin reads; returns them."""
    result = read(path, {"/t": fields})
    assert result.damage == ()
    series, slow = result.series["/t"], forge.slow_read(path, "/t")
    assert len(series) == len(slow) > 0
    for name in fields:
        found = [forge.entries(message, name) for _, message in slow]
        if "[]" in name:
            assert series.counts[name.partition("[]")[0] + "[]"].tolist() == [len(some) for some in found]
        assert np.array_equal(series.columns[name], np.array([one for some in found for one in some])), name
    return series


@pytest.mark.parametrize("typename", SAMPLES)
def test_ros1(tmp_path, typename):
    messages, fields = SAMPLES[typename]
    text = forge.ROS1.generate_msgdef(typename, ros_version=1)[0].replace("std_msgs/Header header", "Header header")
    assert "time stamp" in text
    assert ("Header header" in text, "uint32 seq" in text) == (True, True)
    name = typename.replace("/msg/", "/")
    log = [
        forge.Message("/t", name, k, bytes(forge.ROS1.serialize_ros1(forge.in_ros1(message), typename)))
        for k, message in enumerate(messages)
    ]
    path = forge.forge(tmp_path / "run.mcap", log, definitions={name: ("ros1msg", text)}, encodings={"/t": "ros1"})
    number = "transforms[].header.seq" if typename == forge.TF else "header.seq"
    series = check_same(path, (*fields, number))
    assert set(series.columns[number].tolist()) == {7}
    assert series.columns[number].dtype == np.uint32


def idl(typename):
    """A type's definition as rosbag2 stores it where one of its types comes from an IDL file."""
    words = {"float64": "double", "float32": "float", "bool": "boolean", "byte": "octet"}
    texts, todo = {}, [typename]
    for name in todo:
        typedefs, fields = "", ""
        for field, desc in forge.STORE.fielddefs[name][1]:
            inner = desc[1][0] if desc[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else desc
            word = inner[1].replace("/", "::") if inner[0] == Nodetype.NAME else words.get(inner[1][0], inner[1][0])
            todo += [inner[1]] if inner[0] == Nodetype.NAME and inner[1] not in todo else []
            if desc[0] == Nodetype.ARRAY:
                typedefs += f"    typedef {word} {word}__{desc[1][1]}[{desc[1][1]}];\n"
                word = f"{word}__{desc[1][1]}"
            word = f"sequence<{word}>" if desc[0] == Nodetype.SEQUENCE else word
            fields += (
                f'      @verbatim (language="comment", text=\n        "# of {field};" "\\n")\n      {word} {field};\n\n'
            )
        package, _, short = name.split("/")
        texts[name] = (
            f"{'=' * 80}\nIDL: {name}\n// generated from rosidl_adapter/resource/msg.idl.em\n\n"
            f'#include "builtin_interfaces/msg/Time.idl"\n#include "std_msgs/msg/Header.idl"\n\nmodule {package} {{\n'
            f"  module msg {{\n    module {short}_Constants {{\n      const uint8 NONE = 1;\n    }};\n{typedefs}"
            f"    struct {short} {{\n{fields}    }};\n  }};\n}};\n"
        )
    return "".join(texts.values())


@pytest.mark.parametrize("typename", SAMPLES)
def test_idl_as_rosbag2_stores_it(tmp_path, typename):
    messages, fields = SAMPLES[typename]
    log = [forge.Message("/t", typename, k, forge.cdr(message)) for k, message in enumerate(messages)]
    # Joy with the line ends of Windows
    text = idl(typename).replace("\n", "\r\n" if typename == forge.JOY else "\n")
    check_same(forge.forge(tmp_path / "run.mcap", log, definitions={typename: ("ros2idl", text)}), fields)


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
    series = read(path, {"/d": ("b", "s", "o", "i", "d", "u", "names[]")}).series["/d"]
    columns = series.columns
    assert columns["b"].dtype == np.bool_
    assert columns["d"].tolist() == [[0.5, 2.0]] * 3
    assert [columns[name][2] for name in ("b", "s", "o", "i", "u")] == [True, "hi", 127, -3, 2**63]
    assert (columns["names[]"].tolist(), series.counts["names[]"].tolist()) == (["a", ""] * 3, [2, 2, 2])


def test_conflicting_definitions_of_two_channels_are_kept_apart(tmp_path):
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


def batch_of(payloads):
    sizes = np.array([len(payload) for payload in payloads])
    places = np.cumsum(sizes) - sizes
    return Batch(Channel(1, "/t", "", "", "", ""), b"".join(payloads), places, sizes, places, np.arange(len(sizes)))


@pytest.mark.parametrize("gathered", [True, False])
def test_any_byte_but_zero_of_a_bool_is_true(monkeypatch, gathered):
    if not gathered:
        monkeypatch.setattr(decode, "derive", lambda *_: None)
    schema = parse_definition("a_msgs/msg/A", "ros2msg", "bool[2] two\nbool[] any\nbool one\n")
    payload = b"\0\1\0\0\2\0\0\0\2\0\0\0\0\xff\x80"
    decoded = decode.Decoder(schema, ("two", "any[]", "one")).decode(batch_of([payload] * 9))
    for path, expected in (("two", [[True, False]] * 9), ("any[]", [False, True] * 9), ("one", [True] * 9)):
        assert decoded.columns[path].tolist() == expected
        assert set(decoded.columns[path].tobytes()) <= {0, 1}


@pytest.mark.parametrize("path", ["word", "other"])
def test_a_message_whose_text_is_not_utf8_does_not_decode(path):
    """This holds for texts that are not wanted, too, so that both methods of decoding lose the same messages."""
    schema = parse_definition("a_msgs/msg/A", "ros2msg", "string word\nstring other\n")
    good, bad = b"\0\1\0\0\3\0\0\0\xc3\xbc\0\0\2\0\0\0o\0", b"\0\1\0\0\3\0\0\0\xff\xbc\0\0\2\0\0\0o\0"
    decoded = decode.Decoder(schema, (path,)).decode(batch_of([good, bad, good]))
    assert decoded.columns[path].tolist() == [{"word": "ü", "other": "o"}[path]] * 2
    assert (decoded.order.tolist(), decoded.count) == ([0, 2], 3)
    assert "'utf-8' codec can't decode byte 0xff" in decoded.error


def test_equal_messages_that_do_not_decode_are_decoded_once(monkeypatch):
    """A small chunk can unpack to millions of empty messages."""
    tried = []
    schema = parse_definition("a_msgs/msg/A", "ros2msg", "string word\n")
    whole = type(schema).deserialize
    monkeypatch.setattr(type(schema), "deserialize", lambda self, data: tried.append(data) or whole(self, data))
    good, bad, worse = b"\0\1\0\0\3\0\0\0ab\0", b"\0\1\0\0\3\0\0\0\xffb\0", b"\0\1\0\0\x09\0\0\0ab\0"
    decoded = decode.Decoder(schema, ("word",)).decode(batch_of([b"", bad, worse, good, *[b"", worse] * 500]))
    assert (decoded.order.tolist(), decoded.count) == ([3], 1004)
    assert decoded.columns["word"].tolist() == ["ab"]
    assert len(tried) < 10


def test_messages_smaller_than_the_array_of_their_definition_take_no_memory(tmp_path):
    definitions = {"a_msgs/msg/A": ("ros2msg", "float64[200000000] d\n")}
    messages = [forge.Message("/a", "a_msgs/msg/A", k, b"\0\1\0\0" + bytes(288)) for k in range(50)]
    result = read(forge.forge(tmp_path / "run.mcap", messages, definitions=definitions), {"/a": ("d",)})
    assert result.series["/a"].columns["d"].shape == (0, 200_000_000)
    (damage,) = result.damage
    assert "all 50 messages of /a do not decode" in damage.reason
    assert "(expected an array of 1600000000 bytes, found messages of up to 292 bytes)" in damage.reason


def test_one_message_that_does_not_decode_is_damage(tmp_path):
    messages = forge.run(30)
    messages[0] = forge.Message("/wrench", forge.WRENCH, messages[0].log_time_ns, messages[0].payload[:20])
    path = forge.forge(tmp_path / "run.mcap", messages)
    result = read(path, {"/wrench": WRENCH_FIELDS})
    assert "1 of 30 messages of /wrench does not decode as geometry_msgs/msg/WrenchStamped and is lost" in str(
        result.damage[0]
    )
    assert np.array_equal(
        result.series["/wrench"].log_time_ns, [m.log_time_ns for m in messages[1:] if m.topic == "/wrench"]
    )
