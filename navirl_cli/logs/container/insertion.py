"""A copy of an MCAP file with one metadata record more; all bytes of the data section stay as they are.

Source: the MCAP file format specification, https://mcap.dev/spec.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import zstandard

from navirl_cli.logs.container import records
from navirl_cli.logs.container.raw import BLOCK, RawFile
from navirl_cli.logs.container.records import RECORD_HEAD, Footer
from navirl_cli.logs.container.summary import read_footer, read_header, read_summary

_DATA_END: Final = struct.Struct("<BQI")
_FOOTER: Final = struct.Struct("<QQI")
#: Where the number of metadata records stands in a statistics record.
_COUNT_AT: Final = records.HEAD_SIZE + 18


@contextmanager
def writing(path: Path, compression: str) -> Iterator[BinaryIO]:
    """A stream into a file, compressed by "zstd", "lz4" or not at all ("")."""
    with ExitStack() as stack:
        stream: BinaryIO = stack.enter_context(path.open("wb"))
        if compression == "zstd":
            stream = stack.enter_context(zstandard.ZstdCompressor().stream_writer(stream))
        elif compression == "lz4":
            import lz4.frame

            stream = stack.enter_context(lz4.frame.open(stream, "wb"))
        yield stream


def write_with_metadata(
    raw: RawFile, target: BinaryIO, name: str, values: Mapping[str, str], *, in_front: bool = False
) -> None:
    """Write a file's bytes and a metadata record, which stands last in the data section.

    Statistics, indexes and CRCs are corrected. A CRC that is wrong stays wrong and a damaged summary damaged, so that
    the copy reports the same damage.

    Args:
        raw: The file, decompressed if it was compressed.
        target: Where to write.
        name: Of the record.
        values: Its texts by key.
        in_front: Whether the record stands before the messages. Possible where :func:`is_walked`. A file without its
            end has no other place for it.

    Raises:
        LogError: The file has no header.
    """
    record = _metadata(name, values)
    data_start, footer = read_header(raw)[2], _footer(raw)
    if footer is None:
        place = _front(raw, data_start, name)
        _copy(raw, target, 0, place)
        target.write(record)
        _copy(raw, target, place, raw.size)
        return
    end, stop = _data_end(raw, footer)
    place = _front(raw, data_start, name) if in_front else end
    crc = _copy(raw, target, 0, place)
    target.write(record)
    longer = _copy(raw, target, place, end, zlib.crc32(record, crc))
    target.write(_with_crc(raw.read(end, stop), raw.crc(end), longer))
    for part in _ending(raw, footer, data_start, (place, name, record)):
        target.write(part)


def is_walked(raw: RawFile) -> bool:
    """Whether readers walk over the file, because it has no intact summary: nothing points to bytes by number."""
    footer = _footer(raw)
    return footer is None or read_summary(raw, read_header(raw)[2], footer) is None


def _footer(raw: RawFile) -> Footer | None:
    """The footer; None where it is missing, or puts the summary outside of the file."""
    footer, tail = read_footer(raw), raw.size - records.TAIL_SIZE
    return footer if footer and read_header(raw)[2] <= (footer.summary_start or tail) <= tail else None


def _front(raw: RawFile, at: int, name: str) -> int:
    """Where a record stands in front: at a byte, or after records of the same name that stand there among others."""
    place = at
    while True:
        head = raw.read(at, at + records.HEAD_SIZE)
        if len(head) < records.HEAD_SIZE:
            return place
        code, length = RECORD_HEAD.unpack(head)
        if code != records.METADATA or at + records.HEAD_SIZE + length > raw.size:
            return place
        content = raw.read(at + records.HEAD_SIZE, at + records.HEAD_SIZE + length)
        at += records.HEAD_SIZE + length
        try:
            place = at if records.parse_metadata(content)[0] == name else place
        except records.MALFORMED:
            return place


def _metadata(name: str, values: Mapping[str, str]) -> bytes:
    """A metadata record."""
    entries = b"".join(_string(key) + _string(value) for key, value in values.items())
    return _record(records.METADATA, _string(name) + struct.pack("<I", len(entries)) + entries)


def _string(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _record(code: int, content: bytes) -> bytes:
    return RECORD_HEAD.pack(code, len(content)) + content


def _copy(raw: RawFile, target: BinaryIO, start: int, stop: int, crc: int = 0) -> int:
    """Copy bytes [start, stop), and return the CRC of all bytes so far, given that of those before."""
    for at in range(start, stop, BLOCK):
        block = raw.read(at, min(stop, at + BLOCK))
        crc = zlib.crc32(block, crc)
        target.write(block)
    return crc


def _data_end(raw: RawFile, footer: Footer) -> tuple[int, int]:
    """First byte of the record that ends the data section and first byte after it; the same where it is missing."""
    stop = footer.summary_start or raw.size - records.TAIL_SIZE
    start = stop - _DATA_END.size
    code, length = RECORD_HEAD.unpack(raw.read(start, start + records.HEAD_SIZE))
    return (start, stop) if (code, length) == (records.DATA_END, 4) else (stop, stop)


def _with_crc(data_end: bytes, before: int, after: int) -> bytes:
    """The data end record with the CRC of the longer section, where it had the right one of the section before."""
    if not data_end:
        return data_end
    code, length, written = _DATA_END.unpack(data_end)
    return _DATA_END.pack(code, length, after) if written and written == before else data_end


def _ending(raw: RawFile, footer: Footer, data_start: int, added: tuple[int, str, bytes]) -> Iterator[bytes]:
    """Summary section, footer and magic, corrected for a record (place, name, bytes) that was added."""
    place, name, record = added
    tail = raw.size - records.TAIL_SIZE
    start = footer.summary_start
    content = raw.read(tail + records.HEAD_SIZE, tail + records.HEAD_SIZE + _FOOTER.size)
    _, offsets_start, crc = _FOOTER.unpack(content)
    summary = raw.read(start, tail) if start else b""
    if start and read_summary(raw, data_start, footer) is not None:
        index = _record(records.METADATA_INDEX, struct.pack("<QQ", place, len(record)) + _string(name))
        new = _Section.of(summary).with_index(index)
        summary = new.written(start + len(record), with_offsets=offsets_start != 0)
        offsets_start = start + len(record) + new.size if offsets_start else 0
        start += len(record)
        head = RECORD_HEAD.pack(records.FOOTER, _FOOTER.size) + struct.pack("<QQ", start, offsets_start)
        crc = zlib.crc32(head, zlib.crc32(summary)) if crc else 0
    elif start:  # damaged: its bytes stay
        start, offsets_start = start + len(record), offsets_start + len(record) if offsets_start else 0
    yield summary
    yield _record(records.FOOTER, _FOOTER.pack(start, offsets_start, crc))
    yield records.MAGIC


@dataclass(frozen=True)
class _Section:
    """The records of an intact summary section without their summary offsets, in order."""

    records: tuple[bytes, ...]

    @classmethod
    def of(cls, summary: bytes) -> "_Section":
        """Cut the section into its records."""
        found = []
        at = 0
        while at < len(summary):
            code, length = RECORD_HEAD.unpack_from(summary, at)
            stop = at + records.HEAD_SIZE + length
            if code != records.SUMMARY_OFFSET:
                found.append(summary[at:stop])
            at = stop
        return cls(tuple(found))

    @property
    def size(self) -> int:
        """Bytes of the records."""
        return sum(map(len, self.records))

    def with_index(self, index: bytes) -> "_Section":
        """The section with a metadata index after the others, and one metadata record more in the statistics."""
        own = [number for number, one in enumerate(self.records) if one[0] == records.METADATA_INDEX]
        place = own[-1] + 1 if own else len(self.records)
        several = [*self.records[:place], index, *self.records[place:]]
        return _Section(tuple(_counted(one) if one[0] == records.STATISTICS else one for one in several))

    def written(self, start: int, *, with_offsets: bool) -> bytes:
        """The section from a byte of the file on, with the offsets of its groups."""
        groups: dict[int, tuple[int, int]] = {}
        at = start
        for one in self.records:
            first, size = groups.get(one[0], (at, 0))
            # a group ends where a record of another type follows
            groups[one[0]] = (first, size + len(one)) if first + size == at else (first, size)
            at += len(one)
        offsets = [
            _record(records.SUMMARY_OFFSET, struct.pack("<BQQ", code, first, size))
            for code, (first, size) in groups.items()
        ]
        return b"".join([*self.records, *(offsets if with_offsets else [])])


def _counted(statistics: bytes) -> bytes:
    """A statistics record with one metadata record more."""
    (count,) = struct.unpack_from("<I", statistics, _COUNT_AT)
    return statistics[:_COUNT_AT] + struct.pack("<I", count + 1) + statistics[_COUNT_AT + 4 :]
