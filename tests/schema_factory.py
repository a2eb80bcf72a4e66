"""Random message types and messages, with a slow encoder that follows the text of the wire formats."""

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

#: Names of fields: words of Python and numpy, and others.
NAMES = (
    *("class", "def", "None", "lambda", "import", "self", "cls", "values", "pos", "len", "int", "numpy"),
    *("dtype", "shape", "itemsize", "names", "fields", "strides", "data", "base", "f0", "T", "x", "sec", "a_b2"),
)
#: struct's letter and numpy's type of each primitive.
PRIMITIVES = {
    "bool": ("?", "?"),
    "byte": ("b", "i1"),
    "char": ("B", "u1"),
    "int8": ("b", "i1"),
    "uint8": ("B", "u1"),
    "int16": ("h", "i2"),
    "uint16": ("H", "u2"),
    "int32": ("i", "i4"),
    "uint32": ("I", "u4"),
    "int64": ("q", "i8"),
    "uint64": ("Q", "u8"),
    "float32": ("f", "f4"),
    "float64": ("d", "f8"),
}
MANY = ("", "", "", "[]", "[]", "[1]", "[3]")
TEXTS = ("", "a", "odom", "ft sensor", "ü", "\U0001f600!", "n\0l", "x" * 40)


@dataclass(frozen=True)
class FieldType:
    """The type of a field: a primitive's name, "string", "time", "duration" or a message's fields; one or many."""

    what: "str | tuple[tuple[str, FieldType], ...]"
    #: "" for one, "[]" for a sequence, "[3]" for an array of three.
    many: str = ""

    @property
    def one(self) -> "FieldType":
        return FieldType(self.what)


def field_types(depth: int) -> st.SearchStrategy[FieldType]:
    """Types of fields. Messages without fields are in fixed arrays only: in ROS 1 they take no bytes."""
    plain = st.sampled_from([*PRIMITIVES, "string", "string", "time", "duration"])
    some = st.builds(FieldType, plain | messages(depth - 1) if depth else plain, st.sampled_from(MANY))
    return some | st.just(FieldType((), "[3]"))


def messages(depth: int) -> st.SearchStrategy[tuple[tuple[str, FieldType], ...]]:
    """The fields of a message that contains other messages up to a depth."""
    named = st.tuples(st.sampled_from(NAMES), field_types(depth))
    fields = st.lists(named, min_size=1, max_size=5, unique_by=lambda pair: pair[0]).map(tuple)
    return fields.filter(lambda fields: any(field_type.what != () for _, field_type in fields))


def definition(fields: tuple[tuple[str, FieldType], ...], ros: int) -> str:
    """The definition of a type and those of the types in it, as recorders embed them."""
    texts: list[str] = []

    def write(fields: tuple[tuple[str, FieldType], ...]) -> int:
        place = len(texts)
        texts.append("")
        lines = []
        for name, field_type in fields:
            word = field_type.what if isinstance(field_type.what, str) else f"t_msgs/M{write(field_type.what)}"
            if ros == 2 and word in {"time", "duration"}:
                word = f"builtin_interfaces/{word.capitalize()}"
            lines.append(f"{word}{field_type.many} {name}\n")
        texts[place] = "".join(lines)
        return place

    write(fields)
    return texts[0] + "".join(f"{'=' * 80}\nMSG: t_msgs/M{k}\n{text}" for k, text in enumerate(texts) if k)


def pick(rng: np.random.Generator, options: Sequence[Any]) -> Any:
    return options[rng.integers(len(options))]


def value(field_type: FieldType, lengths: np.random.Generator, values: np.random.Generator) -> Any:
    """A value: a number, a text, a pair for a time, a dict for a message, a list for many.

    All lengths are drawn from `lengths`, so that messages can share their layout and differ in their values.
    """
    if field_type.many:
        count = int(field_type.many[1:-1] or pick(lengths, (0, 0, 1, 2, 5)))
        return [value(field_type.one, lengths, values) for _ in range(count)]
    if not isinstance(field_type.what, str):
        return {name: value(one, lengths, values) for name, one in field_type.what}
    if field_type.what == "string":
        return "".join(pick(values, "abc") if letter == "x" else letter for letter in pick(lengths, TEXTS))
    if field_type.what in {"time", "duration"}:
        return pick(values, (-(2**31), -1, 0, 928, 2**31 - 1)), pick(values, (0, 1, 999_999_999))
    return number(np.dtype(PRIMITIVES[field_type.what][1]), values)


