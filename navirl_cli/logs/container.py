"""MCAP files as batches of message payloads, however they were written and whatever happened to them.

A file is walked from its first record to its last. Where the summary section is sound, its chunk index says which
chunks hold wanted channels, so that others are jumped over, and where a channel's messages stand in a chunk; where it
is not, each chunk is decompressed and walked. What cannot be read is noted as `Damage`, and the walk goes on behind it.
"""

from bisect import bisect_right
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np

from navirl_cli.errors import LogError
from navirl_cli.logs import records
from navirl_cli.logs.chunks import ChunkError, Decompressor, chunk_of, offsets_of
from navirl_cli.logs.parts import Batch, Channel, Damage, Definitions, message_batch
from navirl_cli.logs.records import HEAD_SIZE, ChunkIndex, IntArray
from navirl_cli.logs.sniff import check_magic, check_path
from navirl_cli.logs.summary import Summary, read_footer, read_summary

#: Bytes read at once where messages stand outside of chunks.
_BLOCK: Final = 4 << 20
_RUN: Final = frozenset({records.SCHEMA, records.CHANNEL, records.MESSAGE})
_CLOSING: Final = frozenset({records.DATA_END, records.FOOTER})

Wanted = Callable[[Channel], bool]
#: Yields batches and returns where the walk goes on, None at its end.
_Walk = Generator[Batch, None, int | None]


