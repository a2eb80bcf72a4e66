"""The layout of the fields in a message, derived from the definition and the bytes of one message.

CDR aligns each primitive to its size, counted from the end of the four bytes of encapsulation. A string is its length
with the closing NUL (uint32), then its bytes; a sequence is its count (uint32), then its items. ROS 1 has no
encapsulation, no alignment and no closing NUL. Two messages of one type have the same layout if they agree in all these
lengths, which are the `checks` of the layout.

Source: OMG CORBA 3.0, chapter 15.3 (CDR transfer syntax); DDSI-RTPS 2.2, chapter 10 (encapsulation); https://wiki.ros.org/msg
(ROS 1).
"""

import re
import struct
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc

from navirl_cli.logs.messages.schema import ENCAPSULATIONS, PRIMITIVES, TIMES, Schema

#: Bytes of encapsulation before a CDR message.
ENCAPSULATION_SIZE: Final = 4
#: Some writers pad a payload to a multiple of four bytes.
_MAX_PADDING: Final = 3
#: Messages with more fields, including those in sequences, are decoded one by one.
_MAX_FIELDS: Final = 20_000

#: numpy's type of a field; not as text, "(3,)f8", which numpy parses with `ast`: that is not safe in threads.
Format = str | tuple[str, tuple[int]]


@dataclass(frozen=True)
class Layout:
    """The layout of messages that have the same size and the same lengths inside."""

    #: Structured type of the payload. Its fields are the wanted paths ("path/sec" and "path/nanosec" of a time), each
    #: entry of a path in a sequence ("path#0", "path#1", ...), the checks ("#0", "#1", ...) and `texts` ("~0", ...).
    dtype: np.dtype[np.void]
    #: The value that each check must have, by its name in `dtype`.
    checks: dict[str, int]
    #: Number of entries of the sequences that hold wanted paths, by "path[]".
    counts: dict[str, int]
    #: Texts that are not wanted, but must be valid.
    texts: tuple[str, ...]

    @cached_property
    def head(self) -> np.dtype[np.void]:
        """The same fields over no more bytes than they need, which are gathered faster."""
        names = self.dtype.names or ()
        places = [self.dtype.fields[name][:2] for name in names] if self.dtype.fields else []
        return np.dtype(
            {
                "names": list(names),
                "formats": [dtype for dtype, _ in places],
                "offsets": [at for _, at in places],
                "itemsize": max((at + dtype.itemsize for dtype, at in places), default=0),
            }
        )


class _UnfitError(Exception):
    """The bytes do not fit the definition, or hold a type that has no layout."""


