"""From the pieces of a file to batches of messages, by message indexes or by a walk over the records."""

from collections.abc import Callable, Iterator
from typing import Final, TypeVar

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.errors import Number, counted
from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Batch, Channel, Definitions, message_batch
from navirl_cli.logs.container.chunks import Decompressor, OpenedPiece, Piece, indexes_of, open_chunk
from navirl_cli.logs.container.damage import DamageList
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.container.records import FoundRecords
from navirl_cli.logs.container.resync import walk_over_gaps

#: Step between the places of two pieces in the file's order; no chunk has so many bytes.
_PIECE_ORDER: Final = 1 << 33

T = TypeVar("T")
Wanted = Callable[[Channel], bool]


class Opener:
    """Opens the pieces of a file.

    Args:
        raw: The file's bytes.
        damage: Where damage is added.
        definitions: Schemas and channels of the summary; those that the pieces define are added.
        counted: Whether statistics count the messages of each channel: only they show what message indexes leave out.
        trust_indexes: False to ignore message indexes.
        checked: Gives a piece the reason why it is not opened.
    """

    def __init__(
        self,
        raw: RawFile,
        damage: DamageList,
        definitions: Definitions,
        *,
        counted: bool,
        trust_indexes: bool,
        checked: Callable[[Piece], Piece],
    ) -> None:
        self._checked = checked
        self._definitions = definitions
        #: Whether messages are found by message indexes, where a piece has them.
        self.by_index = counted and trust_indexes
        self._trust = trust_indexes
        self._raw = raw
        self._damage = damage
        self._decompressor = Decompressor()
        #: Chunks that were not walked over; they may hold definitions.
        self._skipped: list[Piece] = []

    def wanted_in(self, piece: Piece, wanted: Wanted) -> tuple[Channel, ...] | None:
        """The wanted channels of a piece, by its message indexes; None if the piece must be walked over."""
        if not self._has_indexes(piece):
            return None
        return tuple(channel for number in piece.indexes if wanted(channel := self._definitions.channel(number)))

    def skip(self, piece: Piece) -> None:
        """Remember a piece that is not walked over."""
        self._skipped.append(piece)

    def times(self, piece: Piece) -> dict[int, IntArray] | None:
        """Times of receipt in ns by channel, by message indexes; None if the piece must be walked over."""
        if not self._has_indexes(piece):
            return None
        base = piece.start + piece.length
        indexes = indexes_of(self._raw.read(base, piece.stop), piece, base)
        times = {number: times for number, (_, times) in indexes.items()}
        return times if len(times) == len(piece.indexes) and _in_span(times, piece.span_ns or (0, 0)) else None

    def open(
        self, piece: Piece, channels: tuple[Channel, ...] | None, use: Callable[[Batch], T]
    ) -> tuple[OpenedPiece, list[T] | None]:
        """Open a piece, in any thread.

        Args:
            piece: The piece.
            channels: The wanted channels by its message indexes; None if the piece is walked over.
            use: Called with each batch that is found by a message index.

        Returns:
            The records, and what `use` returned; None in its place if the piece must be walked over.
        """
        if piece.unchunked is not None:
            return OpenedPiece(piece.unchunked[0]), None
        block = self._raw.read(piece.start, piece.stop)
        numbers = None if channels is None else {channel.id for channel in channels}
        opened = open_chunk(block, piece, self._decompressor, numbers)
        if opened.error or channels is None:
            return opened, None
        batches = []
        for channel in channels:
            offsets = opened.indexes[channel.id][0] if channel.id in opened.indexes else None
            batch = None if offsets is None else self._batch(piece, channel, opened, offsets)
            if batch is None or not _agrees(batch, opened.indexes[channel.id]):
                # the message index is missing or wrong: the chunk is walked over instead
                return opened, None
            batches.append(batch)
        return opened, [use(batch) for batch in batches]

    def batches(self, piece: Piece, opened: OpenedPiece, wanted: Wanted) -> Iterator[Batch]:
        """Walk over an open piece: add its damage and definitions, then yield the batches of the wanted channels."""
        if opened.error:
            self._damage.add(piece.start, piece.stop, self._loss(opened, wanted), piece.span_ns)
            return
        found, gaps = self._records(piece, opened)
        for start, stop in [] if piece.cut else gaps:
            self._damage.add(
                piece.start,
                piece.stop,
                f"no record starts at byte {start} of {len(opened.raw)} of the uncompressed chunk; messages up to "
                f"byte {stop} were read by the message index, or are lost",
                piece.span_ns,
            )
        self._define(piece, opened, found)
        indexes = opened.indexes if self._trust else {}
        for number in sorted(found.messages.keys() | indexes.keys()):
            offsets = np.array(found.messages.get(number, ()), dtype=np.int64)
            if self._is_defined(number):
                if wanted(channel := self._definitions.channel(number)):
                    yield from self._batch_of(piece, channel, opened, offsets, indexes.get(number))
            elif len(offsets):
                reason = (
                    f"{counted(len(offsets), 'message')} of channel {number} {Number(len(offsets)):is|are} lost, "
                    "because no record defines the channel"
                )
                self._damage.add(piece.start, piece.stop, reason, piece.span_ns)

    def _batch_of(
        self,
        piece: Piece,
        channel: Channel,
        opened: OpenedPiece,
        offsets: IntArray,
        index: tuple[IntArray, IntArray] | None,
    ) -> Iterator[Batch]:
        """Yield the batch of a channel's messages, at the offsets of a walk and of a message index."""
        listed = offsets[:0] if index is None else index[0]
        batch = self._batch(piece, channel, opened, _united(offsets, listed))
        found = 0 if batch is None else len(batch.starts)
        if found < len(listed) and not piece.cut:
            reason = (
                f"the chunk's message index lists {counted(len(listed), 'message')} of {channel.topic}, "
                f"{found} {Number(found):was|were} found"
            )
            self._damage.add(piece.start, piece.stop, reason, piece.span_ns)
            self._damage.lost_messages[channel.id] += len(listed) - found
        elif index is not None and (wrong := _wrong_times(batch, index)) and not piece.cut:
            reason = (
                f"the chunk's message index states other times than {counted(wrong, 'message')} of "
                f"{channel.topic}; {Number(wrong):the message's own counts|theirs count}"
            )
            self._damage.add(piece.start, piece.stop, reason, piece.span_ns)
        if batch is not None:
            yield batch

    def _has_indexes(self, piece: Piece) -> bool:
        """Whether the message indexes of a piece can be used.

        A piece is walked over until all its channels were met: what the summary defines may differ from the data.
        """
        known, met = self._definitions.knows, self._definitions.met
        return self.by_index and bool(piece.indexes) and all(known(n) and n in met for n in piece.indexes)

    def _batch(self, piece: Piece, channel: Channel, opened: OpenedPiece, offsets: IntArray) -> Batch | None:
        return message_batch(channel, opened.raw, offsets, piece.number * _PIECE_ORDER)

    def _records(self, piece: Piece, opened: OpenedPiece) -> tuple[FoundRecords, list[tuple[int, int]]]:
        """The records that a walk over a piece finds, and the bytes [start, stop) that hold none."""
        if piece.unchunked is not None:
            return piece.unchunked[1], []
        if piece.cut:
            return records.walk(opened.raw, len(opened.raw)), []
        return walk_over_gaps(opened.raw, self._definitions.channels.keys())

    def _define(self, piece: Piece, opened: OpenedPiece, found: FoundRecords) -> None:
        """Add the definitions of a piece."""
        for code, start, stop in found.definitions:
            try:
                self._definitions.add(code, bytes(opened.raw[start:stop]))
            except records.MALFORMED as error:
                self._damage.add(piece.start, piece.stop, f"a schema or channel record cannot be used: {error}")

    def _is_defined(self, number: int) -> bool:
        """Whether a channel is defined; its definition is searched for in skipped chunks if necessary."""
        if not self._definitions.knows(number):
            skipped, self._skipped = self._skipped, []
            for piece in skipped:
                opened, _ = self.open(self._checked(piece), None, lambda batch: batch)
                self._define(piece, opened, self._records(piece, opened)[0])
        return number in self._definitions.channels

    def _loss(self, opened: OpenedPiece, wanted: Wanted) -> str:
        """Count the messages of a chunk that cannot be used; return the text for its damage."""
        self._damage.lost_messages.update({number: len(offsets) for number, (offsets, _) in opened.indexes.items()})
        counts = [
            f"{len(offsets)} of {channel.topic}"
            for number, (offsets, _) in opened.indexes.items()
            if number in self._definitions.channels and wanted(channel := self._definitions.channel(number))
        ]
        return f"{opened.error}; messages lost: {', '.join(counts) or 'an unknown number'}"