class LogFile:
    """An open MCAP file; a context manager.

    Args:
        path: The file.

    Raises:
        LogError: It is no MCAP file, or ends before its header does.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        check_path(self.path)
        try:
            self._file = self.path.open("rb")
        except OSError as error:
            raise LogError(f"{path}: expected a readable file, found: {error.strerror}; check its rights") from error
        self.size = self.path.stat().st_size
        #: What could not be read so far.
        self.damage: list[Damage] = []
        #: Metadata records met so far, in the file's order.
        self.metadata: list[tuple[str, dict[str, str]]] = []
        #: Bytes walked over so far.
        self.position = 0
        self._decompressor = Decompressor()
        self._order = 0
        with ExitStack() as on_failure:
            on_failure.callback(self._file.close)
            self.profile, self.library, self._data_start = self._header()
            self._footer = read_footer(self._file, self.size)
            #: The summary section, None if there is none or it is damaged.
            self.summary = self._footer and read_summary(self._file, self.size, self._data_start, self._footer)
            on_failure.pop_all()
        summary = self.summary or Summary()
        self._definitions = Definitions(dict(summary.schemas), dict(summary.channels))
        self._indexes = summary.chunks
        self._index_starts = sorted(summary.chunks)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels known so far: all of them after a walk, or at once with a complete summary."""
        return tuple(self._definitions.channel(number) for number in sorted(self._definitions.channels))

    def batches(self, wanted: Wanted) -> Iterator[Batch]:
        """Walk over the file; once, since it collects damage and metadata.

        Args:
            wanted: Says which channels' messages are wanted.

        Yields:
            Their messages, piece by piece in the file's order.
        """
        at: int | None = self._data_start
        while at is not None and at < self.size:
            self.position = at
            if at in self._indexes:
                yield from self._indexed_chunk(self._indexes[at], wanted)
                at = self._indexes[at].stop
            else:
                at = yield from self._record(at, wanted)
        self.position = self.size
        if at is not None:
            self._note(self.size, self.size, "the file ends without its closing records; all that it holds was read")

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """The metadata record at an offset of the file, None if there is none."""
        head = self._bytes(offset, offset + HEAD_SIZE)
        try:
            code, length = records.RECORD_HEAD.unpack_from(head)
            content = self._bytes(offset + HEAD_SIZE, min(self.size, offset + HEAD_SIZE + length))
            return records.parse_metadata(content) if code == records.METADATA else None
        except records.MALFORMED:
            return None

    def _header(self) -> tuple[str, str, int]:
        """Profile, library and the first byte behind the header."""
        head = self._file.read(512)
        check_magic(self.path, head, self.size)
        start = len(records.MAGIC) + HEAD_SIZE
        code, length = records.RECORD_HEAD.unpack_from(head.ljust(start, b"\0"), len(records.MAGIC))
        if len(head) >= start and code != records.HEADER:
            raise LogError(
                f"{self.path}: expected a header record after the magic, found record code {code:#04x}; "
                "the file is damaged: copy it again"
            )
        if len(head) < start or start + length > self.size:
            raise LogError(
                f"{self.path}: expected a header record after the magic, found the end of the file after "
                f"{self.size} bytes; nothing was recorded: record or copy it again"
            )
        try:
            return *records.parse_header(self._bytes(start, start + length)), start + length
        except records.MALFORMED as error:
            raise LogError(
                f"{self.path}: expected a header record after the magic, found one that does not parse ({error}); "
                "the file is damaged: copy it again"
            ) from error

    def _record(self, at: int, wanted: Wanted) -> _Walk:
        """Use the record that starts there, and as many messages behind it as fit into a block."""
        head = self._bytes(at, at + HEAD_SIZE)
        if len(head) < HEAD_SIZE:
            return self._lost(at, "the file ends inside a record")
        code, length = records.RECORD_HEAD.unpack_from(head)
        stop, limit = at + HEAD_SIZE + length, self._next_index(at) or self.size
        if code in _CLOSING:
            return self._closed(at)
        if code == records.CHUNK:
            return (yield from self._chunk(at, stop, limit, wanted))
        if trouble := _trouble(code, stop - limit):
            return self._lost(at, trouble)
        if code in _RUN:
            return (yield from self._run(at, stop, limit if code == records.MESSAGE else stop, wanted))
        if code == records.METADATA and (entry := self.metadata_at(at)):
            self.metadata.append(entry)
        return int(stop)

    def _run(self, at: int, stop: int, limit: int, wanted: Wanted) -> _Walk:
        """Read messages, schemas and channels that stand outside of chunks."""
        data = self._bytes(at, min(limit, max(stop, at + _BLOCK)))
        found = records.walk(data, len(data))
        if found.stop == 0:
            return self._lost(at, "a message record is shorter than its head")
        yield from self._found(data, found, wanted)
        return at + found.stop

    def _chunk(self, at: int, stop: int, limit: int, wanted: Wanted) -> _Walk:
        """Read a chunk that no index names."""
        content = self._bytes(at + HEAD_SIZE, min(stop, limit))
        try:
            head = records.parse_chunk_head(content)
            data = memoryview(content)[head.data_start : head.data_start + head.data_size]
            if stop <= limit:
                yield from self._walk_chunk(at, stop, self._decompressor.whole(head, data), wanted)
                return stop
            raw = self._decompressor.start(head, data)
        except records.MALFORMED:
            return self._lost(at, "the file ends inside a chunk's head") if stop > limit else self._bad(at, stop)
        except ChunkError as error:
            self._note(at, min(stop, limit), f"{error}; its messages are lost")
            return stop
        found = records.walk(raw, len(raw))
        count = sum(map(len, found.messages.values()))
        yield from self._found(raw, found, wanted)
        return self._lost(
            at,
            f"the file ends inside a chunk ({len(content)} of {stop - at - HEAD_SIZE} bytes are there); the {count} "
            "messages before the cut were read, those behind it are lost",
        )

    def _bad(self, at: int, stop: int) -> int:
        self._note(at, stop, "the chunk's head does not parse; its messages are lost")
        return stop

    def _indexed_chunk(self, index: ChunkIndex, wanted: Wanted) -> Iterator[Batch]:
        """Read a chunk that the summary names, or jump over it."""
        ids = index.message_indexes
        complete = bool(ids) and all(number in self._definitions.channels for number in ids)
        mine = [number for number in ids if complete and wanted(self._definitions.channel(number))]
        if complete and not mine:
            return
        block = self._bytes(index.start, index.stop)
        indexes = {number: offsets_of(block, ids[number] - index.start, number) for number in mine}
        try:
            head, data = chunk_of(block, index)
            raw = self._decompressor.whole(head, data)
        except ChunkError as error:
            counts = [
                f"{len(at)} of {self._definitions.channel(n).topic}" for n, at in indexes.items() if at is not None
            ]
            lost = ", ".join(counts) or "an unknown number"
            self._note(index.start, index.stop, f"{error}; messages lost: {lost}")
            return
        batches = [self._gather(number, raw, offsets) for number, offsets in indexes.items()]
        if complete and all(batch is not None for batch in batches):
            yield from (batch for batch in batches if batch is not None)
            self._order += len(raw)
        else:
            # the message index is missing or wrong: the chunk itself knows better
            yield from self._walk_chunk(index.start, index.stop, raw, wanted)

    def _walk_chunk(self, at: int, stop: int, raw: bytes, wanted: Wanted) -> Iterator[Batch]:
        found = records.walk(raw, len(raw))
        if found.stop < len(raw):
            self._note(
                at,
                stop,
                f"no record starts at byte {found.stop} of {len(raw)} of the uncompressed chunk; "
                "messages behind it are lost",
            )
        yield from self._found(raw, found, wanted)

    def _found(self, raw: bytes, found: records.Found, wanted: Wanted) -> Iterator[Batch]:
        """Take up definitions, then yield the batches of the wanted channels."""
        for code, start, stop in found.definitions:
            try:
                self._definitions.add(code, raw[start:stop])
            except records.MALFORMED as error:
                self._note(self.position, self.position, f"a schema or channel record does not parse: {error}")
        for number, offsets in found.messages.items():
            if number not in self._definitions.channels:
                self._note(
                    self.position,
                    self.position,
                    f"{len(offsets)} messages of channel {number}, which is nowhere defined, are lost",
                )
            elif wanted(self._definitions.channel(number)):
                batch = self._gather(number, raw, np.array(offsets, dtype=np.int64))
                if batch is not None:
                    yield batch
        self._order += len(raw)

    def _gather(self, number: int, raw: bytes, offsets: IntArray | None) -> Batch | None:
        if offsets is None:
            return None
        return message_batch(self._definitions.channel(number), raw, offsets, self._order)

    def _closed(self, at: int) -> int | None:
        """The end of the data: what follows is the summary section."""
        if self._next_index(at) is not None:
            return self._lost(at, "a closing record stands before the last chunk")
        if self._footer is None:
            self._note(at, self.size, "the file ends inside its closing records; no message is lost")
        elif self._footer.summary_start and self.summary is None:
            self._note(at, self.size, "the summary section is damaged and was not used; no message is lost")
        return None

    def _lost(self, at: int, reason: str) -> int | None:
        """Note damage up to the next known chunk, or up to the end."""
        following = self._next_index(at)
        self._note(at, self.size if following is None else following, reason)
        return following

    def _next_index(self, at: int) -> int | None:
        number = bisect_right(self._index_starts, at)
        return self._index_starts[number] if number < len(self._index_starts) else None

    def _note(self, start: int, stop: int, reason: str) -> None:
        self.damage.append(Damage(self.path, start, stop, reason))

    def _bytes(self, start: int, stop: int) -> bytes:
        self._file.seek(start)
        return self._file.read(stop - start)


def _trouble(code: int, excess: int) -> str | None:
    """Why a record cannot be used whose end lies `excess` bytes behind that of the file; None if it can."""
    if code == 0:
        return "zero bytes where a record should start (the power or the disk failed); messages behind it are lost"
    if records.DATA_END < code < records.PRIVATE:
        return f"no record starts here (code {code:#04x}); messages behind it are lost"
    if excess > 0:
        return f"the file ends inside a record (code {code:#04x}), {excess} bytes before its end"
    return None
