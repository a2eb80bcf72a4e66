"""Where records start again after damage, found by what a chunk or a message record must look like."""

from array import array
from collections.abc import Callable
from collections.abc import Set as AbstractSet
from typing import Final

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.chunks import COMPRESSIONS, MAX_CHUNK_BYTES
from navirl_cli.logs.container.records import HEAD_SIZE, FoundRecords

#: Bytes searched at once, first and at most: where there are many gaps, each is small.
_FIRST, _BLOCK = 1 << 12, 1 << 20
#: Overlap of two blocks, bytes: the longest header that is looked at.
_OVERLAP: Final = 128
#: Bytes of a chunk's header without the compression's name.
_CHUNK_HEAD: Final = 40
#: Records of the data section.
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

#: Returns bytes [start, stop) of a file or chunk, fewer at its end.
Peek = Callable[[int, int], bytes]


def starts_record(peek: Peek, at: int, size: int) -> bool:
    """Whether a record of the data section can start at a byte, or the data can end there.

    Args:
        peek: Returns bytes.
        at: The byte.
        size: Number of all bytes.
    """
    if at == size:
        return True
    head = peek(at, at + HEAD_SIZE)
    if len(head) < HEAD_SIZE:
        return False
    code, length = records.RECORD_HEAD.unpack(head)
    return bool((code in _DATA_CODES or code >= records.PRIVATE) and at + HEAD_SIZE + length <= size)


def next_record(peek: Peek, at: int, size: int, channels: AbstractSet[int]) -> int | None:
    """Find the next chunk, or the next message of a known channel.

    Args:
        peek: Returns bytes.
        at: Where the search starts.
        size: Number of all bytes.
        channels: Ids of known channels; if it is empty, only chunks are found.

    Returns:
        Where it starts: the lengths in its header agree, and another record can start after it. None if not found.
    """
    length = _FIRST
    while at < size - HEAD_SIZE:
        block = peek(at, min(size, at + length))
        for candidate in _candidates(block).tolist():
            if _is_record(peek, at + candidate, size, channels):
                return int(at + candidate)
        if at + len(block) >= size or len(block) <= _OVERLAP:
            return None
        at += len(block) - _OVERLAP
        length = min(4 * length, _BLOCK)
    return None


def walk_over_gaps(data: bytes | memoryview, channels: AbstractSet[int]) -> tuple[FoundRecords, list[tuple[int, int]]]:
    """Walk over the records of a chunk, and go on after damage.

    Args:
        data: The chunk's records.
        channels: Ids of known channels; those of messages found before the damage are added.

    Returns:
        The records, and the bytes [start, stop) that hold none.
    """
    size = len(data)
    found = records.walk(data, size)
    gaps: list[tuple[int, int]] = []
    while found.stop < size:
        known = found.messages.keys() | channels
        again = next_record(lambda start, stop: bytes(data[start:stop]), found.stop + 1, size, known)
        gaps.append((found.stop, size if again is None else again))
        if again is None:
            break
        more = records.walk(data, size, again)
        for channel, offsets in more.messages.items():
            found.messages.setdefault(channel, array("q")).extend(offsets)
        found.definitions.extend(more.definitions)
        found = FoundRecords(found.messages, found.definitions, more.stop)
    return found, gaps


def _candidates(block: bytes) -> IntArray:
    """Offsets at which a chunk or message record of less than 4 GB can start."""
    data = np.frombuffer(block, dtype=np.uint8)
    n = len(data) - HEAD_SIZE + 1
    fits = ((data[:n] == records.MESSAGE) | (data[:n] == records.CHUNK)) & (data[8 : n + 8] == 0)
    for high in (5, 6, 7):
        fits &= data[high : n + high] == 0
    return np.flatnonzero(fits)


def _is_record(peek: Peek, at: int, size: int, channels: AbstractSet[int]) -> bool:
    """Whether the bytes at a candidate are a chunk or message record."""
    code, length = records.RECORD_HEAD.unpack(peek(at, at + HEAD_SIZE))
    stop = at + HEAD_SIZE + length
    if code == records.MESSAGE:
        channel = int.from_bytes(peek(at + HEAD_SIZE, at + HEAD_SIZE + 2), "little")
        complete = length >= records.MESSAGE_HEAD_SIZE - HEAD_SIZE and channel in channels
        return complete and stop <= size and starts_record(peek, stop, size)
    try:
        head = records.parse_chunk_head(peek(at + HEAD_SIZE, at + HEAD_SIZE + _CHUNK_HEAD + 8))
    except records.MALFORMED:
        return False
    agrees = head.compression in COMPRESSIONS and head.data_start + head.data_size == length
    # a chunk may be cut by the end of the file
    return agrees and head.size <= MAX_CHUNK_BYTES and (stop > size or starts_record(peek, stop, size))
