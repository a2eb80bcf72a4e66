"""Where the fields of a CDR message stand, derived from its definition and one message's bytes.

CDR aligns each primitive to its size, counted from behind the four bytes of encapsulation; a string is its length with
the closing NUL (uint32), then its bytes; a sequence is its count (uint32), then its items. Two messages of one type
have the same layout if they agree in every such length: those are the layout's `checks`.

Source: OMG CORBA 3.0, chapter 15.3 (CDR transfer syntax); DDSI-RTPS 2.2, chapter 10 (encapsulation).
"""

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc

from navirl_cli.logs.schema import PRIMITIVES, TIMES, Schema

#: Bytes of encapsulation before the message, and their first two for plain little-endian CDR, as uint16.
ENCAPSULATION_SIZE: Final = 4
_LITTLE_ENDIAN: Final = 0x0100
#: Some writers pad a payload to a multiple of four bytes.
_MAX_PADDING: Final = 3

_UINT32 = struct.Struct("<I")


@dataclass(frozen=True)
class Layout:
    """The layout that messages of one size and the same lengths share."""

    #: Structured type over the whole payload: a field for each wanted path ("path/sec" and "path/nanosec" of a time),
    #: and "#0", "#1", ... for the checks.
    dtype: np.dtype[np.void]
    #: The value each check must have, by its name in `dtype`.
    checks: dict[str, int]


class _UnfitError(Exception):
    """The bytes are not what the definition says, or of a kind that is not walked."""


@dataclass
class _Walker:
    """Walks over one payload along the definition and notes where things are."""

    schema: Schema
    payload: bytes
    wanted: frozenset[str]
    at: int = ENCAPSULATION_SIZE
    fields: dict[str, tuple[int, str]] = field(default_factory=dict)
    checks: list[tuple[int, str, int]] = field(default_factory=lambda: [(0, "<u2", _LITTLE_ENDIAN)])

    def message(self, typename: str, prefix: str) -> None:
        for name, desc in self.schema.fields(typename):
            self.one(desc, prefix + name)

    def one(self, desc: FieldDesc, path: str) -> None:
        if desc[0] == Nodetype.BASE:
            self.primitive(desc[1][0], path)
        elif desc[0] == Nodetype.NAME:
            self.nested(desc[1], path)
        elif desc[0] == Nodetype.ARRAY:
            self.items(desc[1][0], desc[1][1], path)
        else:
            self.items(desc[1][0], self.length(minimum=0), path + "[]")

    def nested(self, typename: str, path: str) -> None:
        if typename in TIMES and path in self.wanted:
            self.align(4)
            self.fields[path + "/sec"] = (self.at, "<i4")
            self.fields[path + "/nanosec"] = (self.at + 4, "<u4")
        self.message(typename, path + ".")

    def primitive(self, name: str, path: str) -> None:
        if name == "string":
            size = self.length(minimum=1)
            if path in self.wanted:
                self.fields[path] = (self.at, f"({size - 1},)u1")
            self.skip(size)
            self.checks.append((self.at - 1, "u1", 0))
        else:
            self.numbers(name, None, path)

    def numbers(self, name: str, count: int | None, path: str) -> None:
        if name not in PRIMITIVES:
            raise _UnfitError(name)
        if count == 0:
            return
        dtype = PRIMITIVES[name].replace("?", "u1")
        size = np.dtype(dtype).itemsize
        self.align(size)
        if path in self.wanted:
            self.fields[path] = (self.at, dtype if count is None else f"({count},){dtype}")
        self.skip(size * (1 if count is None else count))

    def items(self, desc: FieldDesc, count: int, path: str) -> None:
        if desc[0] == Nodetype.BASE and desc[1][0] != "string":
            self.numbers(desc[1][0], count, path)
            return
        if count > len(self.payload):
            raise _UnfitError("a count larger than the message")
        for _ in range(count):
            self.one(desc, path + "[]")

    def length(self, minimum: int) -> int:
        self.align(4)
        if self.at + 4 > len(self.payload):
            raise _UnfitError("a length behind the end")
        (value,) = _UINT32.unpack_from(self.payload, self.at)
        if value < minimum:
            raise _UnfitError("a string without its closing NUL")
        self.checks.append((self.at, "<u4", value))
        self.at += 4
        return int(value)

    def align(self, size: int) -> None:
        self.at += -(self.at - ENCAPSULATION_SIZE) % size

    def skip(self, size: int) -> None:
        self.at += size
        if self.at > len(self.payload):
            raise _UnfitError("a field behind the end")


def derive(schema: Schema, payload: bytes, wanted: Iterable[str]) -> Layout | None:
    """Derive the layout of a message.

    Args:
        schema: The message's type.
        payload: The message with its encapsulation.
        wanted: Dotted fields that `Schema.leaf` knows.

    Returns:
        The layout, or None where the message is no plain little-endian CDR of this type, or holds a type that only
        rosbags decodes: such messages are to be decoded one by one.
    """
    if payload[:2] != b"\x00\x01":
        return None
    walker = _Walker(schema, payload, frozenset(wanted))
    try:
        walker.message(schema.name, "")
    except _UnfitError:
        return None
    if not walker.at <= len(payload) <= walker.at + _MAX_PADDING:
        return None
    checks = [(f"#{number}", *check) for number, check in enumerate(walker.checks)]
    dtype = np.dtype(
        {
            "names": [*walker.fields, *(name for name, *_ in checks)],
            "formats": [*(kind for _, kind in walker.fields.values()), *(kind for _, _, kind, _ in checks)],
            "offsets": [*(at for at, _ in walker.fields.values()), *(at for _, at, _, _ in checks)],
            "itemsize": len(payload),
        }
    )
    # a terminator must be zero, a length must be the sample's
    return Layout(dtype, {name: value for name, _, _, value in checks})
