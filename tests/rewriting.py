"""A log taken apart into its records, and put together again with right lengths, places, counts and CRCs.

What is changed in between is therefore consistent: no CRC and no length gives it away. Source of the format:
https://mcap.dev/spec.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import lz4.frame
import strict_log
import zstandard
from strict_log import CHANNEL, CHUNK, DATA_END, FOOTER, HEADER, INDEX, MAGIC, MESSAGE, METADATA, STATISTICS

CHUNK_INDEX, METADATA_INDEX, SUMMARY_OFFSET = 0x08, 0x0D, 0x0E
COMPRESSIONS = ("", "zstd", "lz4")
_TAIL = 9 + 20 + len(MAGIC)


@dataclass
class Part:
    """A record outside of chunks, or in a chunk."""

    code: int
    content: bytes
    #: Length that its head claims; None for the right one.
    claims: int | None = None

    def stored(self) -> bytes:
        length = len(self.content) if self.claims is None else self.claims
        return struct.pack("<BQ", self.code, length % 2**64) + self.content

    @property
    def channel(self) -> int:
        """Id of a message's channel."""
        return int.from_bytes(self.content[:2], "little")

    @property
    def log_time_ns(self) -> int:
        return int(struct.unpack_from("<Q", self.content, 6)[0])

    def with_time(self, log_time_ns: int) -> "Part":
        """A message of another time of receipt."""
        content = self.content[:6] + struct.pack("<Q", log_time_ns % 2**64) + self.content[14:]
        return Part(self.code, content, self.claims)

    def with_payload(self, payload: bytes) -> "Part":
        """A message of another payload."""
        return Part(self.code, self.content[:22] + payload, self.claims)


@dataclass
class ChunkParts:
    """A chunk."""

    parts: list[Part]
    compression: str
    #: Whether it has a CRC, and whether message indexes follow it.
    checked: bool
    indexed: bool
    #: Changes the entries of its message indexes, (time, offset) by channel, before they are written.
    reindex: Callable[[dict[int, list[tuple[int, int]]]], None] | None = None
    #: Added to the size that its head claims.
    oversized: int = 0

    @property
    def raw(self) -> bytes:
        return b"".join(part.stored() for part in self.parts)

    def entries(self) -> dict[int, list[tuple[int, int]]]:
        """Time and offset of its messages, by channel."""
        found: dict[int, list[tuple[int, int]]] = {}
        at = 0
        for part in self.parts:
            if part.code == MESSAGE and len(part.content) >= 22:
                found.setdefault(part.channel, []).append((part.log_time_ns, at))
            at += len(part.stored())
        return found

    def stored(self) -> tuple[bytes, dict[int, int], int, int]:
        """The chunk with its indexes; where each index starts, by channel; length of the chunk; its number of bytes."""
        raw = self.raw
        times = [part.log_time_ns for part in self.parts if part.code == MESSAGE and len(part.content) >= 22] or [0]
        name = self.compression.encode()
        packed = packed_by(self.compression, raw)
        crc = zlib.crc32(raw) if self.checked else 0
        size = (len(raw) + self.oversized) % 2**64
        head = struct.pack("<QQQI", min(times), max(times), size, crc) + _counted(name)
        chunk = Part(CHUNK, head + struct.pack("<Q", len(packed)) + packed).stored()
        entries, places, at = self.entries(), {}, len(chunk)
        if self.reindex is not None:
            self.reindex(entries)
        blocks = [chunk]
        for channel, pairs in entries.items() if self.indexed else ():
            listed = b"".join(struct.pack("<QQ", t % 2**64, at % 2**64) for t, at in pairs)
            blocks.append(Part(INDEX, struct.pack("<H", channel) + _counted(listed)).stored())
            places[channel] = at
            at += len(blocks[-1])
        return b"".join(blocks), places, len(chunk), len(raw)


def packed_by(compression: str, raw: bytes) -> bytes:
    """Bytes as a chunk stores them."""
    if compression == "zstd":
        return zstandard.ZstdCompressor().compress(raw)
    return lz4.frame.compress(raw) if compression == "lz4" else raw


