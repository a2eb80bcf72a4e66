"""The walk over a file's records that does not open chunks: where messages stand, and what is damaged.

A chunk that the summary names is taken from there; of other chunks and the message indexes after them the first fields
are read. After damage the walk goes on at the next chunk that the summary names. Without one, it goes on at the next
bytes that can only be a chunk or a message.
"""

import struct
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from navirl_cli.limits import REMEDY, Allowance, in_mb
from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Definitions
from navirl_cli.logs.container.chunks import COMPRESSIONS, MAX_CHUNK_BYTES, Piece
from navirl_cli.logs.container.damage import DamageList
from navirl_cli.logs.container.raw import BLOCK, RawFile
from navirl_cli.logs.container.records import HEAD_SIZE, ChunkHead, ChunkIndex, Footer
from navirl_cli.logs.container.resync import next_record, starts_record
from navirl_cli.logs.container.summary import ends_data

#: Records that may stand outside of chunks as well as in them.
_UNCHUNKED: Final = frozenset({records.SCHEMA, records.CHANNEL, records.MESSAGE})
#: Bytes read at first after damage.
_AFTER_DAMAGE: Final = 1 << 12
#: Bytes of a chunk record's contents before its compressed bytes, at most.
_CHUNK_HEAD: Final = 64
#: Records that are skipped, if another record follows them.
_SKIPPED: Final = frozenset({records.MESSAGE_INDEX, records.ATTACHMENT, records.METADATA})
_LOG_TIME: Final = struct.Struct("<Q")
#: Channel and bytes of entries of a message index, and bytes of an entry.
_INDEX_HEAD: Final = struct.Struct("<HI")
_INDEX_ENTRY_BYTES: Final = 16


class _BrokenError(Exception):
    """No usable record starts at a byte; the message gives the reason."""


