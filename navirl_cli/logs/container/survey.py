"""The walk over a file's records, without opening its chunks: where messages stand, and what is damaged.

Where the summary names a chunk it is taken from there; else the heads of the chunk and of the message indexes behind it
are read. Behind damage the walk goes on at the next chunk that the summary names, else at the next bytes that can only
be a chunk or a message.
"""

import struct
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Definitions
from navirl_cli.logs.container.chunks import COMPRESSIONS, MAX_CHUNK_BYTES, Piece
from navirl_cli.logs.container.damage import DamageList
from navirl_cli.logs.container.raw import BLOCK, RawFile
from navirl_cli.logs.container.records import HEAD_SIZE, ChunkHead, ChunkIndex, Footer
from navirl_cli.logs.container.resync import next_record, starts_record
from navirl_cli.logs.container.summary import ends_data

_RUN: Final = frozenset({records.SCHEMA, records.CHANNEL, records.MESSAGE})
#: Bytes read at first behind damage.
_BEHIND: Final = 1 << 12
#: Bytes of a chunk record's contents before its compressed bytes, at most.
_CHUNK_HEAD: Final = 64
#: Records that are hopped over, if what follows them is a record.
_SKIPPED: Final = frozenset({records.MESSAGE_INDEX, records.ATTACHMENT, records.METADATA})
_LOG_TIME: Final = struct.Struct("<Q")


class _BrokenError(Exception):
    """No usable record starts at a byte; the message says why."""


