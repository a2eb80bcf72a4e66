"""MCAP records: their codes and their contents, parsed from bytes.

Source: the MCAP file format specification, https://mcap.dev/spec. Of each record only what reading needs is kept.
"""

import struct
from array import array
from collections.abc import MutableSequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from navirl_cli.arrays import IntArray

MAGIC: Final = b"\x89MCAP0\r\n"

HEADER: Final = 0x01
FOOTER: Final = 0x02
SCHEMA: Final = 0x03
CHANNEL: Final = 0x04
MESSAGE: Final = 0x05
CHUNK: Final = 0x06
MESSAGE_INDEX: Final = 0x07
CHUNK_INDEX: Final = 0x08
ATTACHMENT: Final = 0x09
ATTACHMENT_INDEX: Final = 0x0A
STATISTICS: Final = 0x0B
METADATA: Final = 0x0C
METADATA_INDEX: Final = 0x0D
SUMMARY_OFFSET: Final = 0x0E
DATA_END: Final = 0x0F
#: Codes from here on are for private use; such records are skipped and never an error.
PRIVATE: Final = 0x80

#: Bytes of a record's code and length.
HEAD_SIZE: Final = 9
#: Bytes from the start of a message record to its payload.
MESSAGE_HEAD_SIZE: Final = 31
#: Bytes of the footer record and the magic at the end of every complete file.
TAIL_SIZE: Final = HEAD_SIZE + 20 + len(MAGIC)

#: What the parsers raise on malformed contents.
MALFORMED: Final = (struct.error, ValueError)

RECORD_HEAD: Final = struct.Struct("<BQ")
_MESSAGE_START: Final = struct.Struct("<QH")

#: The start of a message record, to be gathered at many offsets at once.
MESSAGE_HEAD: Final = np.dtype(
    {
        "names": ["op", "length", "channel", "log_time"],
        "formats": ["u1", "<u8", "<u2", "<i8"],
        "offsets": [0, 1, 9, 15],
        "itemsize": MESSAGE_HEAD_SIZE,
    }
)


class SchemaRecord(NamedTuple):
    """The definition of a message type."""

    id: int
    name: str
    encoding: str
    text: str


class ChannelRecord(NamedTuple):
    """A topic and how its messages are encoded."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str


class ChunkHead(NamedTuple):
    """The fields before a chunk's compressed bytes; times are those of the first and the last message, ns."""

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    data_start: int
    data_size: int


class ChunkIndex(NamedTuple):
    """Where a chunk and its message indexes stand in the file."""

    start_ns: int
    end_ns: int
    start: int
    length: int
    message_indexes: dict[int, int]
    message_index_length: int
    compression: str

    @property
    def stop(self) -> int:
        """First byte after the chunk and its message indexes."""
        return self.start + self.length + self.message_index_length


class Statistics(NamedTuple):
    """Counts over the whole file."""

    messages: int
    channels: int
    metadata: int
    chunks: int
    start_ns: int
    end_ns: int
    by_channel: dict[int, int]


class Footer(NamedTuple):
    """First byte of the summary section and its CRC; 0 where the file has none."""

    summary_start: int
    summary_crc: int


@dataclass
class _Cursor:
    """Reads the values of a record's contents one by one."""

    data: bytes | memoryview
    at: int = 0

    def take(self, layout: str) -> tuple[int, ...]:
        """The values of a layout of :mod:`struct`; the place moves behind them."""
        values: tuple[int, ...] = struct.unpack_from(layout, self.data, self.at)
        self.at += struct.calcsize(layout)
        return values

    def string(self) -> str:
        """A text in UTF-8 behind its length in bytes, as it stands."""
        return self.blob().decode()

    def name(self) -> str:
        """A text on one line; characters that cannot be printed are escaped."""
        text = self.string()
        return text if text.isprintable() else "".join(map(_printable, text))

    def blob(self) -> bytes:
        """The bytes behind their length; ValueError if the record is shorter."""
        (size,) = self.take("<I")
        if self.at + size > len(self.data):
            raise ValueError(f"a text of {size} bytes does not fit into a record of {len(self.data)} bytes")
        self.at += size
        return bytes(self.data[self.at - size : self.at])

    def integers(self) -> dict[int, int]:
        """A map of 16-bit keys to 64-bit values, behind its length in bytes."""
        return dict(struct.iter_unpack("<HQ", self.blob()))


def _printable(letter: str) -> str:
    return letter if letter.isprintable() else letter.encode("unicode_escape").decode()


def parse_header(content: bytes) -> tuple[str, str]:
    """Profile and library of a header record."""
    cursor = _Cursor(content)
    return cursor.name(), cursor.name()


def parse_schema(content: bytes) -> SchemaRecord:
    """A schema record; bytes of its text that are not UTF-8 (mostly in comments) are replaced."""
    cursor = _Cursor(content)
    (schema_id,) = cursor.take("<H")
    return SchemaRecord(schema_id, cursor.name(), cursor.name(), cursor.blob().decode(errors="replace"))


