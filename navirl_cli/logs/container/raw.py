"""A file of MCAP bytes that is open, read by place."""

import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from navirl_cli.logs.container.damage import Damage

#: Bytes read at once where messages stand outside of chunks.
BLOCK: Final = 4 << 20
#: Bytes read ahead where only the heads of records are looked at.
_AHEAD: Final = 4096


class RawFile:
    """An open file of MCAP bytes, for several threads at once; a context manager that closes it.

    Args:
        path: The file's name, for messages.
        file: The bytes, decompressed if necessary; must have a file descriptor.
        size: Number of bytes.
        damage: What could not be decompressed, in bytes of the compressed file.
    """

    def __init__(self, path: Path, file: BinaryIO, size: int, damage: tuple[Damage, ...] = ()) -> None:
        self.path = path
        self.file = file
        self.size = size
        self.damage = damage
        self._ahead = (0, b"")
        #: Whether a few bytes anywhere cost next to nothing.
        self.nearby = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def plan(self, ranges: Sequence[tuple[int, int]]) -> None:
        """Name ranges [start, stop) that are going to be read; of no use where reading is cheap."""

    def requests(self, ranges: Sequence[tuple[int, int]]) -> int:  # noqa: ARG002
        """Number of requests to a store that ranges [start, stop) in the file's order take: none here."""
        return 0

    def read(self, start: int, stop: int) -> bytes:
        """Bytes [start, stop), fewer where the file ends."""
        blocks, at, stop = [], start, min(stop, self.size)
        while at < stop and (block := os.pread(self.file.fileno(), stop - at, at)):
            blocks.append(block)
            at += len(block)
        return blocks[0] if len(blocks) == 1 else b"".join(blocks)

    def peek(self, start: int, stop: int) -> bytes:
        """A few bytes; those after them are read ahead. For one thread at a time."""
        at, ahead = self._ahead
        if not at <= start <= stop <= at + len(ahead):
            at, ahead = start, self.read(start, max(stop, start + _AHEAD))
            self._ahead = (at, ahead)
        return ahead[start - at : stop - at]

    def crc(self, stop: int) -> int:
        """CRC of the first `stop` bytes."""
        crc = 0
        for at in range(0, stop, BLOCK):
            crc = zlib.crc32(self.read(at, min(stop, at + BLOCK)), crc)
        return crc