class Survey:
    """One walk over a file.

    Args:
        raw: Its bytes.
        data_start: First byte behind the header.
        chunks: Those that an intact summary names, by their first byte.
        footer: None where the file does not end as it should.
        definitions: The channels known so far; whoever opens the pieces adds what is defined in them.
        damage: Where damage is added.
        summary_lost: Whether there is a summary that cannot be used.
    """

    def __init__(
        self,
        raw: RawFile,
        data_start: int,
        chunks: Mapping[int, ChunkIndex],
        footer: Footer | None,
        definitions: Definitions,
        damage: DamageList,
        *,
        summary_lost: bool,
    ) -> None:
        #: Metadata records met so far, in the file's order.
        self.metadata: list[tuple[str, dict[str, str]]] = []
        #: CRC of all bytes before the end of the data, and where that is; None where the file has none.
        self._data_crc: tuple[int, int] | None = None
        self._summary_lost = summary_lost
        self._raw = raw
        self._data_start = data_start
        self._chunks = chunks
        self._starts = sorted(chunks)
        self._footer = footer
        self._definitions = definitions
        self._damage = damage
        #: Bytes to read at once where messages stand outside of chunks: few behind damage, where there may be more.
        self._block = BLOCK
        #: Whether chunks are compressed: what looks like a message outside of them is none.
        self._compressed = any(chunk.compression for chunk in chunks.values())

    def pieces(self) -> Iterator[Piece | None]:
        """Walk over the file.

        Yields:
            The pieces that hold messages, in the file's order; None behind damage where the definitions in all pieces
            before must be known, because a message record is recognised by its channel.
        """
        at: int | None = self._data_start
        count = 0
        while at is not None and at < self._raw.size:
            piece, following, broken = None, None, ""
            try:
                piece, following = self._next(at)
            except _BrokenError as error:
                broken = str(error)
            if broken:
                if not self._compressed:
                    yield None
                following = self._resume(at, broken)
            if piece is not None:
                self._damage.met(piece.span_ns)
                yield replace(piece, number=count)
                count += 1
            at = following
        if at is not None:
            size = self._raw.size
            self._damage.add(size, size, "the file ends without its closing records; all that it holds was read")

    def check_data(self) -> None:
        """Check the CRC of the data section where one was met."""
        expected, stop = self._data_crc or (0, 0)
        if expected and (crc := self._raw.crc(stop)) != expected:
            self._damage.add(
                0,
                stop,
                f"the CRC of the data section is {crc:#010x}, expected {expected:#010x}: bytes have changed, and a "
                "message that reads well may be wrong",
            )

    def _next_named(self, at: int) -> int | None:
        """Where the next chunk starts that the summary names."""
        number = bisect_right(self._starts, at)
        return self._starts[number] if number < len(self._starts) else None

    def _next(self, at: int) -> tuple[Piece | None, int | None]:
        """The piece that starts at a byte, if one does, and where the walk goes on: None at the end of the data."""
        index = self._chunks.get(at)
        return self._record(at) if index is None or self._headless(index) else (self._named(index), index.stop)

    def _named(self, index: ChunkIndex) -> Piece:
        """A chunk of the summary."""
        span = (index.start_ns, index.end_ns) if index.end_ns else None
        return Piece(0, index.start, index.stop, index.length, index.message_indexes, span)

    def _headless(self, index: ChunkIndex) -> bool:
        """Whether a chunk has lost its head, and is not compressed: its messages can be found without it."""
        if index.compression:
            return False
        try:
            head = self._chunk_head(index.start, self._raw.size)
        except records.MALFORMED:
            return True
        return bool(head.compression) or head.data_start + head.data_size != index.length - HEAD_SIZE

    def _chunk_head(self, at: int, limit: int) -> ChunkHead:
        return records.parse_chunk_head(self._raw.peek(at + HEAD_SIZE, min(limit, at + HEAD_SIZE + _CHUNK_HEAD)))

    def _record(self, at: int) -> tuple[Piece | None, int | None]:
        """The record that starts there: its piece, if it is one, and where the walk goes on."""
        head = self._raw.peek(at, at + HEAD_SIZE)
        if len(head) < HEAD_SIZE:
            raise _BrokenError("the file ends inside a record")
        code, length = records.RECORD_HEAD.unpack_from(head)
        stop, limit = at + HEAD_SIZE + length, self._next_named(at) or self._raw.size
        if ends_data(self._raw, self._footer, at):
            self._close(at, code)
            return None, None
        if code == records.CHUNK:
            return self._chunk(at, length, limit)
        self._check(code, stop, limit)
        if code in _RUN:
            return self._run(at, stop, limit if code == records.MESSAGE else stop)
        if code == records.METADATA:
            self._take_metadata(at, stop)
        return None, stop

    def _run(self, at: int, stop: int, limit: int) -> tuple[Piece | None, int | None]:
        """Messages, schemas and channels that stand outside of chunks."""
        data = self._raw.read(at, min(limit, max(stop, at + self._block)))
        self._block = min(4 * self._block, BLOCK)
        found = records.walk(data, len(data))
        if found.stop == 0:
            raise _BrokenError("a message record is shorter than its head")
        offsets = [offset for offsets in found.messages.values() for offset in (offsets[0], offsets[-1])]
        times = [_LOG_TIME.unpack_from(data, offset + 15)[0] for offset in offsets]
        span = (min(times), max(times)) if times else None
        return Piece(0, at, at + found.stop, span_ns=span, loose=(data, found)), at + found.stop

    def _chunk(self, at: int, length: int, limit: int) -> tuple[Piece | None, int | None]:
        """A chunk that no summary names, with the message indexes behind it."""
        try:
            head = self._chunk_head(at, limit)
        except records.MALFORMED:
            cut = limit == self._raw.size < at + HEAD_SIZE + _CHUNK_HEAD
            raise _BrokenError(
                "the file ends inside a chunk's head" if cut else "the chunk's head does not parse"
            ) from None
        size = self._chunk_size(at, length, head, limit)
        if size is None:
            raise _BrokenError(f"a chunk record of {length} bytes claims {head.data_size} bytes of contents")
        self._compressed |= bool(head.compression)
        span = (head.start_ns, head.end_ns) if head.end_ns else None
        stop = at + HEAD_SIZE + size
        there = limit - at - HEAD_SIZE
        if stop > limit:
            self._damage.add(
                at,
                limit,
                f"the file ends inside a chunk ({there} of {size} bytes are there); the messages before the "
                "cut were read, those behind it are lost",
                span,
            )
            return Piece(0, at, limit, limit - at, span_ns=span, cut=True), None if limit == self._raw.size else limit
        indexes, end = self._indexes(stop, limit)
        return Piece(0, at, end, stop - at, indexes, span), end

    def _indexes(self, at: int, limit: int) -> tuple[dict[int, int], int]:
        """The message indexes that start there, by channel, and the first byte behind them."""
        found: dict[int, int] = {}
        while starts_record(self._raw.peek, at, limit):
            head = self._raw.peek(at, min(limit, at + HEAD_SIZE + 2))
            if len(head) < HEAD_SIZE + 2 or head[0] != records.MESSAGE_INDEX:
                return found, at
            found[int.from_bytes(head[HEAD_SIZE:], "little")] = at
            at += HEAD_SIZE + int(records.RECORD_HEAD.unpack_from(head)[1])
        # what is cut or garbled may have been the index of any channel
        return {}, at

    def _chunk_size(self, at: int, length: int, head: ChunkHead, limit: int) -> int | None:
        """Bytes of a chunk's contents, by its record's length or, where that is wrong, by its own head."""
        own = head.data_start + head.data_size
        if length == own:
            return length  # if anything else is wrong, it is told when the chunk is opened
        if head.compression not in COMPRESSIONS or max(own, head.size) > MAX_CHUNK_BYTES:
            return None
        return own if starts_record(self._raw.peek, at + HEAD_SIZE + own, limit) else None

    def _take_metadata(self, at: int, stop: int) -> None:
        try:
            self.metadata.append(records.parse_metadata(self._raw.read(at + HEAD_SIZE, stop)))
        except records.MALFORMED as error:
            self._damage.add(at, stop, f"a metadata record does not parse: {error}")

    def _check(self, code: int, stop: int, limit: int) -> None:
        """Refuse a record that ends at `stop` and can neither be used nor hopped over."""
        if code == 0:
            raise _BrokenError("zero bytes where a record should start (the power or the disk failed)")
        known = code in _RUN or code in _SKIPPED or code >= records.PRIVATE
        if not known or stop > limit + self._raw.size:  # no cut loses more than half of a file within one record
            raise _BrokenError(f"no record starts here (code {code:#04x})")
        if stop > limit:
            raise _BrokenError(f"the file ends inside a record (code {code:#04x}), {stop - limit} bytes before its end")
        if code not in _RUN and stop != limit and not starts_record(self._raw.peek, stop, self._raw.size):
            raise _BrokenError(f"no record follows the one that starts here (code {code:#04x})")

    def _close(self, at: int, code: int) -> None:
        """Check the record that ends the data: what follows is the summary section."""
        if self._next_named(at) is not None:
            raise _BrokenError("a closing record stands before the last chunk")
        end = self._footer
        if code == records.FOOTER:
            self._damage.add(at, at, "the record that ends the data is missing; messages may have stood before it")
        elif end is None:
            self._damage.add(at, self._raw.size, "the file ends inside its closing records; no message is lost")
        elif self._summary_lost:
            self._damage.add(at, self._raw.size, "the summary section is damaged and was not used; no message is lost")
        content = self._raw.peek(at + HEAD_SIZE, at + HEAD_SIZE + 4)
        if code == records.DATA_END and len(content) == 4 and (crc := records.parse_data_end(content)):
            self._data_crc = (crc, at)

    def _resume(self, at: int, reason: str) -> int | None:
        """Add damage up to where records start again, or up to the end of the file; return where that is, if it is."""
        named = self._next_named(at)
        end = self._footer.summary_start if self._footer and self._footer.summary_start > at else self._raw.size
        channels = frozenset() if self._compressed else self._definitions.channels.keys()
        following = next_record(self._raw.peek, at + 1, named or end, channels) or named
        stop = self._raw.size if following is None else following
        rest = "what stands behind it is lost" if following is None else f"{stop - at} bytes are lost"
        self._block = _BEHIND
        self._damage.add_gap(at, stop, f"{reason}; {rest}")
        return following
