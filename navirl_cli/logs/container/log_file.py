"""MCAP files as batches of message payloads, however they were written and whatever happened to them.

The survey of a file says where its messages stand. Chunks whose message indexes name no wanted channel are not opened;
the others are read, decompressed and handed on by several threads, in the file's order. What a message index gets wrong
is found by walking over the chunk's records; what it leaves out only the file's statistics tell, so that without them,
as in a file that is cut, all chunks are walked over. What cannot be read is noted as `Damage`.
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
from navirl_cli.logs.container.chunks import Piece, Unpacked
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.damage import Damage, DamageList
from navirl_cli.logs.container.opener import Opener, Wanted
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.container.records import HEAD_SIZE
from navirl_cli.logs.container.summary import Summary, read_footer, read_header, read_summary
from navirl_cli.logs.container.survey import Survey
from navirl_cli.parallel import cores

#: More threads than this wait for each other and for the memory.
_MAX_THREADS: Final = 4
_KEPT_BYTES: Final = 1 << 24

T = TypeVar("T")


def threads_here() -> int:
    """How many threads reading uses."""
    return min(cores(), _MAX_THREADS)


@dataclass(eq=False)
class _Job(Generic[T]):
    """A piece that is being opened."""

    piece: Piece
    #: What it holds, and the results where message indexes served.
    outcome: "Future[tuple[Unpacked, list[T] | None]]"


class LogFile:
    """An open MCAP file; a context manager.

    Args:
        path: The file, or one that is open, which stays so.
        trust_indexes: False to walk over every chunk, whatever message indexes say.

    Raises:
        LogError: It is no MCAP file, or ends before its header does.
    """

    def __init__(self, path: Path | str | RawFile, *, trust_indexes: bool = True) -> None:
        self._raw = path if isinstance(path, RawFile) else open_log(Path(path))
        self._keeps_open = self._raw is path
        self.path, self.size = self._raw.path, self._raw.size
        #: Bytes walked over so far.
        self.position = 0
        with ExitStack() as on_failure:
            on_failure.callback(self._close)
            self.profile, self.library, self._data_start = read_header(self._raw)
            self._footer = read_footer(self._raw)
            #: The summary section, None if there is none or it is damaged.
            self.summary = self._footer and read_summary(self._raw, self._data_start, self._footer)
            on_failure.pop_all()
        self._start(trust_indexes=trust_indexes)

    def _start(self, *, trust_indexes: bool) -> None:
        """Get ready for a walk; nothing is known yet but the summary."""
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
            sure=bool(footer and footer.summary_crc),
            counted=summary.statistics is not None,
            trust_indexes=trust_indexes,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        if not self._keeps_open:
            self._raw.file.close()

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
        """The channels known so far: all of them after a walk, or at once with a complete summary."""
        return tuple(self._definitions.channel(number) for number in sorted(self._definitions.channels))

    def batches(self, wanted: Wanted) -> Iterator[Batch]:
        """Walk over the file; once, since it collects damage and metadata.

        Args:
            wanted: Says which channels' messages are wanted.

        Yields:
            Their messages, piece by piece in the file's order.
        """
        return self.results(wanted, lambda batch: batch, threads=1)

    def results(self, wanted: Wanted, use: Callable[[Batch], T], threads: int) -> Iterator[T]:
        """Walk over the file, and use its messages by several threads; once, as :meth:`batches`.

        Args:
            wanted: Says which channels' messages are wanted.
            use: What is done with each batch, in any thread.
            threads: How many open chunks at once.

        Yields:
            What came out, in the file's order.
        """
        # once a block of this size was freed, glibc keeps smaller ones in place of giving them back chunk by chunk
        np.empty(_KEPT_BYTES, dtype=np.uint8)
        jobs: deque[_Job[T]] = deque()
        with ThreadPoolExecutor(threads) as pool:
            for piece in self._survey.pieces():
                if piece is None:
                    yield from self._all_finished(jobs, wanted, use)
                    continue
                mine = self._opener.wanted_in(piece, wanted)
                if mine == ():
                    self._opener.pass_by(piece)
                    continue
                jobs.append(_Job(piece, pool.submit(self._opener.open, piece, mine, use)))
                if len(jobs) > threads:
                    yield from self._finished(jobs.popleft(), wanted, use)
            yield from self._all_finished(jobs, wanted, use)
        self.position = self.size
        self._survey.check_data()

    def times(self) -> dict[int, IntArray]:
        """Times of receipt in ns of all messages by channel, ascending, from message indexes where they can be used."""
        found = self._times()
        promised = self.summary.statistics.by_channel if self.summary and self.summary.statistics else {}
        if self._opener.by_index and any(len(found.get(number, ())) < count for number, count in promised.items()):
            self._start(trust_indexes=False)
            found = self._times()
        return found

    def _times(self) -> dict[int, IntArray]:
        found: dict[int, list[IntArray]] = {}
        for piece in filter(None, self._survey.pieces()):
            times = self._opener.times(piece)
            if times is None:
                unpacked, _ = self._opener.open(piece, None, lambda batch: batch)
                for batch in self._opener.batches(piece, unpacked, lambda _: True):
                    found.setdefault(batch.channel.id, []).append(batch.log_time_ns)
            else:
                self._opener.pass_by(piece)
                for number, some in times.items():
                    found.setdefault(number, []).append(some)
        joined = {number: np.sort(np.concatenate(times)) for number, times in found.items()}
        return {number: times for number, times in joined.items() if len(times)}

    def _all_finished(self, jobs: deque[_Job[T]], wanted: Wanted, use: Callable[[Batch], T]) -> Iterator[T]:
        """The results of all pieces that are being opened, after which their definitions are known."""
        while jobs:
            yield from self._finished(jobs.popleft(), wanted, use)

    def _finished(self, job: _Job[T], wanted: Wanted, use: Callable[[Batch], T]) -> Iterator[T]:
        """The results of a piece, in turn."""
        unpacked, results = job.outcome.result()
        self.position = job.piece.stop
        if results is None:
            yield from map(use, self._opener.batches(job.piece, unpacked, wanted))
        else:
            self._opener.pass_by(job.piece)
            yield from results

    def metadata_at(self, offset: int) -> tuple[str, dict[str, str]] | None:
        """The metadata record at an offset of the file, None if there is none."""
        head = self._raw.read(offset, offset + HEAD_SIZE)
        try:
            code, length = records.RECORD_HEAD.unpack_from(head)
            content = self._raw.read(offset + HEAD_SIZE, min(self.size, offset + HEAD_SIZE + length))
            return records.parse_metadata(content) if code == records.METADATA else None
        except records.MALFORMED:
            return None