def number(dtype: np.dtype[Any], rng: np.random.Generator) -> Any:
    """A number, often one of the limits of its type."""
    if dtype.kind == "b":
        return pick(rng, (False, True))
    if dtype.kind == "f":
        edge = pick(rng, (0.0, -0.0, math.nan, math.inf, -math.inf, 5e-324, 1e300, rng.normal()))
        with np.errstate(over="ignore"):
            return dtype.type(edge).item()
    low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
    return int(pick(rng, (low, high, 0, rng.integers(low, high, dtype=dtype, endpoint=True))))


@dataclass
class Wire:
    """Encodes values field by field: CDR of either byte order, or ROS 1."""

    encoding: str
    order: str = "<"

    def payload(self, fields: tuple[tuple[str, FieldType], ...], message: dict[str, Any]) -> bytes:
        self.out = bytearray()
        self._message(fields, message)
        head = {"<": b"\0\1\0\0", ">": b"\0\0\0\0"}[self.order] if self.encoding == "cdr" else b""
        return head + bytes(self.out)

    def _number(self, letter: str, number: float) -> None:
        """A primitive is aligned to its own size, but not in ROS 1."""
        size = struct.calcsize(f"={letter}")
        if self.encoding == "cdr":
            self.out += bytes(-len(self.out) % size)
        self.out += struct.pack(self.order + letter, number)

    def _message(self, fields: tuple[tuple[str, FieldType], ...], message: dict[str, Any]) -> None:
        for name, field_type in fields:
            self._value(field_type, message[name])
        if not fields and self.encoding == "cdr":
            # IDL has no empty struct: in ROS 2 it has a byte
            self._number("B", 0)

    def _value(self, field_type: FieldType, value: Any) -> None:
        if field_type.many:
            if field_type.many == "[]":
                self._number("I", len(value))
            for one in value:
                self._value(field_type.one, one)
        elif not isinstance(field_type.what, str):
            self._message(field_type.what, value)
        elif field_type.what == "string":
            data = value.encode() + (b"\0" if self.encoding == "cdr" else b"")
            self._number("I", len(data))
            self.out += data
        elif field_type.what in {"time", "duration"}:
            self._number("i", value[0])
            self._number("I", value[1])
        else:
            self._number(PRIMITIVES[field_type.what][0], value)


def columns(
    fields: tuple[tuple[str, FieldType], ...], prefix: str = "", many: str = ""
) -> Iterator[tuple[str, str, FieldType]]:
    """Every path that can be a column, the sequence that holds it (or ""), and its type."""
    for name, field_type in fields:
        path = prefix + name
        if isinstance(field_type.what, str) and not field_type.many:
            yield path, many, field_type
            if field_type.what in {"time", "duration"}:
                yield f"{path}.sec", many, FieldType("int32")
                yield f"{path}.nanosec", many, FieldType("uint32")
        if not isinstance(field_type.what, str) and not (field_type.many and many):
            entries = f"{path}[]" if field_type.many else ""
            yield from columns(field_type.what, (entries or path) + ".", many or entries)
        if isinstance(field_type.what, str) and field_type.many and not many:
            yield f"{path}[]", f"{path}[]", field_type.one
            if field_type.many != "[]" and field_type.what in PRIMITIVES:
                yield path, "", field_type


def entries(message: dict[str, Any], path: str) -> list[Any]:
    """The values of a column in one message; a time is a pair."""
    found: list[Any] = [message]
    for part in path.split("."):
        name = part.removesuffix("[]")
        found = [one[("sec", "nanosec").index(name)] if isinstance(one, tuple) else one[name] for one in found]
        if part != name:
            found = [one for many in found for one in many]
    return found


def expected(batch: list[dict[str, Any]], path: str, sequence: str, field_type: FieldType) -> tuple[Any, Any]:
    """A column of messages, and the number of entries of each; None if the path is in no sequence."""
    found = [entries(message, path) for message in batch]
    flat = [one for many in found for one in many]
    if field_type.what in {"time", "duration"}:
        column = np.array([sec * 10**9 + nanosec for sec, nanosec in flat], dtype=np.int64)
    elif field_type.what == "string":
        column = np.array([*flat, None], dtype=object)[:-1]
    else:
        shape = (len(flat), int(field_type.many[1:-1])) if field_type.many else (len(flat),)
        column = np.array(flat, dtype=PRIMITIVES[str(field_type.what)][1]).reshape(shape)
    return column, np.array([len(many) for many in found]) if sequence else None
