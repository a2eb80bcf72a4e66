"""The walk over a file's records, without opening its chunks: where messages stand, and what is damaged.

Where the summary names a chunk it is taken from there; else the heads of the chunk and of the message indexes behind it
are read. Behind damage the walk goes on at the next chunk that the summary names, else at the next bytes that can only
be a chunk or a message.
"""

import struct
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace
from pathlib import Path
from typing import Final

from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Damage
from navirl_cli.logs.container.chunks import COMPRESSIONS, MAX_CHUNK_BYTES, Piece
from navirl_cli.logs.container.raw import BLOCK, RawFile, data_crc
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


class Survey:
    """One walk over a file.

    Args:
        path: The file's name, for notes.
        raw: Its bytes.
        data_start: First byte behind the header.
        chunks: Those that a sound summary names, by their first byte.
        footer: None where the file does not end as it should.
        channels: Gives the ids of the channels known so far.
        summary_lost: Whether there is a summary that is of no use.
    """

    def __init__(
        self,
        path: Path,
        raw: RawFile,
        data_start: int,
        chunks: Mapping[int, ChunkIndex],
        footer: Footer | None,
        channels: Callable[[], AbstractSet[int]],
        *,
        summary_lost: bool,
    ) -> None:
        self.path = path
        #: What could not be read so far.
        self.damage: list[Damage] = []
        #: Metadata records met so far, in the file's order.
        self.metadata: list[tuple[str, dict[str, str]]] = []
        #: CRC of all bytes before the end of the data, and where that is; None where the file has none.
        self._data_crc: tuple[int, int] | None = None
        self._summary_lost = summary_lost
        self._raw = raw
        self._at = data_start
        self._chunks = chunks
        self._starts = sorted(chunks)
        self._footer = footer
        self._channels = channels
        self._count = 0
        #: Bytes to read at once where messages stand outside of chunks: few behind damage, where there may be more.
        self._block = BLOCK
        #: First and latest time of receipt so far, ns.
        self._times: tuple[int, int] | None = None
        #: Damage whose end in time is not known yet.
        self._pending: list[int] = []
        #: Whether chunks are compressed: what looks like a message outside of them is none.
        self._packed = any(chunk.compression for chunk in chunks.values())

    def pieces(self) -> Iterator[Piece]:
        """Yield the pieces of the file that hold messages, in its order."""
        at: int | None = self._at
        while at is not None and at < self._raw.size:
            if at in self._chunks and not self._headless(self._chunks[at]):
                piece: Piece | None = self._named(self._chunks[at])
                at = self._chunks[at].stop
            else:
                piece, at = self._record(at)
            if piece is not None:
                self._passed(piece.span_ns)
                yield replace(piece, number=self._count)
                self._count += 1
        if at is not None:
            self.note(
                self._raw.size, self._raw.size, "the file ends without its closing records; all that it holds was read"
            )

    def note(self, start: int, stop: int, reason: str, span_ns: tuple[int, int | None] | None = None) -> None:
        """Note damage; `span_ns` are the times of receipt that it covers, in ns, the last None up to the end."""
        first = (self._times or span_ns or (0, 0))[0]
        span_s = None
        if span_ns is not None:
            begin, end = span_ns
            span_s = ((begin - first) / 1e9, None if end is None else (end - first) / 1e9)
        self.damage.append(Damage(self.path, start, stop, reason, span_s))

    def check_data(self) -> None:
        """Check the CRC of the data section where one was met."""
        expected, stop = self._data_crc or (0, 0)
        if expected and (crc := data_crc(self._raw, stop)) != expected:
            self.note(
                0,
                stop,
                f"the CRC of the data section is {crc:#010x}, expected {expected:#010x}: bytes have changed, and a "
                "message that reads well may be wrong",
            )

    def named_after(self, at: int) -> int | None:
        """Where the next chunk starts that the summary names."""
        number = bisect_right(self._starts, at)
        return self._starts[number] if number < len(self._starts) else None

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
            return None, self._lost(at, "the file ends inside a record")
        code, length = records.RECORD_HEAD.unpack_from(head)
        stop, limit = at + HEAD_SIZE + length, self.named_after(at) or self._raw.size
        if ends_data(self._raw, self._footer, at):
            return None, self._closed(at, code)
        if code == records.CHUNK:
            return self._chunk(at, length, limit)
        if trouble := self._trouble(code, stop, limit):
            return None, self._lost(at, trouble)
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
            return None, self._lost(at, "a message record is shorter than its head")
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
            return None, self._lost(
                at, "the file ends inside a chunk's head" if cut else "the chunk's head does not parse"
            )
        size = self._chunk_size(at, length, head, limit)
        if size is None:
            return None, self._lost(at, f"a chunk record of {length} bytes claims {head.data_size} bytes of contents")
        self._packed |= bool(head.compression)
        span = (head.start_ns, head.end_ns) if head.end_ns else None
        stop = at + HEAD_SIZE + size
        there = limit - at - HEAD_SIZE
        if stop > limit:
            self.note(
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
            self.note(at, stop, f"a metadata record does not parse: {error}")

    def _trouble(self, code: int, stop: int, limit: int) -> str | None:
        """Why the record that ends at `stop` cannot be used or hopped over; None if it can."""
        if code == 0:
            return "zero bytes where a record should start (the power or the disk failed)"
        known = code in _RUN or code in _SKIPPED or code >= records.PRIVATE
        if not known or stop > limit + self._raw.size:  # no cut loses more than half of a file within one record
            return f"no record starts here (code {code:#04x})"
        if stop > limit:
            return f"the file ends inside a record (code {code:#04x}), {stop - limit} bytes before its end"
        if code in _RUN:
            return None
        follows = stop == limit or starts_record(self._raw.peek, stop, self._raw.size)
        return None if follows else f"no record follows the one that starts here (code {code:#04x})"

    def _closed(self, at: int, code: int) -> int | None:
        """The end of the data: what follows is the summary section."""
        if self.named_after(at) is not None:
            return self._lost(at, "a closing record stands before the last chunk")
        end = self._footer
        if code == records.FOOTER:
            self.note(at, at, "the record that ends the data is missing; messages may have stood before it")
        elif end is None:
            self.note(at, self._raw.size, "the file ends inside its closing records; no message is lost")
        elif self._summary_lost:
            self.note(at, self._raw.size, "the summary section is damaged and was not used; no message is lost")
        content = self._raw.peek(at + HEAD_SIZE, at + HEAD_SIZE + 4)
        if code == records.DATA_END and len(content) == 4 and (crc := records.parse_data_end(content)):
            self._data_crc = (crc, at)
        return None

    def _lost(self, at: int, reason: str) -> int | None:
        """Note damage up to where records start again, or up to the end."""
        named = self.named_after(at)
        end = self._footer.summary_start if self._footer and self._footer.summary_start > at else self._raw.size
        channels = frozenset() if self._packed else self._channels()
        following = next_record(self._raw.peek, at + 1, named or end, channels) or named
        stop = self._raw.size if following is None else following
        tail = "what stands behind it is lost" if following is None else f"{stop - at} bytes are lost"
        self._block = _BEHIND
        self._pending.append(len(self.damage))
        latest = self._times and self._times[1]
        self.note(at, stop, f"{reason}; {tail}", None if latest is None else (latest, None))
        return following

    def _passed(self, span_ns: tuple[int, int] | None) -> None:
        """Take note of a piece's times; damage before it ended by then."""
        if span_ns is None:
            return
        first, latest = self._times or span_ns
        for number in self._pending:
            old = self.damage[number]
            begin = old.span_s[0] if old.span_s else 0.0
            self.damage[number] = replace(old, span_s=(begin, (span_ns[0] - first) / 1e9))
        self._pending.clear()
        self._times = (min(first, span_ns[0]), max(latest, span_ns[1]))
        if span_ns[0] < first:  # spans count from the file's first message, wherever it stands
            self.damage[:] = [_moved(damage, (first - span_ns[0]) / 1e9) for damage in self.damage]


def _moved(damage: Damage, by_s: float) -> Damage:
    """Damage whose span counts from an earlier time."""
    if damage.span_s is None:
        return damage
    begin, end = damage.span_s
    return replace(damage, span_s=(begin + by_s, None if end is None else end + by_s))
