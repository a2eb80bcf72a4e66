"""The header of an MCAP file, and the summary section at the end of a complete one."""

import zlib
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from navirl_cli.errors import LogError
from navirl_cli.logs.container import records
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.container.records import ChannelRecord, ChunkIndex, Footer, SchemaRecord, Statistics

#: Records that may follow the data section.
_AFTER_DATA: Final = frozenset(
    {
        records.SCHEMA,
        records.CHANNEL,
        records.CHUNK_INDEX,
        records.ATTACHMENT_INDEX,
        records.STATISTICS,
        records.METADATA_INDEX,
        records.SUMMARY_OFFSET,
        records.FOOTER,
    }
)
_DATA_END_SIZE: Final = 4
_FOOTER_SIZE: Final = 20


@dataclass
class Summary:
    """The records of an intact summary section; empty where it has none."""

    schemas: dict[int, SchemaRecord] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    chunks: dict[int, ChunkIndex] = field(default_factory=dict)
    metadata_offsets: list[int] = field(default_factory=list)
    statistics: Statistics | None = None

    def add(self, code: int, content: bytes) -> None:
        """Add a record of the section.

        Raises:
            struct.error, ValueError: The contents are malformed (`records.MALFORMED`).
        """
        if code == records.SCHEMA:
            schema = records.parse_schema(content)
            self.schemas[schema.id] = schema
        elif code == records.CHANNEL:
            channel = records.parse_channel(content)
            self.channels[channel.id] = channel
        elif code == records.CHUNK_INDEX:
            chunk = records.parse_chunk_index(content)
            self.chunks[chunk.start] = chunk
        elif code == records.METADATA_INDEX:
            self.metadata_offsets.append(records.parse_metadata_index(content))
        elif code == records.STATISTICS:
            statistics = records.parse_statistics(content)
            # counts by channel that are missing or do not add up are of no use
            if sum(statistics.by_channel.values()) == statistics.messages:
                self.statistics = statistics


def read_header(raw: RawFile) -> tuple[str, str, int]:
    """Profile, library and the first byte after the header.

    Args:
        raw: A file that starts with MCAP's magic.

    Raises:
        LogError: No header follows the magic.
    """
    path, size, start = raw.path, raw.size, len(records.MAGIC) + records.HEAD_SIZE
    head = raw.read(0, start)
    code, length = records.RECORD_HEAD.unpack_from(head.ljust(start, b"\0"), len(records.MAGIC))
    if len(head) >= start and code != records.HEADER:
        raise LogError(
            f"{path}: expected a header record after the magic, found record code {code:#04x}; "
            "the file is damaged: copy it again"
        )
    if len(head) < start or start + length > size:
        raise LogError(
            f"{path}: expected a header record after the magic, found the end of the file after "
            f"{size} bytes; nothing was recorded: record or copy it again"
        )
    try:
        return *records.parse_header(raw.read(start, start + length)), start + length
    except records.MALFORMED as error:
        raise LogError(
            f"{path}: expected a header record after the magic, found one that does not parse ({error}); "
            "the file is damaged: copy it again"
        ) from error


def read_footer(raw: RawFile) -> Footer | None:
    """The footer of a file that ends as it should.

    Args:
        raw: An MCAP file.

    Returns:
        The footer; None where the file does not end with one, because its recorder was stopped or its end was lost.
    """
    tail = raw.read(max(0, raw.size - records.TAIL_SIZE), raw.size)
    if len(tail) < records.TAIL_SIZE or not tail.endswith(records.MAGIC):
        return None
    code, length = records.RECORD_HEAD.unpack_from(tail)
    if code != records.FOOTER or length != _FOOTER_SIZE:
        return None
    return records.parse_footer(tail[records.HEAD_SIZE : records.HEAD_SIZE + _FOOTER_SIZE])


def read_summary(raw: RawFile, data_start: int, footer: Footer) -> Summary | None:
    """Read the summary section if it is there and intact.

    Args:
        raw: An MCAP file.
        data_start: First byte after the header.
        footer: The file's footer.

    Returns:
        The summary; None if it is missing, its CRC is wrong, a record does not parse, or chunks overlap or lie outside
        of the data.
    """
    end = raw.size - records.TAIL_SIZE
    if not data_start <= footer.summary_start <= end:
        return None
    data = raw.read(footer.summary_start, end + records.HEAD_SIZE + 16)
    if footer.summary_crc and zlib.crc32(data) != footer.summary_crc:
        return None
    summary = Summary()
    at, stop = 0, end - footer.summary_start
    try:
        while at < stop:
            code, length = records.RECORD_HEAD.unpack_from(data, at)
            at += records.HEAD_SIZE + length
            if at > stop:
                return None
            summary.add(code, data[at - length : at])
    except records.MALFORMED:
        return None
    # a channel without its schema is of no use; the chunks define both
    for number, channel in list(summary.channels.items()):
        if channel.schema_id and channel.schema_id not in summary.schemas:
            del summary.channels[number]
    # each chunk lies in the data section, after the one before
    starts = [*sorted(summary.chunks), footer.summary_start]
    fits = all(start < summary.chunks[start].stop <= following for start, following in pairwise(starts))
    return summary if fits and starts[0] >= data_start else None


def ends_data(raw: RawFile, footer: Footer | None, at: int) -> bool:
    """Whether the record that starts at a byte ends the data section; damage can look like such a record.

    Args:
        raw: The file's bytes.
        footer: None where the file does not end as it should.
        at: The byte.
    """
    code, length = records.RECORD_HEAD.unpack(raw.peek(at, at + records.HEAD_SIZE))
    stop = at + records.HEAD_SIZE + length
    if footer is not None:
        tail = raw.size - records.TAIL_SIZE
        return (code == records.FOOTER and at == tail) or (
            code == records.DATA_END and stop == (footer.summary_start or tail)
        )
    if code == records.DATA_END and length == _DATA_END_SIZE:
        following = raw.peek(stop, stop + 1)
        return not following or following[0] in _AFTER_DATA
    return bool(code == records.FOOTER and length == _FOOTER_SIZE)
