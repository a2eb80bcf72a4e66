"""Ways to break a log: a number always breaks the same log in the same way."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from small_logs import Base, packed

EXTREMES = (0, 1, 2, 3, 0x7F, 0xFF, 0x7FFF, 0xFFFF, *(2**k + d for k in (28, 31, 32, 63) for d in (-1, 0)), 2**64 - 1)


@dataclass
class Breaking:
    """A log that is being broken."""

    base: Base
    others: list[Base]
    rng: Generator
    data: bytearray
    #: What was done, in words.
    done: list[str] = field(default_factory=list)

    def number(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, max(low + 1, high)))

    def place(self) -> int:
        """A byte: anywhere, or at something that matters."""
        if self.rng.random() < 0.2:
            return self.number(0, len(self.data))
        name = list(self.base.spots)[self.number(0, len(self.base.spots))]
        places = self.base.spots[name]
        start, stop = places[self.number(0, len(places))] if places else (0, 1)
        return min(self.number(start, stop), len(self.data) - 1)

    def length(self) -> int:
        return int(2 ** self.rng.uniform(0, 9))

    def block(self) -> slice:
        """Some bytes: whole records, or whatever stands there."""
        if self.rng.random() < 0.5:
            at = self.place()
            return slice(at, at + self.length())
        records = self.base.strict.records
        alone = [told.place for told in self.base.strict.messages if told.chunk is None]
        if alone and self.rng.random() < 0.5:
            records = alone
        first = self.number(0, len(records))
        last = min(first + self.number(0, 3), len(records) - 1)
        return slice(records[first].start, records[last].stop)


def flip(log: Breaking) -> None:
    for _ in range(log.number(1, 9) if log.rng.random() < 0.3 else 1):
        log.data[log.place()] ^= 1 << log.number(0, 8)


def overwrite(log: Breaking) -> None:
    at, count = log.place(), log.length()
    kind = log.number(0, 3)
    new = (bytes(count), b"\xff" * count, log.rng.bytes(count))[kind]
    log.data[at : at + count] = new[: len(log.data) - at]


def cut(log: Breaking) -> None:
    del log.data[log.place() :]


def insert(log: Breaking) -> None:
    at, count = log.place(), log.length()
    log.data[at:at] = log.rng.bytes(count) if log.rng.random() < 0.7 else bytes(count)


def delete(log: Breaking) -> None:
    del log.data[log.block()]


def duplicate(log: Breaking) -> None:
    block = log.block()
    at = block.stop if log.rng.random() < 0.7 else log.place()
    log.data[at:at] = log.data[block]


def swap(log: Breaking) -> None:
    first, second = sorted((log.block(), log.block()), key=lambda block: block.start)
    if first.stop <= second.start:
        one, other = log.data[first], log.data[second]
        log.data[second] = one
        log.data[first] = other


def splice(log: Breaking) -> None:
    """The start of this log and the end of another."""
    other = log.others[log.number(0, len(log.others))]
    mine, theirs = log.place(), log.number(0, len(other.data))
    if log.rng.random() < 0.6:
        mine, theirs = log.block().start, other.strict.records[log.number(0, len(other.strict.records))].start
    log.data[mine:] = other.data[theirs:]


def extreme(log: Breaking) -> None:
    """A length, place, id or time becomes another."""
    at, width = log.base.fields[log.number(0, len(log.base.fields))]
    if log.rng.random() < 0.2:
        at, width = log.place(), (2, 4, 8)[log.number(0, 3)]
    own = int.from_bytes(log.data[at : at + width], "little")
    near = (own + 1, own - 1, 2 * own, own // 2, len(log.data), len(log.data) - at, own + log.number(0, 300))
    choice = (*EXTREMES, *near)[log.number(0, len(EXTREMES) + len(near))]
    log.data[at : at + width] = (choice % 256**width).to_bytes(width, "little")[: max(0, len(log.data) - at)]


def reword(log: Breaking) -> None:
    """A letter in a text that says what is what: topics, types, definitions."""
    texts = [place for name in ("schema", "channel", "metadata") for place in log.base.spots.get(name, [])]
    if not texts:
        flip(log)
        return
    start, stop = texts[log.number(0, len(texts))]
    at = min(log.number(start, stop), len(log.data) - 1)
    log.data[at] = b"\n\0 #/[]=_aezAZ0189\xff"[log.number(0, 19)]


MUTATIONS: tuple[Callable[[Breaking], None], ...] = (
    *(flip, flip, flip, overwrite, overwrite, cut, insert, delete, duplicate, swap, splice),
    *(extreme, extreme, extreme, reword),
)


@dataclass(frozen=True)
class Mutant:
    """A broken log."""

    number: int
    base: Base
    #: The file's bytes.
    data: bytes
    what: str


def mutant(number: int, logs: list[Base], seed: int = 0) -> Mutant:
    """The broken log of a number: one to five mutations of one base after the other."""
    rng = np.random.default_rng((seed, number))
    chosen = logs[number % len(logs)]
    outside = chosen.packing and rng.random() < 0.5
    start = packed(chosen.data, chosen.packing) if outside else chosen.data
    log = Breaking(chosen, logs, rng, bytearray(start))
    for _ in range((1, 1, 1, 1, 1, 2, 2, 3, 4, 5)[log.number(0, 10)]):
        if not log.data:
            break
        mutation = MUTATIONS[log.number(0, len(MUTATIONS))]
        mutation(log)
        log.done.append(mutation.__name__)
    data = bytes(log.data)
    return Mutant(number, chosen, data if outside else packed(data, chosen.packing), ", ".join(log.done))