def _united(walked: IntArray, listed: IntArray) -> IntArray:
    """Offsets of a walk, which ascend, and of an index: ascending, each once. np.union1d hashes, 20 times slower."""
    if not listed.size or np.array_equal(walked, listed):
        return walked
    both = np.sort(np.concatenate([walked, listed]), kind="stable")
    once: IntArray = both[np.append(True, both[1:] != both[:-1])]
    return once


def _in_span(times: dict[int, IntArray], span_ns: tuple[int, int]) -> bool:
    """Whether the first and the last time of message indexes are those that the chunk states."""
    ends = [
        end
        for some in times.values()
        if len(some)
        for end in (some.astype(np.uint64).min(), some.astype(np.uint64).max())
    ]
    return not ends or (min(ends), max(ends)) == span_ns


def _agrees(batch: Batch, index: tuple[IntArray, IntArray]) -> bool:
    """Whether a message index names the messages of a batch and their times."""
    return len(batch.starts) == len(index[0]) and np.array_equal(batch.log_time_ns, index[1])


def _wrong_times(batch: Batch | None, index: tuple[IntArray, IntArray]) -> int:
    """Number of messages of which an index states another time."""
    if batch is None:
        return 0
    places = batch.starts - records.MESSAGE_HEAD_SIZE
    rows = np.searchsorted(places, index[0]).clip(max=len(places) - 1)
    return int(((places[rows] == index[0]) & (batch.log_time_ns[rows] != index[1])).sum())
