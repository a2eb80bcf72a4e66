"""A slow and strict twin of the reader: it reads what the specification allows, and refuses everything else.

Source: https://mcap.dev/spec. It stops at the first fault and takes nothing from indexes: the messages are those that a
walk over the data section meets.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX = range(1, 8)
ATTACHMENT, STATISTICS, METADATA, DATA_END, PRIVATE = 0x09, 0x0B, 0x0C, 0x0F, 0x80


class FaultError(Exception):
    """The bytes break the specification; the message gives the reason."""


class Record(NamedTuple):
    """Bytes [start, stop) of the file or chunk that holds the record, with its head of nine bytes."""

    code: int
    start: int
    stop: int

    @property
    def contents(self) -> slice:
        return slice(self.start + 9, self.stop)


class StrictMessage(NamedTuple):
    """A message and where it stands."""

    channel: int
    log_time_ns: int
    #: The chunk's uncompressed bytes, or the file's, and where the message stands in them.
    raw: bytes
    place: Record
    chunk: Record | None

    @property
    def record(self) -> bytes:
        """The bytes of the record, with its head."""
        return self.raw[self.place.start : self.place.stop]

    @property
    def payload(self) -> bytes:
        return self.raw[self.place.start + 31 : self.place.stop]


@dataclass
class StrictLog:
    """What is in a file."""

    #: Records of the data section, then of the summary section.
    records: list[Record] = field(default_factory=list)
    #: By id of a schema: name, encoding, text. By id of a channel: schema's id, topic, encoding of the messages.
    schemas: dict[int, tuple[str, str, bytes]] = field(default_factory=dict)
    channels: dict[int, tuple[int, str, str]] = field(default_factory=dict)
    messages: list[StrictMessage] = field(default_factory=list)
    #: Number of messages by channel id, by the summary's statistics and by the message indexes.
    counted: dict[int, int] = field(default_factory=dict)
    indexed: dict[int, int] = field(default_factory=dict)

    def chunks(self) -> list[Record]:
        return [record for record in self.records if record.code == CHUNK]

    def of(self, *topics: str) -> list[StrictMessage]:
        ids = {number for number, (_, topic, _) in self.channels.items() if topic in topics}
        return [message for message in self.messages if message.channel in ids]


def records_in(data: bytes, at: int, stop: int) -> Iterator[Record]:
    """Hop from record to record, up to `stop` exactly."""
    while at < stop:
        if at + 9 > stop:
            raise FaultError(f"a record's head is cut at {at}")
        code, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > stop:
            raise FaultError(f"record {code:#x} at {at} is longer than its section")
        yield Record(code, at, at + 9 + length)
        at += 9 + length


def walk(data: bytes) -> StrictLog:
    """Everything in a file.

    Raises:
        FaultError: The data section, the end of the file or a CRC breaks the specification.
    """
    found = StrictLog()
    try:
        _walk(data, found)
    except (struct.error, ValueError) as error:
        raise FaultError(str(error)) from error
    return found


def chunk_head(data: bytes) -> tuple[int, int, str, int, int]:
    """Of a chunk's contents: uncompressed size, CRC, compression, first byte and number of the compressed bytes."""
    size, crc = struct.unpack_from("<QI", data, 16)
    compression, at = _text(data, 28)
    (count,) = struct.unpack_from("<Q", data, at)
    return size, crc, compression, at + 8, count


def uncompressed(data: bytes) -> bytes:
    """The records of a chunk, given its contents.

    Raises:
        FaultError: They do not decompress, or size or CRC are wrong.
    """
    size, crc, compression, at, count = chunk_head(data)
    if at + count > len(data):
        raise FaultError("a chunk is longer than its record")
    packed = data[at : at + count]
    try:
        if compression == "zstd":
            raw = zstandard.ZstdDecompressor().decompressobj().decompress(packed) if size else b""
        elif compression == "lz4":
            raw = lz4.frame.decompress(packed)
        elif compression:
            raise FaultError(f"compression {compression!r}")
        else:
            raw = packed
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise FaultError(f"a chunk does not decompress: {error}") from error
    if len(raw) != size or (crc and zlib.crc32(raw) != crc):
        raise FaultError("the size or CRC of a chunk is wrong")
    return raw