@dataclass
class _Walker:
    """Walks over one payload along the definition and collects the places of fields, checks and texts."""

    schema: Schema
    payload: bytes
    wanted: frozenset[str]
    #: Sequences that hold wanted fields.
    sequences: frozenset[str]
    order: str
    #: Fixed arrays of which single numbers are wanted.
    indexed: frozenset[str]
    #: First byte of the message, from which alignment is counted.
    base: int
    at: int
    fields: dict[str, tuple[int, Format]] = field(default_factory=dict)
    checks: list[tuple[int, str, int]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    texts: list[tuple[int, Format]] = field(default_factory=list)
    #: Number of entries so far of each wanted field in a sequence.
    entries: Counter[str] = field(default_factory=Counter)
    steps: int = 0

    @property
    def cdr(self) -> bool:
        """Whether the message is aligned and its texts end with NUL, as in CDR; ROS 1 has neither."""
        return self.schema.encoding == "cdr"

    def message(self, typename: str, prefix: str) -> None:
        """Walk over the fields of a type; the prefix is the dotted path of the message that holds them."""
        for name, desc in self.schema.fields(typename):
            self.one(desc, prefix + name)

    def one(self, desc: FieldDesc, path: str) -> None:
        """Walk over a field of any type; _UnfitError if the message has more fields than a layout may have."""
        self.steps += 1
        if self.steps > _MAX_FIELDS:
            raise _UnfitError("too many fields")
        if desc[0] == Nodetype.BASE:
            self.primitive(desc[1][0], path)
        elif desc[0] == Nodetype.NAME:
            self.nested(desc[1], path)
        elif desc[0] == Nodetype.ARRAY:
            self.items(desc[1][0], desc[1][1], path)
        else:
            self.items(desc[1][0], self.length(minimum=0), path)

    def nested(self, typename: str, path: str) -> None:
        """Walk over a message in the message; a wanted time is kept as two integers."""
        if typename in TIMES and path in self.wanted:
            self.align(4)
            name = self.entry(path)
            self.fields[name + "/sec"] = (self.at, self.order + "i4")
            self.fields[name + "/nanosec"] = (self.at + 4, self.order + "u4")
        self.message(typename, path + ".")

    def primitive(self, name: str, path: str) -> None:
        """Walk over a number or a text; the text's length and closing NUL are checks of the layout."""
        if name != "string":
            self.numbers(name, None, path)
            return
        closing = int(self.cdr)
        size = self.length(minimum=closing)
        place = (self.at, ("u1", (size - closing,)))
        if path in self.wanted:
            self.fields[self.entry(path)] = place
        elif size > closing:
            self.texts.append(place)
        self.skip(size)
        if closing:
            self.checks.append((self.at - 1, "u1", 0))

    def numbers(self, name: str, count: int | None, path: str) -> None:
        """Walk over a number, or over a fixed array of so many; 0 numbers take no place and no alignment."""
        if name not in PRIMITIVES:
            raise _UnfitError(name)
        if count == 0:
            return
        dtype = PRIMITIVES[name].replace("?", "u1").replace("<", self.order)
        size = np.dtype(dtype).itemsize
        self.align(size)
        if count is not None:
            for place in {path, f"{path}[]"} & self.wanted:
                self.fields[place] = (self.at, (dtype, (count,)))
            for number in range(count) if path in self.indexed else ():
                if (place := f"{path}[{number}]") in self.wanted:
                    self.fields[self.entry(place)] = (self.at + number * size, dtype)
        elif path in self.wanted:
            self.fields[self.entry(path)] = (self.at, dtype)
        self.skip(size * (1 if count is None else count))

    def items(self, desc: FieldDesc, count: int, path: str) -> None:
        """Walk over the entries of an array or a sequence; those of numbers are skipped at once."""
        if f"{path}[]" in self.sequences:
            self.counts[f"{path}[]"] = count
        if desc[0] == Nodetype.BASE and desc[1][0] != "string":
            self.numbers(desc[1][0], count, path)
            return
        for _ in range(count):
            self.one(desc, f"{path}[]")

    def entry(self, path: str) -> str:
        """The name of a field in the layout; an entry of a sequence has its number in its name."""
        if "[]" not in path:
            return path
        self.entries[path] += 1
        return f"{path}#{self.entries[path] - 1}"

    def length(self, minimum: int) -> int:
        """Read the length of a text or sequence, which other messages of the layout must have too."""
        self.align(4)
        if self.at + 4 > len(self.payload):
            raise _UnfitError("a length after the end")
        (value,) = struct.unpack_from(self.order + "I", self.payload, self.at)
        if value < minimum:
            raise _UnfitError("a string without its closing NUL")
        self.checks.append((self.at, self.order + "u4", value))
        self.at += 4
        return int(value)

    def align(self, size: int) -> None:
        """Move to the next multiple of a size in bytes, counted from the first byte of the message."""
        if self.cdr:
            self.at += -(self.at - self.base) % size

    def skip(self, size: int) -> None:
        """Move on by so many bytes; _UnfitError behind the end of the message."""
        self.at += size
        if self.at > len(self.payload):
            raise _UnfitError("a field after the end")


def derive(schema: Schema, payload: bytes, wanted: Iterable[str]) -> Layout | None:
    """Derive the layout of a message.

    Args:
        schema: The message's type.
        payload: The message, with its encapsulation if it has one.
        wanted: Dotted fields that `Schema.leaf` knows.

    Returns:
        The layout; None if the bytes are not a message of this type, or if it holds a type that only rosbags decodes.
        Such messages are decoded one by one.
    """
    order, base = "<", 0
    checks: list[tuple[int, str, int]] = []
    if schema.encoding == "cdr":
        if (start := payload[:2]) not in ENCAPSULATIONS:
            return None
        order = ENCAPSULATIONS[start]
        base = ENCAPSULATION_SIZE
        checks.append((0, "<u2", int.from_bytes(start, "little")))
    paths = frozenset(wanted)
    if any(path.count("[]") > 1 for path in paths):
        return None
    sequences = frozenset(path.partition("[]")[0] + "[]" for path in paths if "[]" in path)
    indexed = frozenset(path.rpartition("[")[0] for path in paths if re.search(r"\[\d+\]$", path))
    walker = _Walker(schema, payload, paths, sequences, order, indexed, base, base, checks=checks)
    try:
        walker.message(schema.name, "")
    except _UnfitError:
        return None
    if not walker.at <= len(payload) <= walker.at + (_MAX_PADDING if schema.encoding == "cdr" else 0):
        return None
    # a terminator must be zero, and a length that of this message
    checked = {f"#{number}": (at, form) for number, (at, form, _) in enumerate(walker.checks)}
    texts = {f"~{number}": place for number, place in enumerate(walker.texts)}
    places: dict[str, tuple[int, Format]] = {**walker.fields, **checked, **texts}
    dtype = np.dtype(
        {
            "names": list(places),
            "formats": [form for _, form in places.values()],
            "offsets": [at for at, _ in places.values()],
            "itemsize": len(payload),
        }
    )
    values = [value for _, _, value in walker.checks]
    return Layout(dtype, dict(zip(checked, values, strict=True)), walker.counts, tuple(texts))
