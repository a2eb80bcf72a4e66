"""Channels that are not what they claim: each spoils itself only, and is named."""

import re
from dataclasses import dataclass

import log_factory as forge
import pytest

from navirl_cli.logs.messages.reader import read

WRENCH_FIELDS = ("header.stamp", "header.frame_id", "wrench.force.x")
WRENCH_PAYLOAD = forge.cdr(forge.wrench(0, (1, 2, 3)))


@dataclass(frozen=True)
class Claim:
    """A channel and what is said of it."""

    note: str
    name: str = "w_msgs/msg/W"
    #: The schema's encoding and text.
    schema: tuple[str, str] = forge.definition(forge.WRENCH, {})
    encoding: str = "cdr"
    payload: bytes = WRENCH_PAYLOAD
    field: str = "wrench.force.x"
    #: Whether its messages are tried.
    tried: bool = False


CLAIMS = {
    "unparsable": Claim(
        "topic /x: expected cdr with ros2msg or ros2idl, ros1 with ros1msg, or json, found message encoding 'cdr', "
        r"schema 'w_msgs/msg/W' \(ros2msg\): its definition does not parse \(TypesysError: Could not parse:\); its me"
        "ssages are lost",
        schema=("ros2msg", "[no definition"),
    ),
    "incomplete": Claim(
        r"definition does not parse \(TypesysError: no definition of std_msgs/msg/Header\); its messages are lost",
        schema=("ros2msg", "std_msgs/Header header\n"),
    ),
    "no schema": Claim(
        "topic /x: a schema without a name has no definition in the file, so that its messages cannot be decoded; rec",
        name="",
        schema=("", ""),
    ),
    "empty schema": Claim(
        "topic /x: .*w_msgs/msg/W has no field 'wrench' of 'wrench.force.x'; its fields are none; its messages are los",
        schema=("ros2msg", ""),
    ),
    "service event": Claim(
        r"topic /x: .*schema 'std_srvs/srv/SetBool_Event' \(ros2msg\): its definition does not parse .*; its messages ",
        name="std_srvs/srv/SetBool_Event",
        schema=("ros2msg", "bool data\n---\nbool success\nstring message\n"),
    ),
    "protobuf": Claim(
        "topic /x: .*: the messages' encoding is 'protobuf' and the schema's encoding is 'protobuf'; its messages are",
        schema=("protobuf", "\n\2ab"),
        encoding="protobuf",
    ),
    "ros1 with a schema of ROS 2": Claim(
        "topic /x: .*: the messages' encoding is 'ros1' and the schema's encoding is 'ros2msg'; its messages are lost",
        encoding="ros1",
    ),
    "no such field": Claim(
        "Vector3 has no field 'w' of 'wrench.force.w'; its fields are x, y, z; its messages are lost",
        field="wrench.force.w",
    ),
    "no column": Claim(
        "'wrench.force' is not a number, text, time or fixed array of numbers; its messages are lost",
        field="wrench.force",
    ),
    "below a column": Claim(
        "'y' in 'wrench.force.x.y' is below a field that is not a single message; its messages are lost",
        field="wrench.force.x.y",
    ),
    "cdr that is json": Claim(
        r"all 5 messages of /x do not decode as w_msgs/msg/W and are lost \(expected plain CDR.* found 0x7b22\)",
        payload=b'{"force": 3}',
        tried=True,
    ),
    "parameter list": Claim(
        r"all 5 messages of /x do not decode as w_msgs/msg/W and are lost \(expected plain CDR.* found 0x0003\)",
        payload=b"\0\3" + WRENCH_PAYLOAD[2:],
        tried=True,
    ),
    "the second version of CDR": Claim(
        r"all 5 messages of /x do not decode as w_msgs/msg/W and are lost \(expected .* found XCDR2, 0x0007\)",
        payload=b"\0\7" + WRENCH_PAYLOAD[2:],
        tried=True,
    ),
    "another type": Claim(
        r"all 5 messages of /x do not decode .* \(CDR message size mismatch for 'w_msgs/msg/W'\.\)",
        payload=forge.cdr(forge.odometry(0, 1.0, 2.0)),
        tried=True,
    ),
    "ros1 that is cdr": Claim(
        r"all 5 messages of /x do not decode .* \(ROS1 message size mismatch for 'w_msgs/msg/W'\.\)",
        schema=("ros1msg", "float64 x\n"),
        encoding="ros1",
        payload=b"\0\1\0\0" + bytes(8),
        field="x",
        tried=True,
    ),
    "json that is cdr": Claim(
        r"all 5 messages of /x do not decode as w_msgs/msg/W and are lost \(not JSON: ",
        schema=("jsonschema", "{}"),
        encoding="json",
        tried=True,
    ),
}


