"""Bytes of a file by their place."""

import os
import zlib
from typing import BinaryIO, Final

#: Bytes read at once where messages stand outside of chunks.
BLOCK: Final = 4 << 20
#: Bytes read ahead where only heads are looked at.
_AHEAD: Final = 4096


class RawFile:
    """Bytes of a file by their place, for several threads at once."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._descriptor = file.fileno()
        self.size = size
        self._ahead = (0, b"")

    def read(self, start: int, stop: int) -> bytes:
        """Bytes [start, stop), fewer where the file ends."""
        parts, at, stop = [], start, min(stop, self.size)
        while at < stop and (part := os.pread(self._descriptor, stop - at, at)):
            parts.append(part)
            at += len(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def peek(self, start: int, stop: int) -> bytes:
        """A few bytes, with those behind them read ahead; for one thread."""
        at, ahead = self._ahead
        if not at <= start <= stop <= at + len(ahead):
            at, ahead = start, self.read(start, min(self.size, max(stop, start + _AHEAD)))
            self._ahead = (at, ahead)
        return ahead[start - at : stop - at]


def data_crc(raw: RawFile, stop: int) -> int:
    """CRC of the file's first `stop` bytes."""
    crc = 0
    for at in range(0, stop, BLOCK):
        crc = zlib.crc32(raw.read(at, min(stop, at + BLOCK)), crc)
    return crc
