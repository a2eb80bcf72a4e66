"""What reading a log file hands on: channels and batches of messages; and the definitions of a file."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.records import ChannelRecord, SchemaRecord

Buffer = bytes | memoryview


@dataclass(frozen=True)
class Channel:
    """A topic's source in one file; several channels of one topic are legal."""

    id: int
    topic: str
    schema_name: str
    schema_encoding: str
    schema_text: str
    message_encoding: str


@dataclass(frozen=True, eq=False)
class Batch:
    """Messages of one channel that stand in one piece of memory."""

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

    def newest(self) -> "Batch":
        """The message received last, alone."""
        row = slice(at := len(self.log_time_ns) - 1 - int(self.log_time_ns[::-1].argmax()), at + 1)
        return Batch(self.channel, self.raw, self.starts[row], self.sizes[row], self.log_time_ns[row], self.order[row])

    def payload(self, number: int) -> bytes:
        """A copy of one payload, which does not keep the whole piece in memory."""
        start = int(self.starts[number])
        return bytes(self.raw[start : start + int(self.sizes[number])])


def gathered(raw: Buffer, starts: IntArray, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Copies of the same structure at many places.

    Args:
        raw: Bytes.
        starts: (n,) where the structures start, all of them inside.
        dtype: The structure.

    Returns:
        (n,) structures, gathered as plain bytes, which numpy does three times as fast.
    """
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
        The batch, without those offsets that point to something else than a message of this channel; None where all do.
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
    """The schemas and channels of a file, as far as they are known."""

    schemas: dict[int, SchemaRecord] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    #: Channels whose own records were met; others are known from the summary alone.
    met: set[int] = field(default_factory=set)
    _joined: dict[int, Channel] = field(default_factory=dict)

    def add(self, code: int, content: bytes) -> None:
        """Take up a schema or channel record; any other code does nothing.

        Raises:
            struct.error, ValueError: The contents are no such record, or contradict another one (`records.MALFORMED`).
        """
        if code == records.SCHEMA:
            schema = records.parse_schema(content)
            if (known := self.schemas.setdefault(schema.id, schema)) != schema:
                both = f"{known.name!r} and {schema.name!r}"
                raise ValueError(f"schema {schema.id} is defined in two ways, as {both}; the first counts")
        elif code == records.CHANNEL:
            channel = records.parse_channel(content)
            self.met.add(channel.id)
            if (one := self.channels.setdefault(channel.id, channel)) != channel:
                first, second = one[1:], channel[1:]
                raise ValueError(f"channel {channel.id} is defined as {first} and as {second}; the first counts")

    def knows(self, number: int) -> bool:
        """Whether a channel is known, and its schema unless it has none."""
        record = self.channels.get(number)
        return record is not None and (record.schema_id == 0 or record.schema_id in self.schemas)

    def channel(self, number: int) -> Channel:
        """A known channel joined with its schema; without one, the schema's name and text are empty."""
        if number not in self._joined or not self._joined[number].schema_name:
            record = self.channels[number]
            schema = self.schemas.get(record.schema_id) or SchemaRecord(0, "", "", "")
            self._joined[number] = Channel(
                number, record.topic, schema.name, schema.encoding, schema.text, record.message_encoding
            )
        return self._joined[number]
