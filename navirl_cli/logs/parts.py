"""What reading a container hands on: channels, batches of messages, and what was damaged."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from navirl_cli.logs import records
from navirl_cli.logs.records import ChannelRecord, IntArray, SchemaRecord


@dataclass(frozen=True)
class Damage:
    """A part of a file that could not be used."""

    path: Path
    #: Bytes [start, stop) of the file.
    start: int
    stop: int
    #: What happened, and what was lost by it.
    reason: str

    def __str__(self) -> str:
        return f"{self.path}: bytes {self.start} to {self.stop}: {self.reason}"


@dataclass(frozen=True)
class Channel:
    """A topic's source in one file; several channels of one topic are legal."""

    id: int
    topic: str
    schema_name: str
    schema_encoding: str
    schema_text: str
    message_encoding: str


@dataclass(frozen=True)
class Batch:
    """Messages of one channel that stand in one piece of memory."""

    channel: Channel
    #: The bytes that hold them.
    raw: bytes
    #: Where each payload starts in `raw` and its size in bytes, shape (n,), ascending.
    starts: IntArray
    sizes: IntArray
    #: Time of receipt in ns, shape (n,).
    log_time_ns: IntArray
    #: Place of each message in the file's order, shape (n,); only comparable within one file.
    order: IntArray

    def payload(self, number: int) -> bytes:
        """A copy of one payload, which does not keep the whole piece in memory."""
        start = int(self.starts[number])
        return self.raw[start : start + int(self.sizes[number])]


def message_batch(channel: Channel, raw: bytes, offsets: IntArray, base: int) -> Batch | None:
    """Gather the heads of message records.

    Args:
        channel: Their channel.
        raw: The bytes that hold the records.
        offsets: Where the records start in `raw`, shape (n,).
        base: Place of `raw` in the file's order.

    Returns:
        The batch, or None where an offset points to something else than a message of this channel.
    """
    last = len(raw) - records.MESSAGE_HEAD_SIZE
    if not offsets.size or offsets.min() < 0 or offsets.max() > last:
        return None
    heads = np.ndarray((last + 1,), records.MESSAGE_HEAD, raw, strides=(1,))[offsets]
    sizes = heads["length"].astype(np.int64) - (records.MESSAGE_HEAD_SIZE - records.HEAD_SIZE)
    starts = offsets + records.MESSAGE_HEAD_SIZE
    right = (heads["op"] == records.MESSAGE) & (heads["channel"] == channel.id) & (sizes >= 0)
    if not (right & (sizes <= len(raw) - starts)).all():
        return None
    return Batch(channel, raw, starts, sizes, heads["log_time"].astype(np.int64), offsets + base)


@dataclass
class Definitions:
    """The schemas and channels of a file, as far as they are known."""

    schemas: dict[int, SchemaRecord] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    _joined: dict[int, Channel] = field(default_factory=dict)

    def add(self, code: int, content: bytes) -> None:
        """Take up a schema or channel record; any other code does nothing.

        Raises:
            struct.error, ValueError: The contents are no such record (`records.MALFORMED`).
        """
        if code == records.SCHEMA:
            schema = records.parse_schema(content)
            self.schemas.setdefault(schema.id, schema)
        elif code == records.CHANNEL:
            channel = records.parse_channel(content)
            self.channels.setdefault(channel.id, channel)

    def channel(self, number: int) -> Channel:
        """A known channel joined with its schema; without one, the schema's name and text are empty."""
        if number not in self._joined:
            record = self.channels[number]
            schema = self.schemas.get(record.schema_id) or SchemaRecord(0, "", "", "")
            self._joined[number] = Channel(
                number, record.topic, schema.name, schema.encoding, schema.text, record.message_encoding
            )
        return self._joined[number]
