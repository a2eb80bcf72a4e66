"""A log in an object store, read by the ranges that its index names.

The end is read first, at once: it holds footer and summary. What is going to be read is planned: neighbouring ranges
become one request, and a few requests run ahead of the reader.
"""

import io
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Lock
from typing import Final

from navirl_cli.logs.container.raw import RawFile
from navirl_cli.remote import Remote

#: Bytes of the end, and of any other small range, that are read at once.
_TAIL: Final = 1 << 18
_SMALL: Final = 1 << 14
#: Ranges so close are one request, of at most so many bytes, of which at most this share is between them.
_GAP: Final = 1 << 17
_MOST: Final = 8 << 20
_BETWEEN: Final = 0.2
#: Requests that run at the same time.
_AT_ONCE: Final = 4
#: Bytes that are kept.
_KEPT: Final = 64 << 20

#: Bytes [start, stop) of a file.
Range = tuple[int, int]


class RemoteFile(RawFile):
    """A log in a store.

    Args:
        path: Its address.
    """

    def __init__(self, path: Remote) -> None:
        super().__init__(path, io.BytesIO(), path.fetched.size)
        self.nearby = False
        self._remote = path
        self._lock = Lock()
        #: Blocks that are kept or being fetched, in the order in which they were begun; and those that are planned.
        self._blocks: dict[Range, Future[bytes]] = {}
        self._planned: list[Range] = []
        self._pool = ThreadPoolExecutor(_AT_ONCE)
        self.read(max(0, self.size - _TAIL), self.size)

    def close(self) -> None:
        """End all requests."""
        self._pool.shutdown(cancel_futures=True)

    def plan(self, ranges: Sequence[Range]) -> None:
        """As :meth:`RawFile.plan`."""
        with self._lock:
            there = list(self._blocks)
        self._planned = _joined([one for one in ranges if _holding(there, *one) is None])

    def requests(self, ranges: Sequence[Range]) -> int:
        """As :meth:`RawFile.requests`."""
        with self._lock:
            there = list(self._blocks)
        return len(_joined([one for one in ranges if _holding(there, *one) is None]))

    def read(self, start: int, stop: int) -> bytes:
        """As :meth:`RawFile.read`."""
        stop = min(stop, self.size)
        if stop <= start:
            return b""
        with self._lock:
            block = _holding(self._blocks, start, stop) or self._begun(start, stop)
            future = self._blocks[block]
        return future.result()[start - block[0] : stop - block[0]]

    def _begun(self, start: int, stop: int) -> Range:
        """The block that holds a range; it is begun, and those that are planned after it."""
        number = bisect_right(self._planned, (start, self.size)) - 1
        if number >= 0 and stop <= self._planned[number][1]:
            wanted = self._planned[number : number + _AT_ONCE]
        else:
            wanted = [(start, min(self.size, max(stop, start + _SMALL)))]
        for block in wanted:
            if block not in self._blocks:
                self._blocks[block] = self._pool.submit(self._remote.fetch, *block)
        sizes = sum(stop - start for start, stop in self._blocks)
        for old in list(self._blocks):
            if sizes > _KEPT and old not in wanted and self._blocks[old].done():
                sizes -= old[1] - old[0]
                del self._blocks[old]
        return wanted[0]


def _holding(blocks: Iterable[Range], start: int, stop: int) -> Range | None:
    """The block that holds a range."""
    return next((block for block in blocks if block[0] <= start and stop <= block[1]), None)


def _joined(ranges: Sequence[Range]) -> list[Range]:
    """Ranges in order, neighbours as one."""
    blocks: list[Range] = []
    wanted = 0
    for start, stop in ranges:
        if blocks:
            first, last = blocks[-1]
            size, own = stop - first, wanted + stop - start
            if 0 <= start - last <= _GAP and size <= _MOST and size - own <= _BETWEEN * own:
                blocks[-1], wanted = (first, stop), own
                continue
        blocks.append((start, stop))
        wanted = stop - start
    return blocks


class Stream(io.RawIOBase):
    """The bytes of a log in a store, in order.

    Args:
        raw: The log.
    """

    def __init__(self, raw: RemoteFile) -> None:
        self._raw, self._at = raw, 0
        raw.plan([(at, min(raw.size, at + _MOST)) for at in range(0, raw.size, _MOST)])

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a byte."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._raw.size}[whence]
        return self._at

    def readinto(self, buffer: bytearray) -> int:  # type: ignore[override]
        """Read what a planned block still holds."""
        stop = min(self._raw.size, self._at + len(buffer), (self._at // _MOST + 1) * _MOST)
        data = self._raw.read(self._at, stop)
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)