def parse_channel(content: bytes) -> ChannelRecord:
    """A channel record without its metadata."""
    cursor = _Cursor(content)
    channel_id, schema_id = cursor.take("<HH")
    return ChannelRecord(channel_id, schema_id, cursor.name(), cursor.name())


def parse_chunk_head(content: bytes | memoryview) -> ChunkHead:
    """The start of a chunk record; `data_start` counts from the start of the contents."""
    cursor = _Cursor(content)
    start_ns, end_ns, size, crc = cursor.take("<QQQI")
    compression = cursor.string()
    (data_size,) = cursor.take("<Q")
    return ChunkHead(start_ns, end_ns, size, crc, compression, cursor.at, data_size)


def parse_chunk_index(content: bytes) -> ChunkIndex:
    """A chunk index record."""
    cursor = _Cursor(content)
    start_ns, end_ns, start, length = cursor.take("<QQQQ")
    indexes = cursor.integers()
    (index_length,) = cursor.take("<Q")
    return ChunkIndex(start_ns, end_ns, start, length, indexes, index_length, cursor.string())


def parse_statistics(content: bytes) -> Statistics:
    """A statistics record."""
    cursor = _Cursor(content)
    messages, _, channels, _, metadata, chunks, start_ns, end_ns = cursor.take("<QHIIIIQQ")
    return Statistics(messages, channels, metadata, chunks, start_ns, end_ns, cursor.integers())


def parse_metadata(content: bytes) -> tuple[str, dict[str, str]]:
    """Name and entries of a metadata record."""
    cursor = _Cursor(content)
    name = cursor.string()
    entries = _Cursor(cursor.blob())
    values: dict[str, str] = {}
    while entries.at < len(entries.data):
        key = entries.string()
        values[key] = entries.string()
    return name, values


def parse_metadata_index(content: bytes) -> int:
    """Offset in the file of the metadata record that a metadata index record points to."""
    (offset,) = _Cursor(content).take("<Q")
    return offset


def parse_footer(content: bytes) -> Footer:
    """A footer record."""
    summary_start, _, crc = _Cursor(content).take("<QQI")
    return Footer(summary_start, crc)


def parse_data_end(content: bytes) -> int:
    """CRC of all bytes before the data end record; 0 if the recorder wrote none."""
    (crc,) = _Cursor(content).take("<I")
    return crc


def parse_message_index(content: bytes) -> tuple[int, IntArray, IntArray]:
    """Channel, and offsets in the uncompressed chunk (ascending) and log times in ns of its messages, shape (n,).

    Raises:
        struct.error, ValueError: The contents are malformed, or name a message twice.
    """
    cursor = _Cursor(content)
    (channel,) = cursor.take("<H")
    times, offsets = np.frombuffer(cursor.blob(), dtype="<i8").reshape(-1, 2).T
    if cursor.at < len(content):
        raise ValueError("a message index is longer than its entries")
    if (offsets[1:] < offsets[:-1]).any():
        order = np.argsort(offsets, kind="stable")
        times, offsets = times[order], offsets[order]
    if (offsets[1:] == offsets[:-1]).any():
        raise ValueError("a message index names a message twice")
    return channel, offsets, times


@dataclass(frozen=True)
class FoundRecords:
    """The records that a walk over a buffer found."""

    #: Offsets of the message records, by channel id, ascending.
    messages: dict[int, MutableSequence[int]]
    #: Of each schema and channel record: its code, first byte of its contents, first byte after them.
    definitions: list[tuple[int, int, int]]
    #: Where the walk stopped: at the end of the buffer, at a record that is cut, or at one of another type.
    stop: int


def walk(data: bytes | memoryview, limit: int, at: int = 0) -> FoundRecords:
    """Hop from record to record over messages, schemas and channels.

    Args:
        data: Records.
        limit: Bytes of `data` to walk over.
        at: Where the first record starts.

    Returns:
        The records; `stop` is smaller than `limit` if a record is cut or of another type.
    """
    messages: dict[int, MutableSequence[int]] = {}
    definitions: list[tuple[int, int, int]] = []
    unpack = _MESSAGE_START.unpack_from
    last = limit - HEAD_SIZE
    while at <= last:
        code = data[at]
        if code == MESSAGE and at + MESSAGE_HEAD_SIZE <= limit:
            length, channel = unpack(data, at + 1)
            if length < MESSAGE_HEAD_SIZE - HEAD_SIZE or at + HEAD_SIZE + length > limit:
                break
            if channel in messages:
                messages[channel].append(at)
            else:
                messages[channel] = array("q", (at,))
        else:
            length = RECORD_HEAD.unpack_from(data, at)[1]
            if not (code in {SCHEMA, CHANNEL} or code >= PRIVATE) or at + HEAD_SIZE + length > limit:
                break
            definitions.append((code, at + HEAD_SIZE, at + HEAD_SIZE + length))
        at += HEAD_SIZE + length
    return FoundRecords(messages, definitions, at)
