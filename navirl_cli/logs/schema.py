"""Message definitions as they are embedded in a log, parsed by rosbags' type system."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError, normalize_fieldname
from rosbags.typesys.store import Typestore

TIMES: Final = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})

#: numpy's type of each primitive in little-endian CDR; a bool is one byte.
PRIMITIVES: Final = {
    "bool": "?",
    "byte": "i1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "<i2",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "float32": "<f4",
    "float64": "<f8",
}

_SEPARATOR: Final = "=" * 80 + "\n"
#: What rosbags' parsers and its code generator raise on text that defines no message.
_PARSER_ERRORS: Final = (TypesysError, SyntaxError, LookupError, ValueError, TypeError, AttributeError, AssertionError)


class SchemaError(Exception):
    """A definition does not parse, or a field is not in it; the message says why."""


@dataclass(frozen=True)
class Leaf:
    """A field that becomes a column."""

    #: "time" (becomes int64 ns), "string" (becomes an object array) or "number".
    kind: str
    #: numpy's type of one entry of the column.
    dtype: str
    #: Number of entries a message of a fixed array; None for a single value.
    count: int | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one message's value."""
        return () if self.count is None else (self.count,)


@dataclass(frozen=True, eq=False)
class Schema:
    """A message type with every type it contains, apart from all other channels' types."""

    #: Full name, "geometry_msgs/msg/WrenchStamped".
    name: str
    store: Typestore

    def fields(self, typename: str) -> list[tuple[str, FieldDesc]]:
        """Names and types of a contained type's fields, in the order of the bytes."""
        return self.store.fielddefs[typename][1]

    def leaf(self, path: str) -> Leaf:
        """The kind of a dotted field.

        Raises:
            SchemaError: There is no such field, or it does not become a column.
        """
        desc: FieldDesc = (Nodetype.NAME, self.name)
        for part in path.split("."):
            if desc[0] != Nodetype.NAME:
                raise SchemaError(f"{part!r} in {path!r} lies below a field that is no single message")
            fields = dict(self.fields(desc[1]))
            if part not in fields:
                raise SchemaError(f"{desc[1]} has no field {part!r} of {path!r}; its fields are {', '.join(fields)}")
            desc = fields[part]
        return _leaf(path, desc)

    def deserialize(self, payload: bytes) -> object:
        """The message object of a CDR payload (rosbags' SerdeError if it is none)."""
        return self.store.deserialize_cdr(payload, self.name)


def value_at(message: object, path: str) -> object:
    """The value of a dotted field of a message object."""
    value = message
    for part in path.split("."):
        value = getattr(value, normalize_fieldname(part))
    return value


@lru_cache(maxsize=256)
def parse_definition(name: str, encoding: str, text: str) -> Schema:
    """Parse a message definition.

    Args:
        name: Message type, "geometry_msgs/msg/WrenchStamped" or "geometry_msgs/WrenchStamped".
        encoding: "ros2msg" or "ros2idl".
        text: The definition followed by those of the contained types, as rosbag2 embeds them.

    Returns:
        The type in a store of its own: two channels may define one name differently.

    Raises:
        SchemaError: The encoding is another one, or the text does not define the type.
    """
    if encoding not in {"ros2msg", "ros2idl"}:
        raise SchemaError(f"the schema's encoding is {encoding!r}")
    full = name if name.count("/") != 1 else name.replace("/", "/msg/")
    text = text.replace("\r\n", "\n")
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(text, full) if encoding == "ros2msg" else _types_from_idl(text))
        _check_complete(store, full)
        store.get_msgdef(full)
    except _PARSER_ERRORS as error:
        first = (str(error).splitlines() or [""])[0][:120]
        raise SchemaError(f"its definition does not parse ({type(error).__name__}: {first})") from error
    return Schema(full, store)


def _types_from_idl(text: str) -> Typesdict:
    """Types of one IDL text, or of several with rosbag2's separators."""
    if not text.startswith(_SEPARATOR):
        return get_types_from_idl(text)
    types: Typesdict = {}
    for part in text.split(_SEPARATOR)[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def _check_complete(store: Typestore, name: str) -> None:
    """Every type that is used must be defined."""
    missing = {used for owner in store.fielddefs for used in _uses(store, owner)} | {name}
    if missing := missing - store.fielddefs.keys():
        raise TypesysError(f"no definition of {', '.join(sorted(missing))}")


def _uses(store: Typestore, owner: str) -> Iterator[str]:
    for _, desc in store.fielddefs[owner][1]:
        inner = desc[1][0] if desc[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else desc
        if inner[0] == Nodetype.NAME:
            yield str(inner[1])


def _leaf(path: str, desc: FieldDesc) -> Leaf:
    """The leaf of a field's type."""
    if desc[0] == Nodetype.NAME and desc[1] in TIMES:
        return Leaf("time", "<i8")
    inner, count = desc[1] if desc[0] == Nodetype.ARRAY else (desc, None)
    if inner[0] == Nodetype.BASE:
        if inner[1][0] == "string" and count is None:
            return Leaf("string", "O")
        if inner[1][0] in PRIMITIVES:
            return Leaf("number", PRIMITIVES[inner[1][0]], count)
    raise SchemaError(f"{path!r} is no number, text, time or fixed array of numbers; read whole messages instead")
