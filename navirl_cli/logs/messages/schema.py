"""Message definitions that are embedded in a log, parsed by rosbags' type system."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import TypesysError, normalize_fieldname
from rosbags.typesys.store import Typestore

from navirl_cli.errors import MOST_NAMES

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

#: What rosbags' parsers and code generator raise on an invalid definition.
PARSER_ERRORS: Final = (TypesysError, SyntaxError, LookupError, ValueError, TypeError, AttributeError, AssertionError)
#: Most fields of a definition for which rosbags generates code, in a time that grows with their square.
_MAX_GENERATED: Final = 5000
#: The field that rosbags gives to a message without fields: a byte in CDR, nothing in ROS 1.
FILLER: Final = "structure_needs_at_least_one_member"

#: The first two bytes of a CDR message: the byte order.
ENCAPSULATIONS: Final = {b"\0\1": "<", b"\0\0": ">"}
#: Those of the second version of CDR, which aligns numbers of 8 bytes to 4.
_XCDR2: Final = frozenset(bytes([0, second]) for second in range(6, 12))


class SchemaError(Exception):
    """A definition does not parse or lacks a field; the message gives the reason."""


class DecodeError(Exception):
    """A payload is not a message of its type; the message gives the reason."""


@dataclass(frozen=True)
class Leaf:
    """A field that becomes a column."""

    #: "time" (becomes int64 ns), "string" (becomes an object array) or "number".
    value_type: str
    #: numpy's type of one entry of the column.
    dtype: str
    #: Number of entries of a fixed array; None for a single value.
    count: int | None = None
    #: The sequence that holds the field, "transforms[]"; its column has the entries of all messages in order.
    sequence: str | None = None
    #: Whether each entry holds a sequence of its own, "detections[].results[].score": an entry of the column is a list.
    nested: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the value of one message."""
        return () if self.count is None else (self.count,)


@dataclass(frozen=True, eq=False)
class Schema:
    """A message type with every type that it contains."""

    #: Full name, "geometry_msgs/msg/WrenchStamped".
    name: str
    #: Constants and fields by the name of the type, of this type and of all that the definition contains.
    types: Typesdict
    #: How payloads are encoded, "cdr" or "ros1".
    encoding: str = "cdr"

    @cached_property
    def store(self) -> Typestore:
        """The types with the code that decodes them, which is generated when the first message needs it.

        Raises:
            DecodeError: rosbags cannot generate code for the types.
        """
        count = sum(len(fields) for _, fields in self.types.values())
        if count > _MAX_GENERATED:
            raise DecodeError(f"its definition has {count} fields; at most {_MAX_GENERATED} are decoded one by one")
        store = get_typestore(Stores.EMPTY)
        try:
            store.register({name: one for name, one in self.types.items() if name not in store.fielddefs})
            store.get_msgdef(self.name)
        except (*PARSER_ERRORS, RecursionError) as error:
            raise DecodeError(f"no code for its definition ({first_line(error)})") from error
        return store

    def fields(self, typename: str) -> list[tuple[str, FieldDesc]]:
        """Names and types of the fields of a contained type, in the order of the bytes."""
        fields = self.types[typename][1]
        return fields if self.encoding == "cdr" else [one for one in fields if one[0] != FILLER]

    def leaf(self, path: str) -> Leaf:
        """The leaf of a dotted field.

        "poses[].position.x" is a field of every entry of a sequence, "objects[].position[0]" a number of a fixed array,
        and "detections[].results[].score" a list for every entry.

        Raises:
            SchemaError: The type has no such field, or the field cannot become a column.
        """
        desc: FieldDesc = (Nodetype.NAME, self.name)
        sequences: list[str] = []
        for number, step in enumerate(steps := path.split(".")):
            if desc[0] != Nodetype.NAME:
                raise SchemaError(f"{step!r} in {path!r} is below a field that is not a single message")
            name, bracket, inside = step.partition("[")
            fields = dict(self.fields(desc[1]))
            if name not in fields:
                raise SchemaError(f"{desc[1]} has no field {name!r} of {path!r}; its fields are {_listed(fields)}")
            desc = fields[name]
            if bracket and inside != "]":
                desc = _one_of(desc, step, path)
            elif bracket:
                if desc[0] not in {Nodetype.ARRAY, Nodetype.SEQUENCE} or len(sequences) > 1:
                    raise SchemaError(f"{step!r} in {path!r} is not a sequence, or is inside two others")
                desc = desc[1][0]
                sequences.append(".".join(steps[: number + 1]))
        leaf = _leaf(path, desc)
        if sequences and leaf.count is not None:
            raise SchemaError(f"{path!r} is an array in a sequence")
        if len(sequences) > 1:
            return Leaf(leaf.value_type, "O", None, sequences[0], nested=True)
        return Leaf(leaf.value_type, leaf.dtype, leaf.count, sequences[0] if sequences else None)

    def deserialize(self, payload: bytes) -> Any:
        """The message object of a payload.

        Raises:
            DecodeError: It is not a message of this type.
        """
        if self.encoding == "cdr" and (found := payload[:2]) not in ENCAPSULATIONS:
            kind = "XCDR2, " if found in _XCDR2 else ""
            raise DecodeError(f"expected plain CDR, which begins with 0x0000 or 0x0001, found {kind}0x{found.hex()}")
        store = self.store
        decode = store.deserialize_ros1 if self.encoding == "ros1" else store.deserialize_cdr
        try:
            return decode(payload, self.name)
        except SerdeError as error:
            raise DecodeError(str(error)) from error


