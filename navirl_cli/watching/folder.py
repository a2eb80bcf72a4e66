"""Which recordings of a folder are finished.

A recorder writes the end of an MCAP file when it closes it, and rosbag2 writes metadata.yaml after that. Without these
signs a recorder was killed or is still at work; its recording counts as finished when it has not grown for a while.

Notifications of the file system would not say more: a recording is finished when nothing happens any more. They are
also missing on network drives. So the folder is looked at, and the pause between two looks follows their cost.
"""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from navirl_cli.errors import LogError
from navirl_cli.logs.container.records import FOOTER, HEAD_SIZE, MAGIC, TAIL_SIZE
from navirl_cli.logs.sources import METADATA, Source, sources_of

#: Shortest pause between two looks, s, and the largest share of a processor that looks may take.
PAUSE_S, SHARE = 0.5, 0.005

#: Name, size and time of change of each file.
Stamp = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True)
class Recorded:
    """A recording in the folder."""

    #: Its file or folder, relative to the watched folder.
    key: str
    source: Source
    stamp: Stamp
    #: Whether its end was written.
    closed: bool


@dataclass(frozen=True)
class Look:
    """What one look at the folder found."""

    #: Finished recordings that were not taken yet, by name.
    ready: tuple[Recorded, ...]
    #: Keys of those that may still grow, and whether they have grown since they were first seen.
    open: tuple[tuple[str, bool], ...]
    #: Folders and files that are no recordings, with the reason.
    refused: tuple[str, ...]


@dataclass(eq=False)
class Folder:
    """A folder of recordings.

    Args:
        path: The folder.
        settle_s: A recording without an end is finished after this time without growth, s.
        clock: Seconds.
    """

    path: Path
    settle_s: float
    clock: Callable[[], float] = time.monotonic
    _since: dict[str, tuple[Stamp, float, bool]] = field(default_factory=dict)
    _taken: dict[str, Stamp] = field(default_factory=dict)
    _seen: Stamp = ()
    _sources: Sequence[Source] = ()
    _refused: tuple[str, ...] = ()

    def look(self) -> Look:
        """Look at the folder.

        Raises:
            LogError: The folder is missing.
        """
        now = self.clock()
        self._find()
        ready, still = [], []
        for source in self._sources:
            one = self._recorded(source)
            if one is None or self._taken.get(one.key) == one.stamp:
                continue
            stamp, since, grown = self._since.get(one.key, (one.stamp, now, False))
            if stamp != one.stamp:
                since, grown = now, True
            self._since[one.key] = one.stamp, since, grown
            if one.closed or now - since >= self.settle_s:
                ready.append(one)
            else:
                still.append((one.key, grown))
        return Look(tuple(ready), tuple(still), self._refused)

    def take(self, one: Recorded) -> bool:
        """Count a recording as taken, unless it has changed since it was looked at."""
        now = self._recorded(one.source)
        if now is None or now.stamp != one.stamp:
            return False
        self._taken[one.key] = one.stamp
        return True

    def _find(self) -> None:
        """The recordings, which are sought again only where a file has changed."""
        if not self.path.is_dir():
            raise LogError(f"{self.path}: expected a folder of recordings, found none; create it before the recorder")
        seen = _stamp(sorted(_files(self.path)))
        if seen == self._seen:
            return
        self._seen = seen
        refused: list[LogError] = []
        try:
            self._sources = sources_of([self.path], refused=refused)
        except LogError:  # an empty folder, or bags only of which nothing can be read yet
            self._sources = ()
        self._refused = tuple(map(str, refused))

    def _recorded(self, source: Source) -> Recorded | None:
        """A recording as it is now; None where a file has vanished."""
        first = source.files[0]
        alone = source.name == first.name
        metadata = first.parent / METADATA
        try:
            stamp = _stamp([*source.files, *([metadata] if not alone and metadata.exists() else [])])
            closed = (alone or metadata.exists()) and all(map(_is_closed, source.files))
        except OSError:
            return None
        key = (first if alone else first.parent).relative_to(self.path).as_posix()
        return Recorded(key, source, stamp, closed)


def pause_s(cost_s: float) -> float:
    """How long to wait after a look that took so much time of a processor, s."""
    return max(PAUSE_S, cost_s / SHARE)


def _files(folder: Path) -> list[Path]:
    """All files in a folder and below it."""
    return [Path(home, name) for home, _, names in os.walk(folder, followlinks=True) for name in names]


def _stamp(files: Sequence[Path]) -> Stamp:
    """Name, size and time of change of files; those that vanish meanwhile have a size of -1."""
    found = []
    for file in files:
        try:
            state = file.stat()
            found.append((str(file), state.st_size, state.st_mtime_ns))
        except OSError:
            found.append((str(file), -1, 0))
    return tuple(found)


def _is_closed(file: Path) -> bool:
    """Whether a file ends as a closed MCAP file does: with the footer and the magic bytes."""
    with file.open("rb") as stream:
        if stream.seek(0, os.SEEK_END) < TAIL_SIZE + len(MAGIC):
            return False
        stream.seek(-TAIL_SIZE, os.SEEK_END)
        tail = stream.read(TAIL_SIZE)
    length = TAIL_SIZE - HEAD_SIZE - len(MAGIC)
    return tail.endswith(MAGIC) and tail[0] == FOOTER and int.from_bytes(tail[1:HEAD_SIZE], "little") == length