def _counted(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


@dataclass
class Parts:
    """A whole log."""

    #: Records of the data section without its end.
    data: list[Part | ChunkParts]
    #: Records of the summary section, without those that point to places.
    summary: list[Part]
    #: Whether it has a summary, indexes of chunks and of metadata in it, a CRC of the summary, and one of the data.
    has_summary: bool
    chunk_indexes: bool
    metadata_indexes: bool
    summary_checked: bool
    data_checked: bool
    #: Changes the fields of the chunk indexes (start, end, place, length, places of message indexes, their length).
    rechunk: Callable[[list[list[int]], list[dict[int, int]]], None] | None = None
    #: Changes the counts of the statistics, by channel.
    recount: Callable[[Counter[int]], None] | None = None
    #: Moves the places of metadata records that the summary states.
    moved: list[int] = field(default_factory=list)

    def chunks(self) -> list[ChunkParts]:
        return [one for one in self.data if isinstance(one, ChunkParts)]

    def lists(self) -> list[list[Part]]:
        """The lists that hold messages: of each chunk, or of a log without chunks."""
        return [chunk.parts for chunk in self.chunks()] or [self.data]  # type: ignore[list-item]

    def messages(self) -> Iterator[tuple[list[Part], int]]:
        """Each message: the list that holds it, and its place in it."""
        for parts in self.lists():
            for number, part in enumerate(parts):
                if part.code == MESSAGE:
                    yield parts, number

    def stored(self) -> bytes:
        """The bytes of the file."""
        blocks, at = [MAGIC], len(MAGIC)
        fields: list[list[int]] = []
        places: list[dict[int, int]] = []
        texts: list[tuple[str, int, int]] = []
        metadata: list[tuple[int, bytes]] = []
        for one in self.data:
            if isinstance(one, ChunkParts):
                block, indexes, length, size = one.stored()
                start, end = struct.unpack_from("<QQ", block, 9)
                fields.append([start, end, at, length, len(block) - length])
                places.append({channel: at + place for channel, place in indexes.items()})
                texts.append((one.compression, length - 9 - 40 - len(one.compression), size))
            else:
                block = one.stored()
                if one.code == METADATA:
                    metadata.append((at, block))
            blocks.append(block)
            at += len(block)
        before = b"".join(blocks)
        before += Part(DATA_END, struct.pack("<I", zlib.crc32(before) if self.data_checked else 0)).stored()
        return before + self._closing(len(before), fields, places, texts, metadata)

    def _closing(
        self,
        start: int,
        fields: list[list[int]],
        places: list[dict[int, int]],
        texts: list[tuple[str, int, int]],
        metadata: list[tuple[int, bytes]],
    ) -> bytes:
        """The summary section and the footer."""
        if not self.has_summary:
            return Part(FOOTER, bytes(20)).stored() + MAGIC
        if self.rechunk is not None and fields:
            self.rechunk(fields, places)
        parts = [self._statistics(part, fields) if part.code == STATISTICS else part for part in self.summary]
        if self.chunk_indexes:
            for numbers, indexes, (name, packed, size) in zip(fields, places, texts, strict=True):
                begin, end, place, length, behind = (number % 2**64 for number in numbers)
                listed = b"".join(struct.pack("<HQ", one, where % 2**64) for one, where in indexes.items())
                content = struct.pack("<QQQQ", begin, end, place, length) + _counted(listed)
                content += struct.pack("<Q", behind) + _counted(name.encode()) + struct.pack("<QQ", packed, size)
                parts.append(Part(CHUNK_INDEX, content))
        for number, (at, block) in enumerate(metadata if self.metadata_indexes else ()):
            place = (self.moved[number] if number < len(self.moved) else 0) + at
            name, _ = strict_log.metadata(block[9:])
            content = struct.pack("<QQ", place % 2**64, len(block)) + _counted(name.encode())
            parts.append(Part(METADATA_INDEX, content))
        body = b"".join(part.stored() for part in parts)
        footer = struct.pack("<BQQQ", FOOTER, 20, start if body else 0, 0)
        crc = zlib.crc32(body + footer) if self.summary_checked else 0
        return body + footer + struct.pack("<I", crc) + MAGIC

    def _statistics(self, part: Part, fields: list[list[int]]) -> Part:
        """The statistics with the counts of these messages."""
        found = [parts[number] for parts, number in self.messages()]
        counts = Counter(message.channel for message in found)
        if self.recount is not None:
            self.recount(counts)
        times = [message.log_time_ns for message in found] or [0]
        _, schemas, channels, attachments, metadata = struct.unpack_from("<QHIII", part.content)
        content = struct.pack(
            *("<QHIIIIQQ", sum(counts.values()) % 2**64, schemas, channels, attachments, metadata, len(fields)),
            *(min(times), max(times)),
        )
        listed = b"".join(struct.pack("<HQ", channel, count % 2**64) for channel, count in counts.items())
        return Part(STATISTICS, content + _counted(listed))


def taken_apart(data: bytes) -> Parts:
    """The records of an intact log."""
    summary_start, _, summary_crc = struct.unpack_from("<QQI", data, len(data) - _TAIL + 9)
    tail = len(data) - _TAIL
    end = summary_start or tail
    found: list[Part | ChunkParts] = []
    data_crc = 0
    for record in strict_log.records_in(data, len(MAGIC), end):
        content = data[record.contents]
        if record.code == DATA_END:
            data_crc = int.from_bytes(content, "little")
        elif record.code == INDEX:
            last = found[-1]
            assert isinstance(last, ChunkParts)
            last.indexed = True
        elif record.code == CHUNK:
            raw = strict_log.uncompressed(content)
            parts = [Part(one.code, raw[one.contents]) for one in strict_log.records_in(raw, 0, len(raw))]
            _, crc, compression, _, _ = strict_log.chunk_head(content)
            found.append(ChunkParts(parts, compression, bool(crc), indexed=False))
        else:
            found.append(Part(record.code, content))
    summary, codes = [], set()
    for record in strict_log.records_in(data, end, tail):
        codes.add(record.code)
        if record.code not in {CHUNK_INDEX, METADATA_INDEX, SUMMARY_OFFSET}:
            summary.append(Part(record.code, data[record.contents]))
    assert isinstance(found[0], Part)
    assert found[0].code == HEADER
    indexes = CHUNK_INDEX in codes, METADATA_INDEX in codes
    return Parts(found, summary, bool(summary_start), *indexes, bool(summary_crc), bool(data_crc))


def channel_ids(parts: Parts) -> list[int]:
    """Ids of the channels that records define."""
    lists = [*parts.lists(), parts.summary, [one for one in parts.data if isinstance(one, Part)]]
    return sorted({part.channel for one in lists for part in one if part.code == CHANNEL})
