"""The summary section at the end of a complete MCAP file."""

import zlib
from dataclasses import dataclass, field
from typing import BinaryIO

from navirl_cli.logs import records
from navirl_cli.logs.records import ChannelRecord, ChunkIndex, Footer, SchemaRecord, Statistics


@dataclass
class Summary:
    """What a sound summary section says; empty where it says nothing."""

    schemas: dict[int, SchemaRecord] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    chunks: dict[int, ChunkIndex] = field(default_factory=dict)
    metadata_offsets: list[int] = field(default_factory=list)
    statistics: Statistics | None = None

    def add(self, code: int, content: bytes) -> None:
        """Take up one record of the section.

        Raises:
            struct.error, ValueError: The contents are no such record (`records.MALFORMED`).
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
            self.statistics = records.parse_statistics(content)


def read_footer(file: BinaryIO, size: int) -> Footer | None:
    """The footer of a file that ends as it should.

    Args:
        file: An MCAP file.
        size: Its size in bytes.

    Returns:
        The footer, or None where the file ends otherwise: its recorder was stopped, or its end was lost.
    """
    file.seek(max(0, size - records.TAIL_SIZE))
    tail = file.read(records.TAIL_SIZE)
    if len(tail) < records.TAIL_SIZE or not tail.endswith(records.MAGIC):
        return None
    code, length = records.RECORD_HEAD.unpack_from(tail)
    if code != records.FOOTER or length != 20:
        return None
    return records.parse_footer(tail[records.HEAD_SIZE : records.HEAD_SIZE + 20])


def read_summary(file: BinaryIO, size: int, data_start: int, footer: Footer) -> Summary | None:
    """Read the summary section if it is there and sound.

    Args:
        file: An MCAP file.
        size: Its size in bytes.
        data_start: First byte behind the header.
        footer: The file's footer.

    Returns:
        The summary, or None if there is none, its CRC is wrong, a record does not parse or an index points outside of
        the data.
    """
    end = size - records.TAIL_SIZE
    if not data_start <= footer.summary_start <= end:
        return None
    file.seek(footer.summary_start)
    data = file.read(end - footer.summary_start + records.HEAD_SIZE + 16)
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
    chunks = summary.chunks.values()
    inside = all(data_start <= chunk.start < chunk.stop <= footer.summary_start for chunk in chunks)
    return summary if inside else None