@pytest.mark.parametrize("claim", CLAIMS.values(), ids=CLAIMS.keys())
def test_a_false_claim_spoils_its_own_channel_only(tmp_path, claim):
    lies = [forge.Message("/x", claim.name, forge.START_NS + k, claim.payload) for k in range(5)]
    run = forge.run(40)
    path = forge.forge(
        tmp_path / "run.mcap",
        [*run[:20], *lies, *run[20:]],
        definitions={claim.name: claim.schema},
        encodings={"/x": claim.encoding},
    )
    result = read(path, {"/x": (claim.field,), "/wrench": WRENCH_FIELDS})
    (note,) = result.damage
    assert re.search(claim.note, note.reason), note.reason
    assert "\n" not in str(note)
    assert len(result.series["/wrench"]) == 40
    assert ("/x" in result.series) == claim.tried
    assert not claim.tried or len(result.series["/x"]) == 0


def test_unwanted_channels_never_spoil_a_read(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(40), encodings={"/camera": "json"})
    assert len(read(path, {"/wrench": WRENCH_FIELDS}).series["/wrench"]) == 40


def test_of_two_types_on_one_topic_the_first_is_read(tmp_path):
    one, two = forge.run(1)[:2]
    mixed = [forge.Message("/x", one.typename, 1, one.payload), forge.Message("/x", two.typename, 2, two.payload)]
    path = forge.forge(tmp_path / "run.mcap", mixed, channel_for={1: 1})
    result = read(path, {"/x": ("header.stamp",)})
    assert result.series["/x"].log_time_ns.tolist() == [1]
    (note,) = result.damage
    assert note.reason == (
        "topic /x: expected geometry_msgs/msg/WrenchStamped, as in its other channels, found nav_msgs/msg/Odometry, "
        "which is ignored"
    )


def two_definitions(tmp_path, *texts):
    """Two files of a topic whose type has grown between them; both have 16 bytes of data."""
    payload = b"\0\1\0\0\3\0\0\0ab\0\0" + bytes(8)
    return [
        forge.forge(
            tmp_path / f"{number}.mcap",
            [forge.Message("/x", "a_msgs/msg/A", number, payload)],
            definitions={"a_msgs/msg/A": ("ros2msg", text)},
        )
        for number, text in enumerate(texts)
    ]


def test_fields_that_both_definitions_have_are_read_from_both(tmp_path):
    paths = two_definitions(tmp_path, "string s\nfloat64 x\n", "string s\nuint32 other\nuint32 last\n")
    result = read(paths, {"/x": ("s",)})
    assert (result.series["/x"].columns["s"].tolist(), result.damage) == (["ab", "ab"], ())


@pytest.mark.parametrize(
    ("field", "texts"),
    [
        ("d", ("uint32[4] d\n", "uint32[3] d\nuint32 last\n")),
        ("d", ("uint32[4] d\n", "uint32 d\nuint32[3] rest\n")),
        ("s", ("string s\nfloat64 x\n", "uint32 s\nuint32[3] rest\n")),
        ("t", ("builtin_interfaces/Time t\nfloat64 x\n", "float64 t\nfloat64 x\n")),
    ],
)
def test_fields_that_two_definitions_disagree_on_are_not_mixed(tmp_path, field, texts):
    result = read(two_definitions(tmp_path, *texts), {"/x": (field,)})
    assert result.series["/x"].log_time_ns.tolist() == [0]
    (note,) = result.damage
    assert note.reason.startswith("topic /x: ")
