"""Pieces of a file that hold messages: chunks with their message indexes, and records outside of chunks."""

import threading
import zlib
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import zstandard

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Buffer
from navirl_cli.logs.container.records import HEAD_SIZE, ChunkHead, FoundRecords

#: A chunk that claims more is damaged: recorders write about 1 MB. A wrong number must not fill the memory.
MAX_CHUNK_BYTES: Final = 1 << 28
#: Bytes that are decompressed at once where it is not known how many there are.
_AT_ONCE: Final = 1 << 20
COMPRESSIONS: Final = frozenset({"", "zstd", "lz4"})


class ChunkError(Exception):
    """A chunk cannot be used; the message gives the reason."""


@dataclass(frozen=True)
class Piece:
    """A part of a file that holds messages: a chunk, or a run of records outside of chunks."""

    #: Index among all pieces of the file.
    number: int
    #: First byte, and first byte after it; message indexes are included.
    start: int
    stop: int
    #: Bytes of the chunk record that are in the file; 0 outside of chunks.
    length: int = 0
    #: First byte of each message index, by channel.
    indexes: Mapping[int, int] = field(default_factory=dict)
    #: First and last time of receipt in ns, as the chunk's fields state; None where they state none.
    span_ns: tuple[int, int] | None = None
    #: Whether the file ends inside of the chunk.
    cut: bool = False
    #: Why the chunk is not opened; empty if it may be.
    refusal: str = ""
    #: Outside of chunks: the bytes, and the records in them.
    unchunked: tuple[bytes, FoundRecords] | None = None


@dataclass(frozen=True, eq=False)
class OpenedPiece:
    """The records of a piece, decompressed."""

    raw: Buffer = b""
    #: By channel: offsets of the messages in `raw` and their log times in ns, by the chunk's message indexes.
    indexes: dict[int, tuple[IntArray, IntArray]] = field(default_factory=dict)
    #: Why the chunk cannot be used; empty if it can.
    error: str = ""


class Decompressor:
    """Decompresses chunks with one zstd context per thread, which is much faster than one per chunk."""

    def __init__(self) -> None:
        self._local = threading.local()

    @property
    def _zstd(self) -> zstandard.ZstdDecompressor:
        if not hasattr(self._local, "zstd"):
            self._local.zstd = zstandard.ZstdDecompressor()
        context: zstandard.ZstdDecompressor = self._local.zstd
        return context

    def complete(self, head: ChunkHead, data: Buffer) -> Buffer:
        """Decompress a complete chunk, and check size and CRC.

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

    def cut(self, head: ChunkHead, data: Buffer) -> Buffer:
        """Decompress what is left of a chunk that is cut off.

        Args:
            head: The chunk's head.
            data: The compressed bytes before the cut.

        Returns:
            The first bytes of the chunk's records; may be empty.

        Raises:
            ChunkError: The compression is not supported.
        """
        _check(head)
        if head.compression == "":
            return data
        try:
            if head.compression == "zstd":
                return _first_bytes(self._zstd, data, head.size)
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=head.size))
        except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
            return b""

    def _decompress(self, head: ChunkHead, data: Buffer) -> Buffer:
        if head.compression == "zstd":
            # memory of a wrong size must not be allocated
            claimed = zstandard.frame_content_size(data) if head.size else 0
            if claimed not in {head.size, -1}:
                raise ChunkError(f"the chunk has {claimed} bytes uncompressed, expected {head.size}")
            return self._zstd.decompress(data, max_output_size=head.size) if head.size else b""
        if head.compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=head.size + 1))
        return data


def _first_bytes(zstd: zstandard.ZstdDecompressor, data: Buffer, most: int) -> bytes:
    """What a cut zstd frame decompresses to, `most` bytes at most."""
    blocks, left = [], most
    with suppress(zstandard.ZstdError), zstd.stream_reader(data) as stream:
        while left and (block := stream.read(min(left, _AT_ONCE))):
            blocks.append(block)
            left -= len(block)
    return b"".join(blocks)


def _check(head: ChunkHead) -> None:
    if head.compression not in COMPRESSIONS:
        raise ChunkError(f"the chunk's compression is {head.compression!r}, expected zstd, lz4 or none")
    if head.size > MAX_CHUNK_BYTES:
        raise ChunkError(f"the chunk claims {head.size} bytes uncompressed, expected at most {MAX_CHUNK_BYTES}")


def open_chunk(
    block: bytes, piece: Piece, decompressor: Decompressor, channels: Collection[int] | None = None
) -> OpenedPiece:
    """Decompress a chunk and read its message indexes.

    Args:
        block: The file's bytes of the piece.
        piece: A chunk.
        decompressor: Decompresses the chunk.
        channels: Channels whose message indexes are wanted; None for all.
    """
    indexes = indexes_of(block, piece, channels=channels)
    if piece.refusal:
        return OpenedPiece(indexes=indexes, error=piece.refusal)
    content = memoryview(block)[HEAD_SIZE : piece.length]
    try:
        head = records.parse_chunk_head(content)
    except records.MALFORMED as error:
        return OpenedPiece(indexes=indexes, error=f"the chunk's header does not parse ({error})")
    unpack: Callable[[ChunkHead, Buffer], Buffer] = decompressor.cut if piece.cut else decompressor.complete
    if head.data_start + head.data_size != len(content) and not piece.cut:
        reason = f"the chunk's header claims {head.data_size} bytes, expected {len(content) - head.data_start}"
        return OpenedPiece(indexes=indexes, error=reason)
    try:
        raw = unpack(head, content[head.data_start : head.data_start + head.data_size])
    except ChunkError as error:
        return OpenedPiece(indexes=indexes, error=str(error))
    return OpenedPiece(raw, indexes)


def indexes_of(
    block: bytes, piece: Piece, base: int | None = None, channels: Collection[int] | None = None
) -> dict[int, tuple[IntArray, IntArray]]:
    """Offsets and log times of a chunk's messages by channel, by its message indexes.

    Args:
        block: Bytes of the file.
        piece: The chunk.
        base: Byte of the file at which `block` starts; None for the chunk's start.
        channels: Wanted channels; None for all.

    Returns:
        Offsets and times of the message indexes that are at their place and parse.
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
