"""Pieces of a file become batches of messages: by their message indexes, or by a walk over their records."""

from collections.abc import Callable, Iterator
from typing import Final, TypeVar

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Batch, Channel, Definitions, message_batch
from navirl_cli.logs.container.chunks import Decompressor, Piece, Unpacked, indexes_of, open_chunk
from navirl_cli.logs.container.damage import DamageList
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.container.records import Found
from navirl_cli.logs.container.resync import walk_on

#: Messages of one piece are apart from those of the next by more than a chunk's bytes.
_PIECE_ORDER: Final = 1 << 33

T = TypeVar("T")
Wanted = Callable[[Channel], bool]


class Opener:
    """Opens the pieces of a file, and takes up what is defined in them.

    Args:
        raw: The file's bytes.
        damage: Where damage is added.
        definitions: What is known beforehand; what the pieces define is added.
        sure: Whether a CRC vouches for them; else they are compared with those that the chunks hold.
        counted: Whether the messages of each channel are counted elsewhere: only that tells what indexes leave out.
        trust_indexes: False to take nothing from message indexes.
    """

    def __init__(
        self,
        raw: RawFile,
        damage: DamageList,
        definitions: Definitions,
        *,
        sure: bool,
        counted: bool,
        trust_indexes: bool,
    ) -> None:
        self._definitions = definitions
        self._sure = sure
        #: Whether message indexes stand for the messages.
        self.by_index = counted and trust_indexes
        self._trust = trust_indexes
        self._raw = raw
        self._damage = damage
        self._decompressor = Decompressor()
        #: Chunks that were not walked over: a definition may stand in one of them.
        self._passed: list[Piece] = []

    def wanted_in(self, piece: Piece, wanted: Wanted) -> tuple[Channel, ...] | None:
        """The wanted channels of a piece by its message indexes; None where only its records tell."""
        if not self._indexed(piece):
            return None
        return tuple(channel for number in piece.indexes if wanted(channel := self._definitions.channel(number)))

    def pass_by(self, piece: Piece) -> None:
        """Take note of a piece over which nobody walked."""
        self._passed.append(piece)

    def times(self, piece: Piece) -> dict[int, IntArray] | None:
        """Times of receipt in ns by channel, by message indexes; None where only the records tell."""
        if not self._indexed(piece):
            return None
        base = piece.start + piece.length
        indexes = indexes_of(self._raw.read(base, piece.stop), piece, base)
        return {number: times for number, (_, times) in indexes.items()} if len(indexes) == len(piece.indexes) else None

    def open(
        self, piece: Piece, mine: tuple[Channel, ...] | None, use: Callable[[Batch], T]
    ) -> tuple[Unpacked, list[T] | None]:
        """Open a piece, in any thread.

        Args:
            piece: The piece.
            mine: The wanted channels by its message indexes, None where it is walked over.
            use: What is done with each batch.

        Returns:
            What it holds, and the results where message indexes served.
        """
        if piece.loose is not None:
            return Unpacked(piece.loose[0]), None
        block = self._raw.read(piece.start, piece.stop)
        numbers = None if mine is None else {channel.id for channel in mine}
        unpacked = open_chunk(block, piece, self._decompressor, numbers)
        if unpacked.trouble or mine is None:
            return unpacked, None
        batches = []
        for channel in mine:
            offsets = unpacked.indexes[channel.id][0] if channel.id in unpacked.indexes else None
            batch = None if offsets is None else self._batch(piece, channel, unpacked, offsets)
            if batch is None or offsets is None or len(batch.starts) < len(offsets):
                # the message index is missing or wrong: the chunk itself knows better
                return unpacked, None
            batches.append(batch)
        return unpacked, [use(batch) for batch in batches]

    def batches(self, piece: Piece, unpacked: Unpacked, wanted: Wanted) -> Iterator[Batch]:
        """Walk over an open piece, note its damage, take up definitions, then yield the wanted channels' messages."""
        if unpacked.trouble:
            self._damage.add(piece.start, piece.stop, self._lost(unpacked, wanted), piece.span_ns)
            return
        found, holes = self._records(piece, unpacked)
        for start, stop in [] if piece.cut else holes:
            self._damage.add(
                piece.start,
                piece.stop,
                f"no record starts at byte {start} of {len(unpacked.raw)} of the uncompressed chunk; what stands up to "
                f"byte {stop} was read by its message index, or is lost",
                piece.span_ns,
            )
        self._take_up(piece, unpacked, found)
        indexes = unpacked.indexes if self._trust else {}
        for number in sorted(found.messages.keys() | indexes.keys()):
            offsets = np.array(found.messages.get(number, ()), dtype=np.int64)
            if self._is_defined(number):
                if wanted(channel := self._definitions.channel(number)):
                    yield from self._found(piece, channel, unpacked, offsets, indexes.get(number))
            elif len(offsets):
                reason = f"{len(offsets)} messages of channel {number}, which is nowhere defined, are lost"
                self._damage.add(piece.start, piece.stop, reason, piece.span_ns)

    def _found(
        self,
        piece: Piece,
        channel: Channel,
        unpacked: Unpacked,
        offsets: IntArray,
        index: tuple[IntArray, IntArray] | None,
    ) -> Iterator[Batch]:
        """The batch of a channel's messages, at offsets that a walk met and a message index names."""
        named = offsets[:0] if index is None else index[0]
        batch = self._batch(piece, channel, unpacked, np.union1d(offsets, named))
        there = 0 if batch is None else len(batch.starts)
        if there < len(named) and not piece.cut:
            reason = f"{len(named)} messages of {channel.topic} in the chunk's message index, {there} are there"
            self._damage.add(piece.start, piece.stop, reason, piece.span_ns)
            self._damage.lost_messages[channel.id] += len(named) - there
        if batch is not None:
            yield batch

    def _indexed(self, piece: Piece) -> bool:
        """Whether the message indexes of a piece can be used."""
        known, met = self._definitions.knows, self._definitions.met
        return (
            self.by_index
            and bool(piece.indexes)
            and all(known(number) and (self._sure or number in met) for number in piece.indexes)
        )

    def _batch(self, piece: Piece, channel: Channel, unpacked: Unpacked, offsets: IntArray) -> Batch | None:
        return message_batch(channel, unpacked.raw, offsets, piece.number * _PIECE_ORDER)

    def _records(self, piece: Piece, unpacked: Unpacked) -> tuple[Found, list[tuple[int, int]]]:
        """What a walk over a piece meets, and bytes that hold no records."""
        if piece.loose is not None:
            return piece.loose[1], []
        if piece.cut:
            return records.walk(unpacked.raw, len(unpacked.raw)), []
        return walk_on(unpacked.raw, self._definitions.channels.keys())

    def _take_up(self, piece: Piece, unpacked: Unpacked, found: Found) -> None:
        """Take up the definitions of a piece."""
        for code, start, stop in found.definitions:
            try:
                self._definitions.add(code, bytes(unpacked.raw[start:stop]))
            except records.MALFORMED as error:
                self._damage.add(piece.start, piece.stop, f"a schema or channel record cannot be used: {error}")

    def _is_defined(self, number: int) -> bool:
        """Whether a channel is defined; if need be its definition is looked for in chunks that were passed by."""
        if not self._definitions.knows(number):
            passed, self._passed = self._passed, []
            for piece in passed:
                unpacked, _ = self.open(piece, None, lambda batch: batch)
                self._take_up(piece, unpacked, self._records(piece, unpacked)[0])
        return number in self._definitions.channels

    def _lost(self, unpacked: Unpacked, wanted: Wanted) -> str:
        """What is wrong with a chunk, and how many messages are lost by it."""
        self._damage.lost_messages.update({number: len(offsets) for number, (offsets, _) in unpacked.indexes.items()})
        counts = [
            f"{len(offsets)} of {channel.topic}"
            for number, (offsets, _) in unpacked.indexes.items()
            if number in self._definitions.channels and wanted(channel := self._definitions.channel(number))
        ]
        return f"{unpacked.trouble}; messages lost: {', '.join(counts) or 'an unknown number'}"
