"""Where records start again behind damage: by what a chunk or a message record must look like."""

from collections.abc import Callable
from collections.abc import Set as AbstractSet
from typing import Final

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.chunks import COMPRESSIONS, MAX_CHUNK_BYTES
from navirl_cli.logs.container.records import HEAD_SIZE, Found

#: Bytes searched at once, first and at most: where there are many holes each is small.
_FIRST, _BLOCK = 1 << 12, 1 << 20
#: How many of them overlap: the longest head that is looked at.
_OVERLAP: Final = 128
#: Bytes of a chunk's head beside the compression's name.
_CHUNK_HEAD: Final = 40
#: What may stand in the data section.
_DATA_CODES: Final = frozenset(
    {
        records.SCHEMA,
        records.CHANNEL,
        records.MESSAGE,
        records.CHUNK,
        records.MESSAGE_INDEX,
        records.ATTACHMENT,
        records.METADATA,
        records.DATA_END,
    }
)

#: Bytes [start, stop) of something, fewer where it ends.
Peek = Callable[[int, int], bytes]


def starts_record(peek: Peek, at: int, size: int) -> bool:
    """Whether a record of the data section can start at a byte, or the data end there.

    Args:
        peek: Gives bytes.
        at: The byte.
        size: Number of bytes that there are.
    """
    if at == size:
        return True
    head = peek(at, at + HEAD_SIZE)
    if len(head) < HEAD_SIZE:
        return False
    code, length = records.RECORD_HEAD.unpack(head)
    return bool((code in _DATA_CODES or code >= records.PRIVATE) and at + HEAD_SIZE + length <= size)


def next_record(peek: Peek, at: int, size: int, channels: AbstractSet[int]) -> int | None:
    """Find the next chunk, or message of a known channel.

    Args:
        peek: Gives bytes.
        at: Where the search starts.
        size: Number of bytes that there are.
        channels: Ids of known channels; where it is empty only chunks are found.

    Returns:
        Where it starts: a head whose lengths agree and behind whose record another can start, or None.
    """
    length = _FIRST
    while at < size - HEAD_SIZE:
        block = peek(at, min(size, at + length))
        for candidate in _candidates(block).tolist():
            if _convinces(peek, at + candidate, size, channels):
                return int(at + candidate)
        if at + len(block) >= size or len(block) <= _OVERLAP:
            return None
        at += len(block) - _OVERLAP
        length = min(4 * length, _BLOCK)
    return None


def walk_on(data: bytes | memoryview, channels: AbstractSet[int]) -> tuple[Found, list[tuple[int, int]]]:
    """Walk over the records of a chunk, and go on behind damage.

    Args:
        data: The chunk's records.
        channels: Ids of known channels; those that are met on the way count too.

    Returns:
        What was found, and the bytes [start, stop) that hold no records.
    """
    size = len(data)
    found = records.walk(data, size)
    holes: list[tuple[int, int]] = []
    while found.stop < size:
        known = found.messages.keys() | channels
        again = next_record(lambda start, stop: bytes(data[start:stop]), found.stop + 1, size, known)
        holes.append((found.stop, size if again is None else again))
        if again is None:
            break
        more = records.walk(data, size, again)
        for channel, offsets in more.messages.items():
            found.messages.setdefault(channel, []).extend(offsets)
        found = Found(found.messages, [*found.definitions, *more.definitions], more.stop)
    return found, holes


def _candidates(block: bytes) -> IntArray:
    """Offsets at which a chunk or message record of less than 4 GB can start."""
    data = np.frombuffer(block, dtype=np.uint8)
    n = len(data) - HEAD_SIZE + 1
    fits = ((data[:n] == records.MESSAGE) | (data[:n] == records.CHUNK)) & (data[8 : n + 8] == 0)
    for high in (5, 6, 7):
        fits &= data[high : n + high] == 0
    return np.flatnonzero(fits)


def _convinces(peek: Peek, at: int, size: int, channels: AbstractSet[int]) -> bool:
    """Whether the record that could start there is one."""
    code, length = records.RECORD_HEAD.unpack(peek(at, at + HEAD_SIZE))
    stop = at + HEAD_SIZE + length
    if code == records.MESSAGE:
        channel = int.from_bytes(peek(at + HEAD_SIZE, at + HEAD_SIZE + 2), "little")
        whole = length >= records.MESSAGE_HEAD_SIZE - HEAD_SIZE and channel in channels
        return whole and stop <= size and starts_record(peek, stop, size)
    try:
        head = records.parse_chunk_head(peek(at + HEAD_SIZE, at + HEAD_SIZE + _CHUNK_HEAD + 8))
    except records.MALFORMED:
        return False
    agrees = head.compression in COMPRESSIONS and head.data_start + head.data_size == length
    # a chunk may be cut by the end of the file
    return agrees and head.size <= MAX_CHUNK_BYTES and (stop > size or starts_record(peek, stop, size))
