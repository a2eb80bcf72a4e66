"""Channels, batches of messages, and the definitions of a file."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.records import ChannelRecord, SchemaRecord

Buffer = bytes | memoryview


@dataclass(frozen=True)
class Channel:
    """A stream of messages on a topic of one file; a topic may have several."""

    id: int
    topic: str
    schema_name: str
    schema_encoding: str
    schema_text: str
    message_encoding: str


@dataclass(frozen=True, eq=False)
class Batch:
    """Messages of one channel in one block of memory."""

    channel: Channel
    #: The bytes that hold them.
    raw: Buffer
    #: Where each payload starts in `raw` and its size in bytes, shape (n,), ascending.
    starts: IntArray
    sizes: IntArray
    #: Time of receipt in ns, shape (n,).
    log_time_ns: IntArray
    #: Place of each message in the file's order, shape (n,); only comparable within one file.
    order: IntArray

    def payload(self, number: int) -> bytes:
        """A copy of one payload, which does not keep the block in memory."""
        start = int(self.starts[number])
        return bytes(self.raw[start : start + int(self.sizes[number])])


def gathered(raw: Buffer, starts: IntArray, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Copies of the structures at many places.

    Args:
        raw: Bytes.
        starts: Where the structures start, shape (n,); all of them lie inside.
        dtype: The structure.

    Returns:
        Structures, shape (n,).
    """
    # gathered as plain bytes, which numpy does three times as fast
    size = dtype.itemsize
    if not size:
        return np.empty(len(starts), dtype=dtype)
    plain = np.ndarray((len(raw) - size + 1,), f"V{size}", raw, strides=(1,))[starts]
    return plain.view(dtype)


def message_batch(channel: Channel, raw: Buffer, offsets: IntArray, base: int) -> Batch | None:
    """Gather the heads of message records.

    Args:
        channel: Their channel.
        raw: The bytes that hold the records.
        offsets: Where the records start in `raw`, shape (n,).
        base: Place of `raw` in the file's order.

    Returns:
        The batch without the offsets that do not point to a message of this channel; None if no offset does.
    """
    last = len(raw) - records.MESSAGE_HEAD_SIZE
    offsets = offsets[(offsets >= 0) & (offsets <= last)]
    if not offsets.size:
        return None
    heads = gathered(raw, offsets, records.MESSAGE_HEAD)
    sizes = heads["length"].astype(np.int64) - (records.MESSAGE_HEAD_SIZE - records.HEAD_SIZE)
    starts = offsets + records.MESSAGE_HEAD_SIZE
    right = (heads["op"] == records.MESSAGE) & (heads["channel"] == channel.id) & (sizes >= 0)
    right &= sizes <= len(raw) - starts
    if not right.all():
        starts, sizes, offsets, heads = starts[right], sizes[right], offsets[right], heads[right]
    return (
        Batch(channel, raw, starts, sizes, heads["log_time"].astype(np.int64), offsets + base) if len(starts) else None
    )


@dataclass
class Definitions:
    """The schemas and channels of a file that are known so far."""

    schemas: dict[int, SchemaRecord] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    #: Channels whose records were found in the data section; others are known from the summary alone.
    met: set[int] = field(default_factory=set)
    _joined: dict[int, Channel] = field(default_factory=dict)

    def add(self, code: int, content: bytes) -> None:
        """Add a schema or channel record; other codes are ignored.

        Raises:
            struct.error, ValueError: The contents are malformed, or contradict another record (`records.MALFORMED`).
        """
        if code == records.SCHEMA:
            schema = records.parse_schema(content)
            if (known := self.schemas.setdefault(schema.id, schema)) != schema:
                both = f"as {known.name!r} and as {schema.name!r}"
                raise ValueError(f"schema {schema.id} is defined twice, {both}; the first definition is used")
        elif code == records.CHANNEL:
            channel = records.parse_channel(content)
            self.met.add(channel.id)
            if (one := self.channels.setdefault(channel.id, channel)) != channel:
                first, second = one[1:], channel[1:]
                both = f"as {first} and as {second}"
                raise ValueError(f"channel {channel.id} is defined twice, {both}; the first definition is used")

    def knows(self, number: int) -> bool:
        """Whether a channel is known, and its schema if it has one."""
        record = self.channels.get(number)
        return record is not None and (record.schema_id == 0 or record.schema_id in self.schemas)

    def channel(self, number: int) -> Channel:
        """A known channel with its schema, whose name and text are empty if it has none."""
        if number not in self._joined or not self._joined[number].schema_name:
            record = self.channels[number]
            schema = self.schemas.get(record.schema_id) or SchemaRecord(0, "", "", "")
            self._joined[number] = Channel(
                number, record.topic, schema.name, schema.encoding, schema.text, record.message_encoding
            )
        return self._joined[number]
