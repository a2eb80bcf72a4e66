"""MCAP files as batches of messages, for every variant of the format and for damaged files.

The survey of a file finds where its messages stand. Chunks whose message indexes name no wanted channel are not opened.
The others are read and decompressed by several threads and handed on in the file's order. Where a message index is
wrong, the chunk's records are walked over. What it leaves out shows only by the file's statistics; without them, as in
a file that is cut off, all chunks are walked over. What cannot be read is reported as `Damage`.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Generic, Self, TypeVar

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container import records
from navirl_cli.logs.container.batches import Batch, Channel, Definitions
from navirl_cli.logs.container.chunks import OpenedPiece, Piece
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.damage import Damage, DamageList
from navirl_cli.logs.container.opener import Opener, Wanted
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.container.records import HEAD_SIZE
from navirl_cli.logs.container.summary import Summary, read_footer, read_header, read_summary
from navirl_cli.logs.container.survey import Survey
from navirl_cli.parallel import cores
from navirl_cli.remote import path_of

#: More threads only wait for each other and for memory.
_MAX_THREADS: Final = 4
_KEPT_BYTES: Final = 1 << 24

T = TypeVar("T")


def threads_here() -> int:
    """Number of threads that reading uses by default."""
    return min(cores(), _MAX_THREADS)


@dataclass(eq=False)
class _Job(Generic[T]):
    """A piece that is being opened."""

    piece: Piece
    #: What `Opener.open` returns.
    outcome: "Future[tuple[OpenedPiece, list[T] | None]]"


class LogFile:
    """An open MCAP file; a context manager.

    Args:
        path: The file; one that is already open stays open.
        trust_indexes: False to ignore message indexes and walk over every chunk.

    Raises:
        LogError: It is not an MCAP file, or ends before the end of its header.
    """

    def __init__(self, path: Path | str | RawFile, *, trust_indexes: bool = True) -> None:
        self._raw = path if isinstance(path, RawFile) else open_log(path if isinstance(path, Path) else path_of(path))
        self._keeps_open = self._raw is path
        self.path, self.size = self._raw.path, self._raw.size
        #: Bytes walked over so far.
        self.position = 0
        with ExitStack() as on_failure:
            on_failure.callback(self._close)
            self.profile, self.library, self._data_start = read_header(self._raw)
            self._footer = read_footer(self._raw)
            #: The summary section; None if it is missing or damaged.
            self.summary = self._footer and read_summary(self._raw, self._data_start, self._footer)
            on_failure.pop_all()
        self._start(trust_indexes=trust_indexes)

    def _start(self, *, trust_indexes: bool) -> None:
        """Prepare a walk; only the summary is known yet."""
        footer, summary = self._footer, self.summary or Summary()
        self._damage = DamageList(self.path, self._raw.damage)
        self._definitions = Definitions(dict(summary.schemas), dict(summary.channels))
        self._survey = Survey(
            self._raw,
            self._data_start,
            summary.chunks,
            footer,
            self._definitions,
            self._damage,
            summary_lost=bool(footer and footer.summary_start and self.summary is None),
        )
        self._opener = Opener(
            self._raw,
            self._damage,
            self._definitions,
            counted=summary.statistics is not None,
            trust_indexes=trust_indexes,
            checked=self._survey.checked,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        if not self._keeps_open:
            self._raw.close()

    @property
    def damage(self) -> list[Damage]:
        """What could not be read so far, in the file's order."""
        return self._damage.in_order()

    @property
    def lost(self) -> Mapping[int, int]:
        """Messages by channel that message indexes name and that cannot be read."""
        return self._damage.lost_messages

    @property
    def metadata(self) -> list[tuple[str, dict[str, str]]]:
        """Metadata records met so far, in the file's order."""
        return self._survey.metadata

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels known so far: all of them after a walk, or from the start with a complete summary."""
        return tuple(self._definitions.channel(number) for number in sorted(self._definitions.channels))

    def batches(self, wanted: Wanted) -> Iterator[Batch]:
        """Walk over the file; to be called once, because the walk collects damage and metadata.

        Args:
            wanted: Whether a channel's messages are wanted.

        Yields:
            Batches of them, in the file's order.
        """
        return self.results(wanted, lambda batch: batch, threads=1)

    def results(self, wanted: Wanted, use: Callable[[Batch], T], threads: int) -> Iterator[T]:
        """Walk over the file with several threads; to be called once, like :meth:`batches`.

        Args:
            wanted: Whether a channel's messages are wanted.
            use: Called with each batch, in any thread.
            threads: Number of threads that open chunks.

        Yields:
            What `use` returned, in the file's order.
        """
        # after a block of this size was freed, glibc keeps smaller ones and does not return them after each chunk
        np.empty(_KEPT_BYTES, dtype=np.uint8)
        jobs: deque[_Job[T]] = deque()
        self._raw.plan([(one.start, one.stop) for one in self._survey.planned() if self._may_hold(one, wanted)])
        with ThreadPoolExecutor(threads) as pool:
            for piece in self._survey.pieces():
                if piece is None:
                    yield from self._all_results(jobs, wanted, use)
                    continue
                channels = self._opener.wanted_in(piece, wanted)
                if channels == ():
                    self._opener.skip(piece)
                    continue
                jobs.append(_Job(piece, pool.submit(self._opener.open, self._survey.checked(piece), channels, use)))
                if len(jobs) > threads:
                    yield from self._results(jobs.popleft(), wanted, use)
            yield from self._all_results(jobs, wanted, use)
        self.position = self.size
        self._survey.check_data()

    def _may_hold(self, piece: Piece, wanted: Wanted) -> bool:
        """Whether a chunk may hold wanted messages, by what is known before it is read."""
        known = [number for number in piece.indexes if number in self._definitions.channels]
        return (
            len(known) < len(piece.indexes) or not known or any(wanted(self._definitions.channel(one)) for one in known)
        )

    @property
    def requests_of_times(self) -> int:
        """Number of requests that :meth:`times` makes; 0 for a file of this machine."""
        return self._raw.requests(self._indexes)

    @property
    def _indexes(self) -> list[tuple[int, int]]:
        """Where message indexes stand."""
        return [(one.start + one.length, one.stop) for one in self._survey.planned()]

    def times(self) -> dict[int, IntArray]:
        """Times of receipt in ns of all messages by channel, ascending; from message indexes where possible."""
        found = self._times()
        counted = self.summary.statistics.by_channel if self.summary and self.summary.statistics else {}
        if self._opener.by_index and any(len(found.get(number, ())) < count for number, count in counted.items()):
            self._start(trust_indexes=False)
            found = self._times()
        return found

    def _times(self) -> dict[int, IntArray]:
        found: dict[int, list[IntArray]] = {}
        self._raw.plan(self._indexes)
        for piece in filter(None, self._survey.pieces()):
            times = self._opener.times(piece)
            if times is None:
                opened, _ = self._opener.open(self._survey.checked(piece), None, lambda batch: batch)
                for batch in self._opener.batches(piece, opened, lambda _: True):
                    found.setdefault(batch.channel.id, []).append(batch.log_time_ns)
            else:
                self._opener.skip(piece)
                for number, some in times.items():
                    found.setdefault(number, []).append(some)
        joined = {number: np.sort(np.concatenate(times)) for number, times in found.items()}
        return {number: times for number, times in joined.items() if len(times)}

    def _all_results(self, jobs: deque[_Job[T]], wanted: Wanted, use: Callable[[Batch], T]) -> Iterator[T]:
        """Yield the results of all pieces that are being opened; their definitions are known after that."""
        while jobs:
            yield from self._results(jobs.popleft(), wanted, use)

    def _results(self, job: _Job[T], wanted: Wanted, use: Callable[[Batch], T]) -> Iterator[T]:
        """Yield the results of a piece."""
        opened, results = job.outcome.result()
        self.position = job.piece.stop
        if results is None:
            yield from map(use, self._opener.batches(job.piece, opened, wanted))
        else:
            self._opener.skip(job.piece)
            yield from results

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """The metadata record at an offset of the file; None if there is another record, or none."""
        head = self._raw.read(offset, offset + HEAD_SIZE)
        try:
            code, length = records.RECORD_HEAD.unpack_from(head)
            content = self._raw.read(offset + HEAD_SIZE, min(self.size, offset + HEAD_SIZE + length))
            return records.parse_metadata(content) if code == records.METADATA else None
        except records.MALFORMED:
            return None
