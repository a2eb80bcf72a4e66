"""Pieces of a file that hold messages, opened: chunks, with their message indexes, and records outside of chunks."""

import threading
import zlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Final

import zstandard

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Buffer
from navirl_cli.logs.container.records import HEAD_SIZE, ChunkHead, Found

#: A chunk that claims more is damaged: recorders write about 1 MB, and a wrong number must not fill the memory.
MAX_CHUNK_BYTES: Final = 1 << 28
COMPRESSIONS: Final = frozenset({"", "zstd", "lz4"})


class ChunkError(Exception):
    """A chunk cannot be used; the message says why."""


@dataclass(frozen=True)
class Piece:
    """Where messages stand in a file."""

    #: Place among all pieces.
    number: int
    #: First byte, and first byte behind it, message indexes included.
    start: int
    stop: int
    #: Bytes of the chunk record that the file holds; 0 for records outside of chunks.
    length: int = 0
    #: Where each channel's message index stands, by channel; empty where there is none.
    indexes: Mapping[int, int] = field(default_factory=dict)
    #: First and last time of receipt in ns, as the chunk claims; None where it does not say.
    span_ns: tuple[int, int] | None = None
    #: Whether the file ends inside of the chunk.
    cut: bool = False
    #: Records outside of chunks, and what stands in them.
    loose: tuple[bytes, Found] | None = None


@dataclass(frozen=True, eq=False)
class Unpacked:
    """A chunk's records."""

    raw: Buffer = b""
    #: By channel: offsets of the messages in `raw` and their log times, as the chunk's message indexes say.
    indexes: dict[int, tuple[IntArray, IntArray]] = field(default_factory=dict)
    #: Why there are no records.
    trouble: str = ""


class Decompressor:
    """Decompresses chunk after chunk with one zstd context a thread, which is much faster than one a chunk."""

    def __init__(self) -> None:
        self._local = threading.local()

    @property
    def _zstd(self) -> zstandard.ZstdDecompressor:
        if not hasattr(self._local, "zstd"):
            self._local.zstd = zstandard.ZstdDecompressor()
        context: zstandard.ZstdDecompressor = self._local.zstd
        return context

    def whole(self, head: ChunkHead, data: Buffer) -> Buffer:
        """Decompress a complete chunk and check its size and CRC.

        Args:
            head: The chunk's head.
            data: The compressed bytes.

        Returns:
            The records in the chunk.

        Raises:
            ChunkError: The bytes do not decompress, or size or CRC are wrong.
        """
        _check(head)
        try:
            raw = self._decompress(head, data)
        except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
            raise ChunkError(f"the chunk does not decompress ({head.compression}: {error})") from error
        if len(raw) != head.size:
            raise ChunkError(f"the chunk has {len(raw)} bytes uncompressed, expected {head.size}")
        if head.crc and (crc := zlib.crc32(raw)) != head.crc:
            raise ChunkError(f"the chunk's CRC is {crc:#010x}, expected {head.crc:#010x}")
        return raw

    def start(self, head: ChunkHead, data: Buffer) -> Buffer:
        """Decompress what a cut chunk still holds.

        Args:
            head: The chunk's head.
            data: The compressed bytes before the cut.

        Returns:
            The first bytes of the chunk's records, possibly none.

        Raises:
            ChunkError: The compression is not supported.
        """
        _check(head)
        if head.compression == "":
            return data
        try:
            if head.compression == "zstd":
                return self._zstd.decompressobj().decompress(data)
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=head.size))
        except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
            return b""

    def _decompress(self, head: ChunkHead, data: Buffer) -> Buffer:
        if head.compression == "zstd":
            # a false size must not be allocated
            claimed = zstandard.frame_content_size(data) if head.size else 0
            if claimed not in {head.size, -1}:
                raise ChunkError(f"the chunk has {claimed} bytes uncompressed, expected {head.size}")
            return self._zstd.decompress(data, max_output_size=head.size) if head.size else b""
        if head.compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=head.size + 1))
        return data


def _check(head: ChunkHead) -> None:
    if head.compression not in COMPRESSIONS:
        raise ChunkError(f"the chunk's compression is {head.compression!r}, expected zstd, lz4 or none")
    if head.size > MAX_CHUNK_BYTES:
        raise ChunkError(f"the chunk claims {head.size} bytes uncompressed, expected at most {MAX_CHUNK_BYTES}")


def open_chunk(
    block: bytes, piece: Piece, decompressor: Decompressor, channels: Collection[int] | None = None
) -> Unpacked:
    """Decompress a chunk and read its message indexes.

    Args:
        block: The file's bytes of the piece.
        piece: A chunk.
        decompressor: Its context is kept for the next chunk.
        channels: Those whose message indexes are wanted; all where None.
    """
    indexes = indexes_of(block, piece, channels=channels)
    content = memoryview(block)[HEAD_SIZE : piece.length]
    try:
        head = records.parse_chunk_head(content)
    except records.MALFORMED as error:
        return Unpacked(indexes=indexes, trouble=f"the chunk's head does not parse ({error})")
    unpack: Callable[[ChunkHead, Buffer], Buffer] = decompressor.start if piece.cut else decompressor.whole
    if head.data_start + head.data_size != len(content) and not piece.cut:
        trouble = f"the chunk's head claims {head.data_size} bytes, expected {len(content) - head.data_start}"
        return Unpacked(indexes=indexes, trouble=trouble)
    try:
        raw = unpack(head, content[head.data_start : head.data_start + head.data_size])
    except ChunkError as error:
        return Unpacked(indexes=indexes, trouble=str(error))
    return Unpacked(raw, indexes)


def indexes_of(
    block: bytes, piece: Piece, base: int | None = None, channels: Collection[int] | None = None
) -> dict[int, tuple[IntArray, IntArray]]:
    """Offsets and log times of a chunk's messages by channel, as its message indexes say.

    Args:
        block: Bytes of the file.
        piece: The chunk.
        base: Byte of the file at which `block` starts; the chunk's start where None.
        channels: Those that are wanted; all where None.

    Returns:
        Of those indexes that stand where they should and parse.
    """
    start = piece.start if base is None else base
    found = {}
    for number, place in piece.indexes.items():
        if channels is not None and number not in channels:
            continue
        at = place - start
        if not 0 <= at < len(block):
            continue
        try:
            code, length = records.RECORD_HEAD.unpack_from(block, at)
            channel, offsets, times = records.parse_message_index(block[at + HEAD_SIZE : at + HEAD_SIZE + length])
        except records.MALFORMED:
            continue
        if code == records.MESSAGE_INDEX and channel == number:
            found[number] = (offsets, times)
    return found
