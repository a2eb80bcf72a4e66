"""Definitions of messages that are embedded in a log, as schemas; those that nobody can read are refused."""

import re
from functools import lru_cache
from typing import Final

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError, normalize_fieldname

from navirl_cli.logs.messages.schema import (
    FILLER,
    PARSER_ERRORS,
    PRIMITIVES,
    AnySchema,
    JsonSchema,
    Schema,
    SchemaError,
    entry_of,
    first_line,
    full_name,
)

_SEPARATOR: Final = "=" * 80 + "\n"
#: Most entries of a fixed array of texts or messages, for each of which rosbags generates code; and of numbers.
_MAX_WRITTEN_OUT, _MAX_ARRAY = 1000, 1 << 28
#: Most messages within messages within messages.
_MAX_NESTED: Final = 50
#: Schema encodings by message encoding; JSON messages need no schema.
ENCODINGS: Final = {"cdr": ("ros2msg", "ros2idl"), "ros1": ("ros1msg",), "json": None}


def parse_definition(name: str, encoding: str, text: str, message_encoding: str = "cdr") -> AnySchema:
    """Parse a message definition.

    Args:
        name: Message type, "geometry_msgs/msg/WrenchStamped" or "geometry_msgs/WrenchStamped".
        encoding: "ros2msg", "ros2idl" or "ros1msg"; ignored for JSON messages.
        text: The definition, followed by those of the contained types, as rosbag2 embeds them.
        message_encoding: "cdr", "ros1" or "json".

    Returns:
        The type in a store of its own, because two channels may define one name differently. A text is parsed once.

    Raises:
        SchemaError: The encodings are not supported, or the text does not define the type.
    """
    full = full_name(name)
    fitting = ENCODINGS.get(message_encoding, ())
    if fitting is None:
        return JsonSchema(full)
    if encoding not in fitting:
        raise SchemaError(f"the messages' encoding is {message_encoding!r} and the schema's encoding is {encoding!r}")
    return _parsed(full, encoding, text.replace("\r\n", "\n"), message_encoding)


@lru_cache(maxsize=256)
def _parsed(full: str, encoding: str, text: str, message_encoding: str) -> Schema:
    try:
        found = _types_from_idl(text) if encoding == "ros2idl" else get_types_from_msg(text, full)
        schema = Schema(full, _with_times(found), message_encoding)
        _check(schema)
    except (*PARSER_ERRORS, RecursionError) as error:
        raise SchemaError(f"its definition does not parse ({first_line(error)})") from error
    return schema


def _with_times(found: Typesdict) -> Typesdict:
    """Parsed types, each with a field, and times, which are primitives in ROS 1.

    Raises:
        TypesysError: The text defines a time in another way.
    """
    times = get_typestore(Stores.EMPTY).fielddefs
    for name in times.keys() & found.keys():
        if [(field.lower(), desc) for field, desc in found[name][1]] != times[name][1]:
            raise TypesysError(f"Type {name!r} is already present with different definition.")
    filler: list[tuple[str, FieldDesc]] = [(FILLER, (Nodetype.BASE, ("uint8", 0)))]
    return {**{name: (constants, fields or filler) for name, (constants, fields) in found.items()}, **times}


def _types_from_idl(text: str) -> Typesdict:
    """Types of one IDL text, or of several with rosbag2's separators, where included types follow."""
    text = re.sub(r"(?m)^[ \t]*#.*$", "", text)
    if not text.startswith(_SEPARATOR):
        return get_types_from_idl(text)
    types: Typesdict = {}
    for definition in text.split(_SEPARATOR)[1:]:
        types.update(get_types_from_idl(definition.partition("\n")[2]))
    return types


def _check(schema: Schema) -> None:
    """Check that every type is defined, and that nothing keeps rosbags busy for ever."""
    known = schema.types
    fields = [(name, desc, entry_of(desc)) for owner in known for name, desc in schema.fields(owner)]
    used = {entry[1] for _, _, entry in fields if entry[0] == Nodetype.NAME} | {schema.name}
    if missing := used - known.keys():
        raise TypesysError(f"no definition of {', '.join(sorted(map(str, missing)))}")
    _check_nesting(schema)
    for owner, (_, listed) in known.items():
        # rosbags makes attributes of the fields
        _check_names(owner, [name for name, _ in listed])
    for name, desc, entry in fields:
        number = entry[0] == Nodetype.BASE and entry[1][0] != "string"
        if number and entry[1][0] not in PRIMITIVES:
            raise TypesysError(f"{name} is a {entry[1][0]}, which cannot be read")
        size = desc[1][1] if desc[0] == Nodetype.ARRAY else 0
        if not 0 <= size <= (_MAX_ARRAY if number else _MAX_WRITTEN_OUT):
            raise TypesysError(f"{name} is an array of {size} entries")
        if desc[0] == Nodetype.SEQUENCE and entry[0] == Nodetype.NAME and not schema.fields(entry[1]):
            raise TypesysError(f"{name} is a sequence of messages without fields")


def _check_nesting(schema: Schema) -> None:
    """Check that no type contains itself, nor messages so deep that rosbags cannot follow."""
    depths: dict[str, int] = {}

    def depth(typename: str, above: tuple[str, ...]) -> int:
        if typename in above:
            raise TypesysError(f"{typename} contains itself")
        if typename not in depths:
            entries = [entry_of(desc) for _, desc in schema.types[typename][1]]
            inner = {str(entry[1]) for entry in entries if entry[0] == Nodetype.NAME}
            depths[typename] = 1 + max((depth(one, (*above, typename)) for one in sorted(inner)), default=0)
        if len(above) + depths[typename] > _MAX_NESTED:
            raise TypesysError(f"{schema.name} holds messages in messages more than {_MAX_NESTED} deep")
        return depths[typename]

    depth(schema.name, ())


def _check_names(owner: str, names: list[str]) -> None:
    """Check that the fields of a type have different names, in Python too."""
    taken: dict[str, str] = {}
    for name in names:
        other = taken.setdefault(normalize_fieldname(name), name)
        if other is not name:
            raise TypesysError(f"{owner} has conflicting Python names: {other!r} and {name!r}")
