"""Random message types and messages, with a slow encoder that follows the wire formats' text word by word."""

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

#: Python's and numpy's own words, and plain ones.
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
class Kind:
    """A field's type: a primitive's name, "string", "time", "duration" or a message's fields; one, or many."""

    what: "str | tuple[tuple[str, Kind], ...]"
    #: "" for one, "[]" for a sequence, "[3]" for an array of three.
    many: str = ""

    @property
    def one(self) -> "Kind":
        return Kind(self.what)


def kinds(depth: int) -> st.SearchStrategy[Kind]:
    """Types of fields; messages without fields stand in arrays only, since any number of them fits into ROS 1."""
    plain = st.sampled_from([*PRIMITIVES, "string", "string", "time", "duration"])
    some = st.builds(Kind, plain | messages(depth - 1) if depth else plain, st.sampled_from(MANY))
    return some | st.just(Kind((), "[3]"))


def messages(depth: int) -> st.SearchStrategy[tuple[tuple[str, Kind], ...]]:
    """Fields of a message that holds others up to a depth."""
    named = st.tuples(st.sampled_from(NAMES), kinds(depth))
    fields = st.lists(named, min_size=1, max_size=5, unique_by=lambda pair: pair[0]).map(tuple)
    return fields.filter(lambda fields: any(kind.what != () for _, kind in fields))


def definition(fields: tuple[tuple[str, Kind], ...], ros: int) -> str:
    """The type's text and those of the types in it, as recorders embed them."""
    texts: list[str] = []

    def write(fields: tuple[tuple[str, Kind], ...]) -> int:
        place = len(texts)
        texts.append("")
        lines = []
        for name, kind in fields:
            word = kind.what if isinstance(kind.what, str) else f"t_msgs/M{write(kind.what)}"
            if ros == 2 and word in {"time", "duration"}:
                word = f"builtin_interfaces/{word.capitalize()}"
            lines.append(f"{word}{kind.many} {name}\n")
        texts[place] = "".join(lines)
        return place

    write(fields)
    return texts[0] + "".join(f"{'=' * 80}\nMSG: t_msgs/M{k}\n{text}" for k, text in enumerate(texts) if k)


def pick(rng: np.random.Generator, options: Sequence[Any]) -> Any:
    return options[rng.integers(len(options))]


def value(kind: Kind, lengths: np.random.Generator, values: np.random.Generator) -> Any:
    """A value: a number, a text, a pair for a time, a dict for a message, a list for many.

    What has a length takes it from `lengths`, so that messages can share their layout and differ in values.
    """
    if kind.many:
        count = int(kind.many[1:-1] or pick(lengths, (0, 0, 1, 2, 5)))
        return [value(kind.one, lengths, values) for _ in range(count)]
    if not isinstance(kind.what, str):
        return {name: value(one, lengths, values) for name, one in kind.what}
    if kind.what == "string":
        return "".join(pick(values, "abc") if letter == "x" else letter for letter in pick(lengths, TEXTS))
    if kind.what in {"time", "duration"}:
        return pick(values, (-(2**31), -1, 0, 928, 2**31 - 1)), pick(values, (0, 1, 999_999_999))
    return number(np.dtype(PRIMITIVES[kind.what][1]), values)


def number(dtype: np.dtype[Any], rng: np.random.Generator) -> Any:
    """A number, often one of the edges."""
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

    def payload(self, fields: tuple[tuple[str, Kind], ...], message: dict[str, Any]) -> bytes:
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

    def _message(self, fields: tuple[tuple[str, Kind], ...], message: dict[str, Any]) -> None:
        for name, kind in fields:
            self._value(kind, message[name])
        if not fields and self.encoding == "cdr":
            # IDL has no empty struct: ROS 2 gives it a byte
            self._number("B", 0)

    def _value(self, kind: Kind, value: Any) -> None:
        if kind.many:
            if kind.many == "[]":
                self._number("I", len(value))
            for one in value:
                self._value(kind.one, one)
        elif not isinstance(kind.what, str):
            self._message(kind.what, value)
        elif kind.what == "string":
            data = value.encode() + (b"\0" if self.encoding == "cdr" else b"")
            self._number("I", len(data))
            self.out += data
        elif kind.what in {"time", "duration"}:
            self._number("i", value[0])
            self._number("I", value[1])
        else:
            self._number(PRIMITIVES[kind.what][0], value)


def columns(fields: tuple[tuple[str, Kind], ...], prefix: str = "", many: str = "") -> Iterator[tuple[str, str, Kind]]:
    """Every path that can be a column, the sequence it is in (or ""), and its kind."""
    for name, kind in fields:
        path = prefix + name
        if isinstance(kind.what, str) and not kind.many:
            yield path, many, kind
            if kind.what in {"time", "duration"}:
                yield f"{path}.sec", many, Kind("int32")
                yield f"{path}.nanosec", many, Kind("uint32")
        if not isinstance(kind.what, str) and not (kind.many and many):
            entries = f"{path}[]" if kind.many else ""
            yield from columns(kind.what, (entries or path) + ".", many or entries)
        if isinstance(kind.what, str) and kind.many and not many:
            yield f"{path}[]", f"{path}[]", kind.one
            if kind.many != "[]" and kind.what in PRIMITIVES:
                yield path, "", kind


def entries(message: dict[str, Any], path: str) -> list[Any]:
    """The values of a column in one message; a time's as a pair."""
    found: list[Any] = [message]
    for part in path.split("."):
        name = part.removesuffix("[]")
        found = [one[("sec", "nanosec").index(name)] if isinstance(one, tuple) else one[name] for one in found]
        if part != name:
            found = [one for many in found for one in many]
    return found


def expected(batch: list[dict[str, Any]], path: str, sequence: str, kind: Kind) -> tuple[Any, Any]:
    """A column of messages, and the number of entries of each (None where the path is in no sequence)."""
    found = [entries(message, path) for message in batch]
    flat = [one for many in found for one in many]
    if kind.what in {"time", "duration"}:
        column = np.array([sec * 10**9 + nanosec for sec, nanosec in flat], dtype=np.int64)
    elif kind.what == "string":
        column = np.array([*flat, None], dtype=object)[:-1]
    else:
        shape = (len(flat), int(kind.many[1:-1])) if kind.many else (len(flat),)
        column = np.array(flat, dtype=PRIMITIVES[str(kind.what)][1]).reshape(shape)
    return column, np.array([len(many) for many in found]) if sequence else None