@dataclass
class JsonSchema:
    """JSON objects of one channel, without a definition: the first message that has a field gives its type."""

    name: str
    _leaves: dict[str, Leaf] = field(default_factory=dict)

    def leaf(self, path: str) -> Leaf:
        """The leaf of a field; a number until a message has the field."""
        sequence, bracket, rest = path.partition("[]")
        if "[]" in rest:
            return Leaf("any", "O", None, f"{sequence}[]", nested=True)
        return self._leaves.get(path, Leaf("number", "<f8", None, f"{sequence}[]" if bracket else None))

    def learn(self, payload: bytes, paths: Iterable[str]) -> bool:
        """Learn the types of fields from a message; return whether all are known now."""
        unknown = [path for path in paths if path not in self._leaves and path.count("[]") < 2]
        if unknown:
            try:
                message = self.deserialize(payload)
            except DecodeError:
                return False
            for path in unknown:
                leaf = _json_leaf(message, path, self.leaf(path).sequence)
                if leaf is not None:
                    self._leaves.setdefault(path, leaf)
        return all(path in self._leaves for path in unknown)

    def deserialize(self, payload: bytes) -> Any:
        """The object.

        Raises:
            DecodeError: The payload is not a JSON object.
        """
        try:
            message = json.loads(payload)
        except (ValueError, RecursionError) as error:
            raise DecodeError(f"not JSON: {error}") from error
        if not isinstance(message, dict):
            raise DecodeError(f"expected a JSON object, found {type(message).__name__}")
        return message


AnySchema = Schema | JsonSchema


def value_at(message: Any, path: str) -> Any:
    """The value of a dotted field of a message object or JSON object; a list if the field is in a sequence.

    Raises:
        DecodeError: The object has no such field.
    """
    head, bracket, tail = path.partition("[]")
    value = message
    for step in head.split("."):
        part, indexed, place = step.partition("[")
        name = normalize_fieldname(part)
        if isinstance(value, dict) and part in value:
            value = value[part]
        elif hasattr(value, "__msgtype__") and hasattr(value, name):
            value = getattr(value, name)
        else:
            raise DecodeError(f"no field {part!r} of {path!r}")
        if indexed:
            value = _at(value, int(place.removesuffix("]")), path)
    if not bracket:
        return value
    if isinstance(value, str | dict) or not hasattr(value, "__len__"):
        raise DecodeError(f"{head!r} is not a sequence")
    return [value_at(one, tail[1:]) for one in value] if tail else list(value)


def _at(value: Any, place: int, path: str) -> Any:
    """An entry of a fixed array."""
    if not isinstance(value, list | np.ndarray) or place >= len(value):
        raise DecodeError(f"no entry {place} for {path!r}")
    return value[place]


def _json_leaf(message: Any, path: str, sequence: str | None) -> Leaf | None:
    """The leaf of a field, by its value in a message; None if the field is missing or has no entries."""
    try:
        value = value_at(message, path)
    except DecodeError:
        return None
    if value == []:
        return None
    if isinstance(value, list) and sequence is None:
        return Leaf("number", "<f8", len(value))
    first = value if sequence is None else value[0]
    value_type, dtype = ("time", "<i8") if isinstance(first, dict) else ("number", "<f8")
    return Leaf("string", "O", None, sequence) if isinstance(first, str) else Leaf(value_type, dtype, None, sequence)


def first_line(error: BaseException) -> str:
    """The type of an error and the beginning of its first line."""
    return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0][:120]}"


def full_name(name: str) -> str:
    """A type's name as ROS 2 writes it; ROS 1 omits "/msg"."""
    return name if name.count("/") != 1 else name.replace("/", "/msg/")


def _listed(fields: Mapping[str, FieldDesc]) -> str:
    """The names of a type's fields, at most a line of them."""
    names = [name for name in fields if name != FILLER]
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return (", ".join(names[:MOST_NAMES]) or "none") + more


def _one_of(desc: FieldDesc, step: str, path: str) -> FieldDesc:
    """The type of one entry of a fixed array, "position[0]"."""
    place = step.partition("[")[2].removesuffix("]")
    if desc[0] != Nodetype.ARRAY or not place.isdecimal() or int(place) >= desc[1][1]:
        raise SchemaError(f"{step!r} in {path!r} is not an entry of a fixed array")
    return desc[1][0]


def entry_of(desc: FieldDesc) -> FieldDesc:
    """The type of a field; of an array or sequence, that of an entry."""
    return desc[1][0] if desc[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else desc


def _leaf(path: str, desc: FieldDesc) -> Leaf:
    """The leaf of a field of this type."""
    if desc[0] == Nodetype.NAME and desc[1] in TIMES:
        return Leaf("time", "<i8")
    inner, count = desc[1] if desc[0] == Nodetype.ARRAY else (desc, None)
    if inner[0] == Nodetype.BASE:
        if inner[1][0] == "string" and count is None:
            return Leaf("string", "O")
        if inner[1][0] in PRIMITIVES:
            return Leaf("number", PRIMITIVES[inner[1][0]], count)
    raise SchemaError(f"{path!r} is not a number, text, time or fixed array of numbers")