class Survey:
    """One walk over a file.

    Args:
        raw: Its bytes.
        data_start: First byte after the header.
        chunks: The chunks that an intact summary names, by their first byte.
        footer: None where the file does not end as it should.
        definitions: The channels known so far; whoever opens the pieces adds those that they define.
        damage: Where damage is added.
        summary_lost: Whether the file has a summary that cannot be used.
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
        #: CRC of all bytes before the end of the data, and where that is; None if the file has no CRC.
        self._data_crc: tuple[int, int] | None = None
        self._summary_lost = summary_lost
        self._raw = raw
        self._data_start = data_start
        self._chunks = chunks
        self._starts = sorted(chunks)
        self._footer = footer
        self._definitions = definitions
        self._damage = damage
        #: Bytes to read at once outside of chunks: few after damage, because more damage may follow.
        self._block = BLOCK
        #: Whether chunks are compressed. If so, bytes outside of chunks that look like a message are not one.
        self._allowance = Allowance()
        self._compressed = any(chunk.compression for chunk in chunks.values())

    def pieces(self) -> Iterator[Piece | None]:
        """Walk over the file.

        Yields:
            The pieces that hold messages, in the file's order. After damage it yields None where the definitions of all
            pieces before must be known, because a message record is recognised by its channel.
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
            self._damage.add(size, size, "the file ends without its closing records; everything in it was read")

    def checked(self, piece: Piece) -> Piece:
        """A piece that is going to be opened, with the reason why it is not, if there is one."""
        return replace(piece, refusal=self._refusal(piece))

    def planned(self) -> list[Piece]:
        """The chunks that the summary names, in the file's order."""
        return [self._indexed(self._chunks[start]) for start in self._starts]

    def check_data(self) -> None:
        """Check the CRC of the data section, if the walk found one; of a remote file most bytes were never read."""
        expected, stop = self._data_crc or (0, 0)
        if expected and self._raw.nearby and (crc := self._raw.crc(stop)) != expected:
            self._damage.add(
                0,
                stop,
                f"the CRC of the data section is {crc:#010x}, expected {expected:#010x}: some bytes have "
                "changed, so values that look valid may be wrong",
            )

    def _refusal(self, piece: Piece) -> str:
        """Why a chunk is not opened: what it claims is more than the file may unpack to; "" if it may be."""
        if piece.unchunked is not None:
            return ""
        try:
            head = self._chunk_head(piece.start, self._raw.size)
        except records.MALFORMED:
            return ""  # which opening it reports
        packed = piece.length
        most = self._allowance.most(packed)
        if head.compression == "" or head.size > MAX_CHUNK_BYTES or self._allowance.take(packed, head.size):
            return ""
        return (
            f"the chunk claims {in_mb(head.size)} uncompressed, expected at most {in_mb(most)} of {packed} bytes; "
            f"{REMEDY}"
        )

    def _next_indexed(self, at: int) -> int | None:
        """Where the next chunk that the summary names starts."""
        number = bisect_right(self._starts, at)
        return self._starts[number] if number < len(self._starts) else None

    def _next(self, at: int) -> tuple[Piece | None, int | None]:
        """The piece that starts at a byte, if any, and where the walk goes on: None at the end of the data."""
        index = self._chunks.get(at)
        return self._record(at) if index is None or self._lacks_head(index) else (self._indexed(index), index.stop)

    def _indexed(self, index: ChunkIndex) -> Piece:
        """A chunk of the summary."""
        span = (index.start_ns, index.end_ns) if index.end_ns else None
        return Piece(0, index.start, index.stop, index.length, index.message_indexes, span)

    def _lacks_head(self, index: ChunkIndex) -> bool:
        """Whether a chunk is not compressed and its header is damaged: its messages are found without the header."""
        if index.compression or not self._raw.nearby:
            return False
        try:
            head = self._chunk_head(index.start, self._raw.size)
        except records.MALFORMED:
            return True
        return bool(head.compression) or head.data_start + head.data_size != index.length - HEAD_SIZE

    def _chunk_head(self, at: int, limit: int) -> ChunkHead:
        return records.parse_chunk_head(self._raw.peek(at + HEAD_SIZE, min(limit, at + HEAD_SIZE + _CHUNK_HEAD)))

    def _record(self, at: int) -> tuple[Piece | None, int | None]:
        """Read the record that starts at a byte; return as `_next` does."""
        head = self._raw.peek(at, at + HEAD_SIZE)
        if len(head) < HEAD_SIZE:
            raise _BrokenError("the file ends inside a record")
        code, length = records.RECORD_HEAD.unpack_from(head)
        stop, limit = at + HEAD_SIZE + length, self._next_indexed(at) or self._raw.size
        if ends_data(self._raw, self._footer, at):
            self._close(at, code)
            return None, None
        if code == records.CHUNK:
            return self._chunk(at, length, limit)
        self._check(code, stop, limit)
        if self._holds_chunk(at, length, limit):
            self._damage.add(
                at, at + 1, f"a chunk starts with code {code:#04x} in place of {records.CHUNK:#04x}; it was read"
            )
            return self._chunk(at, length, limit)
        if code == records.MESSAGE_INDEX and not self._is_index(at, length):
            raise _BrokenError("the size of a message index is wrong")
        if code in _UNCHUNKED:
            return self._unchunked(at, stop, limit if code == records.MESSAGE else stop)
        if code == records.METADATA:
            self._take_metadata(at, stop)
        return None, stop

    def _unchunked(self, at: int, stop: int, limit: int) -> tuple[Piece | None, int | None]:
        """Messages, schemas and channels that stand outside of chunks."""
        data = self._raw.read(at, min(limit, max(stop, at + self._block)))
        self._block = min(4 * self._block, BLOCK)
        found = records.walk(data, len(data))
        if found.stop == 0:
            raise _BrokenError("a message record is shorter than its header")
        offsets = [offset for offsets in found.messages.values() for offset in (offsets[0], offsets[-1])]
        times = [_LOG_TIME.unpack_from(data, offset + 15)[0] for offset in offsets]
        span = (min(times), max(times)) if times else None
        return Piece(0, at, at + found.stop, span_ns=span, unchunked=(data, found)), at + found.stop

    def _chunk(self, at: int, length: int, limit: int) -> tuple[Piece | None, int | None]:
        """A chunk that no summary names, with the message indexes after it."""
        try:
            head = self._chunk_head(at, limit)
        except records.MALFORMED:
            cut = limit == self._raw.size < at + HEAD_SIZE + _CHUNK_HEAD
            raise _BrokenError(
                "the file ends inside a chunk's header" if cut else "the chunk's header does not parse"
            ) from None
        size = self._chunk_size(at, length, head, limit)
        if size is None:
            raise _BrokenError(f"a chunk record of {length} bytes claims {head.data_size} bytes of data")
        if size != length:
            self._damage.add(
                at,
                at + HEAD_SIZE,
                f"a chunk record gives its length as {length} bytes, expected {size} by its header; it was read by its "
                "header",
                (head.start_ns, head.end_ns) if head.end_ns else None,
            )
        self._compressed |= bool(head.compression)
        span = (head.start_ns, head.end_ns) if head.end_ns else None
        stop = at + HEAD_SIZE + size
        there = limit - at - HEAD_SIZE
        if stop > limit:
            self._damage.add(
                at,
                limit,
                f"the file ends inside a chunk ({there} of {size} bytes are there); the messages before the "
                "cut were read, those after it are lost",
                span,
            )
            return Piece(0, at, limit, limit - at, span_ns=span, cut=True), None if limit == self._raw.size else limit
        indexes, end = self._indexes(stop, limit)
        return Piece(0, at, end, stop - at, indexes, span), end

    def _indexes(self, at: int, limit: int) -> tuple[dict[int, int], int]:
        """The message indexes that start at a byte, by channel, and the first byte after them."""
        found: dict[int, int] = {}
        while starts_record(self._raw.peek, at, limit):
            head = self._raw.peek(at, min(limit, at + HEAD_SIZE + 2))
            if len(head) < HEAD_SIZE + 2 or head[0] != records.MESSAGE_INDEX:
                return found, at
            if not self._is_index(at, int(records.RECORD_HEAD.unpack_from(head)[1])):
                break
            found[int.from_bytes(head[HEAD_SIZE:], "little")] = at
            at += HEAD_SIZE + int(records.RECORD_HEAD.unpack_from(head)[1])
        # the index that is cut or damaged may be that of any channel
        return {}, at

    def _chunk_size(self, at: int, length: int, head: ChunkHead, limit: int) -> int | None:
        """Bytes of a chunk's contents, by its record's length or, where that is wrong, by its own header."""
        own = head.data_start + head.data_size
        if length == own:
            return length  # other faults are reported when the chunk is opened
        if head.compression not in COMPRESSIONS or max(own, head.size) > MAX_CHUNK_BYTES:
            return None
        return own if starts_record(self._raw.peek, at + HEAD_SIZE + own, limit) else None

    def _take_metadata(self, at: int, stop: int) -> None:
        try:
            self.metadata.append(records.parse_metadata(self._raw.read(at + HEAD_SIZE, stop)))
        except records.MALFORMED as error:
            self._damage.add(at, stop, f"a metadata record does not parse: {error}")

    def _holds_chunk(self, at: int, length: int, limit: int) -> bool:
        """Whether a record that would be skipped has the contents of a chunk: a flipped bit of its code hides it."""
        if self._raw.peek(at, at + 1)[0] in _UNCHUNKED:
            return False
        try:
            head = self._chunk_head(at, limit)
        except records.MALFORMED:
            return False
        return head.compression in COMPRESSIONS and length == head.data_start + head.data_size

    def _is_index(self, at: int, length: int) -> bool:
        """Whether the contents of a message index are as long as it says."""
        head = self._raw.peek(at + HEAD_SIZE, at + HEAD_SIZE + _INDEX_HEAD.size)
        if len(head) < _INDEX_HEAD.size:
            return False
        size = int(_INDEX_HEAD.unpack(head)[1])
        return size % _INDEX_ENTRY_BYTES == 0 and length == _INDEX_HEAD.size + size

    def _check(self, code: int, stop: int, limit: int) -> None:
        """Refuse a record that ends at `stop` and can neither be used nor skipped."""
        if code == 0:
            raise _BrokenError("zero bytes where a record should start (power or disk failure)")
        known = code in _UNCHUNKED or code in _SKIPPED or code >= records.PRIVATE
        # a record that would end so far beyond the file is not one that was cut off
        if not known or stop > limit + self._raw.size:
            raise _BrokenError(f"no record starts here (code {code:#04x})")
        if stop > limit:
            raise _BrokenError(f"the file ends inside a record (code {code:#04x}), {stop - limit} bytes before its end")
        if code not in _UNCHUNKED and stop != limit and not starts_record(self._raw.peek, stop, self._raw.size):
            raise _BrokenError(f"no record follows the one that starts here (code {code:#04x})")

    def _close(self, at: int, code: int) -> None:
        """Check the record that ends the data: what follows is the summary section."""
        if self._next_indexed(at) is not None:
            raise _BrokenError("a closing record comes before the last chunk")
        end = self._footer
        if code == records.FOOTER:
            self._damage.add(at, at, "the record that ends the data is missing; messages before it may be missing, too")
        elif end is None:
            self._damage.add(at, self._raw.size, "the file ends inside its closing records; no message is lost")
        elif self._summary_lost:
            self._damage.add(at, self._raw.size, "the summary section is damaged and was not used; no message is lost")
        content = self._raw.peek(at + HEAD_SIZE, at + HEAD_SIZE + 4)
        if code == records.DATA_END and len(content) == 4 and (crc := records.parse_data_end(content)):
            self._data_crc = (crc, at)

    def _resume(self, at: int, reason: str) -> int | None:
        """Add damage up to the next record, or up to the end of the file; return where that record starts."""
        indexed = self._next_indexed(at)
        end = self._footer.summary_start if self._footer and self._footer.summary_start > at else self._raw.size
        channels = frozenset() if self._compressed else self._definitions.channels.keys()
        following = next_record(self._raw.peek, at + 1, indexed or end, channels) or indexed
        stop = self._raw.size if following is None else following
        rest = "everything after it is lost" if following is None else f"{stop - at} bytes are lost"
        self._block = _AFTER_DAMAGE
        self._damage.add_gap(at, stop, f"{reason}; {rest}")
        return following