def decompressed(data: bytes) -> bytes:
    """The MCAP bytes of a file, decompressed where it is a compressed file.

    Raises:
        FaultError: It does not decompress.
    """
    found = b""
    try:
        while data.startswith((b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18")):
            stream = (
                zstandard.ZstdDecompressor().decompressobj() if data[0] == 0x28 else lz4.frame.LZ4FrameDecompressor()
            )
            found += stream.decompress(data)
            if not stream.eof:
                raise FaultError("the compression is cut")
            data = stream.unused_data or b""
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise FaultError(f"the compression is damaged: {error}") from error
    if found and data:
        raise FaultError("bytes stand behind the compressed frames")
    return found or data


def metadata(data: bytes) -> tuple[str, dict[str, str]]:
    """Name and entries of a metadata record, given its contents."""
    name, at = _text(data, 0)
    (size,) = struct.unpack_from("<I", data, at)
    at, stop = at + 4, at + 4 + size
    if stop > len(data):
        raise FaultError("metadata longer than its record")
    texts = []
    while at < stop:
        text, at = _text(data, at)
        texts.append(text)
    return name, dict(zip(texts[::2], texts[1::2], strict=True))


def _walk(data: bytes, found: StrictLog) -> None:
    if not data.startswith(MAGIC) or not data.endswith(MAGIC) or len(data) < 60:
        raise FaultError("no magic")
    tail = Record(FOOTER, len(data) - 37, len(data) - 8)
    if struct.unpack_from("<BQ", data, tail.start) != (FOOTER, 20):
        raise FaultError("no footer")
    summary_start, _, summary_crc = struct.unpack_from("<QQI", data, tail.start + 9)
    end = summary_start or tail.start
    if not 8 < end <= tail.start:
        raise FaultError("the summary starts outside of the file")
    found.records = list(records_in(data, 8, end))
    if found.records[0].code != HEADER or found.records[-1].code != DATA_END:
        raise FaultError("the data section lacks its header or its end")
    _, at = _text(content := data[found.records[0].contents], 0)
    _text(content, at)
    for record in found.records[1:-1]:
        _take(data, record, found)
    (crc,) = struct.unpack_from("<I", data[found.records[-1].contents])
    if crc and crc != zlib.crc32(data[: found.records[-1].start]):
        raise FaultError("the CRC of the data is wrong")
    if summary_start and not (summary_crc and zlib.crc32(data[summary_start : tail.start + 25]) != summary_crc):
        _take_summary(data, summary_start, tail.start, found)
    for number in {message.channel for message in found.messages}:
        if number not in found.channels or found.channels[number][0] not in {0, *found.schemas}:
            raise FaultError(f"channel {number} or its schema is not defined")


def _take(data: bytes, record: Record, found: StrictLog) -> None:
    """Add a record of the data section."""
    content = data[record.contents]
    if record.code == CHUNK:
        raw = uncompressed(content)
        for inner in records_in(raw, 0, len(raw)):
            if inner.code not in {SCHEMA, CHANNEL, MESSAGE} and inner.code < PRIVATE:
                raise FaultError(f"record {inner.code:#x} in a chunk")
            _take_one(raw, inner, found, record)
    elif record.code == INDEX:
        channel, size = struct.unpack_from("<HI", content)
        if size % 16 or 6 + size > len(content):
            raise FaultError("the size of a message index is wrong")
        places = {struct.unpack_from("<Q", content, at)[0] for at in range(14, 6 + size, 16)}
        found.indexed[channel] = found.indexed.get(channel, 0) + len(places)
    elif record.code == METADATA:
        metadata(content)
    elif record.code in {SCHEMA, CHANNEL, MESSAGE}:
        _take_one(data, record, found, None)
    elif record.code != ATTACHMENT and record.code < PRIVATE:
        raise FaultError(f"record {record.code:#x} in the data section")


def _take_one(data: bytes, record: Record, found: StrictLog, chunk: Record | None) -> None:
    """Add a schema, channel or message."""
    if record.code == MESSAGE:
        if record.stop - record.start < 31:
            raise FaultError("a message shorter than its head")
        channel, _, log_time_ns = struct.unpack_from("<HIQ", data, record.start + 9)
        found.messages.append(StrictMessage(channel, _signed(log_time_ns), data, record, chunk))
    elif record.code in {SCHEMA, CHANNEL}:
        _define(record.code, data[record.contents], found.schemas, found.channels)


def _define(
    code: int, content: bytes, schemas: dict[int, tuple[str, str, bytes]], channels: dict[int, tuple[int, str, str]]
) -> None:
    """Add a schema or channel, which no other record may define otherwise."""
    if code == SCHEMA:
        (number,) = struct.unpack_from("<H", content)
        name, at = _text(content, 2)
        encoding, at = _text(content, at)
        (size,) = struct.unpack_from("<I", content, at)
        if at + 4 + size > len(content):
            raise FaultError("a definition longer than its record")
        schema = name, encoding, content[at + 4 : at + 4 + size]
        if schemas.setdefault(number, schema) != schema:
            raise FaultError(f"schema {number} is defined twice, differently")
    else:
        number, schema_id = struct.unpack_from("<HH", content)
        topic, at = _text(content, 4)
        encoding, _ = _text(content, at)
        channel = schema_id, topic, encoding
        if channels.setdefault(number, channel) != channel:
            raise FaultError(f"channel {number} is defined twice, differently")


def _take_summary(data: bytes, start: int, stop: int, found: StrictLog) -> None:
    """Add the summary section, or nothing of it where it has a fault; it defines what the data section does not."""
    schemas: dict[int, tuple[str, str, bytes]] = {}
    channels: dict[int, tuple[int, str, str]] = {}
    try:
        records = list(records_in(data, start, stop))
        for record in records:
            content = data[record.contents]
            if record.code in {SCHEMA, CHANNEL}:
                _define(record.code, content, schemas, channels)
            if record.code == STATISTICS:
                (size,) = struct.unpack_from("<I", content, 42)
                found.counted = dict(struct.iter_unpack("<HQ", content[46 : 46 + size]))
    except (FaultError, struct.error, ValueError):
        found.counted = {}
        return
    found.schemas = schemas | found.schemas
    found.channels = channels | found.channels
    found.records += records


def _text(data: bytes, at: int) -> tuple[str, int]:
    (size,) = struct.unpack_from("<I", data, at)
    if at + 4 + size > len(data):
        raise FaultError("a text longer than its record")
    return data[at + 4 : at + 4 + size].decode(), at + 4 + size


def _signed(value: int) -> int:
    return value - (1 << 64) if value >> 63 else value
