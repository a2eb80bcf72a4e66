"""Mutations that break a log; a number always gives the same broken log.

Here are those of its bytes; `structured` has those of its structure.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from small_logs import IntactLog, compressed
from structured import rewritten

EXTREMES = (0, 1, 2, 3, 0x7F, 0xFF, 0x7FFF, 0xFFFF, *(2**k + d for k in (28, 31, 32, 63) for d in (-1, 0)), 2**64 - 1)


@dataclass
class Breaking:
    """A log that is being broken."""

    log: IntactLog
    others: Sequence[IntactLog]
    rng: Generator
    data: bytearray
    #: Names of the mutations so far.
    done: list[str] = field(default_factory=list)

    def number(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, max(low + 1, high)))

    def place(self) -> int:
        """A byte anywhere, or at a place of `spots`."""
        if self.rng.random() < 0.2:
            return self.number(0, len(self.data))
        name = list(self.log.spots)[self.number(0, len(self.log.spots))]
        places = self.log.spots[name]
        start, stop = places[self.number(0, len(places))] if places else (0, 1)
        return min(self.number(start, stop), len(self.data) - 1)

    def length(self) -> int:
        return int(2 ** self.rng.uniform(0, 9))

    def block(self) -> slice:
        """Bytes of one to three records, or of any length at any place."""
        if self.rng.random() < 0.5:
            at = self.place()
            return slice(at, at + self.length())
        records = self.log.strict.records
        alone = [message.place for message in self.log.strict.messages if message.chunk is None]
        if alone and self.rng.random() < 0.5:
            records = alone
        first = self.number(0, len(records))
        last = min(first + self.number(0, 3), len(records) - 1)
        return slice(records[first].start, records[last].stop)


def flip(breaking: Breaking) -> None:
    for _ in range(breaking.number(1, 9) if breaking.rng.random() < 0.3 else 1):
        breaking.data[breaking.place()] ^= 1 << breaking.number(0, 8)


def overwrite(breaking: Breaking) -> None:
    at, count = breaking.place(), breaking.length()
    kind = breaking.number(0, 3)
    new = (bytes(count), b"\xff" * count, breaking.rng.bytes(count))[kind]
    breaking.data[at : at + count] = new[: len(breaking.data) - at]


def cut(breaking: Breaking) -> None:
    del breaking.data[breaking.place() :]


def insert(breaking: Breaking) -> None:
    at, count = breaking.place(), breaking.length()
    breaking.data[at:at] = breaking.rng.bytes(count) if breaking.rng.random() < 0.7 else bytes(count)


def delete(breaking: Breaking) -> None:
    del breaking.data[breaking.block()]


def duplicate(breaking: Breaking) -> None:
    block = breaking.block()
    at = block.stop if breaking.rng.random() < 0.7 else breaking.place()
    breaking.data[at:at] = breaking.data[block]


def swap(breaking: Breaking) -> None:
    first, second = sorted((breaking.block(), breaking.block()), key=lambda block: block.start)
    if first.stop <= second.start:
        one, other = breaking.data[first], breaking.data[second]
        breaking.data[second] = one
        breaking.data[first] = other


def splice(breaking: Breaking) -> None:
    """Join the start of this log and the end of another."""
    other = breaking.others[breaking.number(0, len(breaking.others))]
    mine, theirs = breaking.place(), breaking.number(0, len(other.data))
    if breaking.rng.random() < 0.6:
        mine, theirs = breaking.block().start, other.strict.records[breaking.number(0, len(other.strict.records))].start
    breaking.data[mine:] = other.data[theirs:]


def extreme(breaking: Breaking) -> None:
    """Change a length, place, id or time."""
    at, width = breaking.log.fields[breaking.number(0, len(breaking.log.fields))]
    if breaking.rng.random() < 0.2:
        at, width = breaking.place(), (2, 4, 8)[breaking.number(0, 3)]
    own = int.from_bytes(breaking.data[at : at + width], "little")
    near = (
        own + 1,
        own - 1,
        2 * own,
        own // 2,
        len(breaking.data),
        len(breaking.data) - at,
        own + breaking.number(0, 300),
    )
    choice = (*EXTREMES, *near)[breaking.number(0, len(EXTREMES) + len(near))]
    breaking.data[at : at + width] = (choice % 256**width).to_bytes(width, "little")[: max(0, len(breaking.data) - at)]


def reword(breaking: Breaking) -> None:
    """Change a letter in a topic, a type, a definition or metadata."""
    texts = [place for name in ("schema", "channel", "metadata") for place in breaking.log.spots.get(name, [])]
    if not texts:
        flip(breaking)
        return
    start, stop = texts[breaking.number(0, len(texts))]
    at = min(breaking.number(start, stop), len(breaking.data) - 1)
    breaking.data[at] = b"\n\0 #/[]=_aezAZ0189\xff"[breaking.number(0, 19)]


MUTATIONS: tuple[Callable[[Breaking], None], ...] = (
    *(flip, flip, flip, overwrite, overwrite, cut, insert, delete, duplicate, swap, splice),
    *(extreme, extreme, extreme, reword),
)


@dataclass(frozen=True)
class Mutant:
    """A broken log."""

    number: int
    log: IntactLog
    #: The file's bytes.
    data: bytes
    #: Names of the mutations.
    what: str
    #: Where the structure was changed and CRCs are right: the records of all chunks without compression.
    records: bytes | None = None
    #: Whether bytes were changed after that, so that CRCs may be wrong.
    hit: bool = False


#: Share of the broken logs whose structure is changed, and of those whose bytes are changed after that.
STRUCTURED_SHARE, BOTH_SHARE = 0.5, 0.15


def mutant(number: int, logs: Sequence[IntactLog], seed: int = 0) -> Mutant:
    """The broken log of a number: one to five mutations of one of the logs, of its structure or of its bytes."""
    rng = np.random.default_rng((seed, number))
    chosen = logs[number % len(logs)]
    count = (1, 1, 1, 1, 1, 2, 2, 3, 4, 5)[int(rng.integers(10))]
    if rng.random() < STRUCTURED_SHARE:
        new, records, done = rewritten(chosen, logs, rng, count)
        hit = bool(rng.random() < BOTH_SHARE)
        if hit:
            new, more = _broken(Breaking(chosen, logs, rng, bytearray(new)), 1)
            done += more
        return Mutant(number, chosen, compressed(new, chosen.compression), ", ".join(done), records, hit)
    # of a compressed file, either what is stored or what it decompresses to is broken
    outside = chosen.compression and rng.random() < 0.5
    data, done = _broken(Breaking(chosen, logs, rng, bytearray(chosen.stored if outside else chosen.data)), count)
    return Mutant(number, chosen, data if outside else compressed(data, chosen.compression), ", ".join(done))


def _broken(breaking: Breaking, count: int) -> tuple[bytes, list[str]]:
    """The bytes after some mutations, and the names of these."""
    for _ in range(count):
        if not breaking.data:
            break
        mutation = MUTATIONS[breaking.number(0, len(MUTATIONS))]
        mutation(breaking)
        breaking.done.append(mutation.__name__)
    return bytes(breaking.data), breaking.done
