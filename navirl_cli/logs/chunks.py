"""The compressed bytes of chunks."""

import zlib
from typing import Final

import zstandard

from navirl_cli.logs import records
from navirl_cli.logs.records import HEAD_SIZE, ChunkHead, ChunkIndex, IntArray

#: A chunk that claims more is damaged: recorders write about 1 MB, and a wrong number must not fill the memory.
MAX_CHUNK_BYTES: Final = 1 << 32


Buffer = bytes | memoryview


class ChunkError(Exception):
    """A chunk cannot be used; the message says why."""


class Decompressor:
    """Decompresses chunk after chunk with one zstd context, which is much faster than one a chunk."""

    def __init__(self) -> None:
        self._zstd = zstandard.ZstdDecompressor()

    def whole(self, head: ChunkHead, data: Buffer) -> bytes:
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

    def start(self, head: ChunkHead, data: Buffer) -> bytes:
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
            return bytes(data)
        try:
            if head.compression == "zstd":
                return self._zstd.decompressobj().decompress(data)
            import lz4.frame

            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data))
        except (zstandard.ZstdError, RuntimeError, EOFError):
            return b""

    def _decompress(self, head: ChunkHead, data: Buffer) -> bytes:
        if head.compression == "zstd":
            return self._zstd.decompress(data, max_output_size=head.size) if head.size else b""
        if head.compression == "lz4":
            import lz4.frame

            return bytes(lz4.frame.decompress(data))
        return bytes(data)


def _check(head: ChunkHead) -> None:
    if head.compression not in {"", "zstd", "lz4"}:
        raise ChunkError(f"the chunk's compression is {head.compression!r}, expected zstd, lz4 or none")
    if head.size > MAX_CHUNK_BYTES:
        raise ChunkError(f"the chunk claims {head.size} bytes uncompressed, expected at most {MAX_CHUNK_BYTES}")


def chunk_of(block: bytes, index: ChunkIndex) -> tuple[ChunkHead, memoryview]:
    """Head and compressed bytes of an indexed chunk.

    Args:
        block: The file's bytes from the chunk's start on.
        index: The chunk's index.

    Raises:
        ChunkError: No such chunk stands there.
    """
    try:
        code, length = records.RECORD_HEAD.unpack_from(block)
        content = memoryview(block)[HEAD_SIZE : index.length]
        if code != records.CHUNK or length + HEAD_SIZE != index.length:
            raise ChunkError(f"the summary names a chunk of {index.length} bytes, found record code {code:#04x}")
        head = records.parse_chunk_head(content)
    except records.MALFORMED as error:
        raise ChunkError(f"the chunk's head does not parse ({error})") from error
    return head, content[head.data_start : head.data_start + head.data_size]


def offsets_of(block: bytes, at: int, number: int) -> IntArray | None:
    """Offsets of a channel's messages in its chunk.

    Args:
        block: The file's bytes from the chunk's start on.
        at: Where the message index starts in the block.
        number: The channel's id.

    Returns:
        Offsets in the uncompressed chunk, shape (n,), ascending; None where no such message index stands.
    """
    try:
        code, length = records.RECORD_HEAD.unpack_from(block, at)
        content = block[at + HEAD_SIZE : at + HEAD_SIZE + length]
        if at < 0 or code != records.MESSAGE_INDEX or int.from_bytes(content[:2], "little") != number:
            return None
        return records.parse_message_index(content)
    except records.MALFORMED:
        return None
