"""Mutations of a log's structure: numbers, times, indexes and records change, and all CRCs are right for what changed.

The file that comes of one may be intact, but another log. Where its parts contradict each other, only what two of them
state shows it.
"""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from numpy.random import Generator
from rewriting import COMPRESSIONS, Part, Parts, taken_apart
from small_logs import IntactLog
from strict_log import CHANNEL, MESSAGE, SCHEMA

#: Times in ns, as unsigned numbers: near the ends of both kinds of numbers, and of the years 1970 and 2262.
TIMES = (0, 1, 10**9, 2**62, *(2**63 + d for d in (-(10**9), -2, -1, 0, 1)), *(2**64 - d for d in (10**9, 2, 1)))
LENGTHS = (0, 1, 2, 0xFF, 0xFFFF, *(2**k + d for k in (16, 24, 28, 31) for d in (-1, 0)), 2**32 - 1)
PLACES = (0, 1, 8, 2**31, 2**32, 2**63 - 1, 2**63, 2**64 - 1)
NUMBERS = (0.0, -0.0, 1e-320, 1e9, 1e19, 1.7e308, -1.7e308, float("inf"), float("-inf"), float("nan"))


@dataclass
class Rewriting:
    """A log that is being changed."""

    parts: Parts
    log: IntactLog
    others: Sequence[IntactLog]
    rng: Generator

    def below(self, count: int) -> int:
        return int(self.rng.integers(0, max(1, count)))

    def one(self, values: Sequence[int]) -> int:
        return values[self.below(len(values))]

    def message(self) -> tuple[list[Part], int] | None:
        """Any message: the list that holds it, and its place in it; all topics are equally likely."""
        found = list(self.parts.messages())
        if not found:
            return None
        channels = sorted({parts[number].channel for parts, number in found})
        channel = self.one(channels)
        some = [(parts, number) for parts, number in found if parts[number].channel == channel]
        return some[self.below(len(some))]

    def near(self, own: int, extremes: Sequence[int]) -> int:
        """Another number: an extreme one, or one near the own."""
        if self.rng.random() < 0.5:
            return self.one(extremes)
        return self.one((own + 1, own - 1, own + 8, 2 * own, own // 2, own + self.below(300), own - self.below(300)))


def payload_number(rewriting: Rewriting, layout: str, new: Callable[[int], int | float], *, small: bool) -> None:
    """Change a number in a payload at a place where it can stand; ``small`` takes one that can be a length."""
    found = rewriting.message()
    if found is None:
        return
    parts, number = found
    payload = bytearray(parts[number].content[22:])
    width = struct.calcsize(layout)
    places = range(0, len(payload) - width + 1, 4)
    if small:
        fitting = [at for at in places if 0 < int.from_bytes(payload[at : at + 4], "little") <= len(payload)]
        places = fitting or places  # type: ignore[assignment]
    if not places:
        return
    at = rewriting.one(places)
    (own,) = struct.unpack_from(layout, payload, at)
    value = new(own)
    if isinstance(value, int):
        value %= 256**width
    struct.pack_into(layout, payload, at, value)
    parts[number] = parts[number].with_payload(bytes(payload))


def sequence_length(rewriting: Rewriting) -> None:
    """A length of a text or sequence in a payload."""
    payload_number(rewriting, "<I", lambda own: rewriting.near(own, LENGTHS), small=True)


def payload_value(rewriting: Rewriting) -> None:
    """A number in a payload, as a double or as four bytes."""
    if rewriting.rng.random() < 0.5:
        payload_number(rewriting, "<d", lambda _: NUMBERS[rewriting.below(len(NUMBERS))], small=False)
    else:
        payload_number(rewriting, "<I", lambda own: rewriting.near(own, LENGTHS), small=False)


def payload_size(rewriting: Rewriting) -> None:
    """A payload that is cut, or longer, or of another message."""
    found, other = rewriting.message(), rewriting.message()
    if found is None or other is None:
        return
    parts, number = found
    payload = parts[number].content[22:]
    cut = payload[: rewriting.below(len(payload) + 1)]
    longer = payload + rewriting.rng.bytes(rewriting.below(40))
    strange = other[0][other[1]].content[22:]
    parts[number] = parts[number].with_payload((cut, longer, strange, b"")[rewriting.below(4)])


def message_time(rewriting: Rewriting) -> None:
    """The time of receipt of a message, of those behind it, or of all of its topic."""
    found = rewriting.message()
    if found is None:
        return
    parts, number = found
    own = parts[number].log_time_ns
    new = rewriting.near(own, TIMES)
    many = rewriting.below(4)
    channel = parts[number].channel
    for some, place in list(rewriting.parts.messages()):
        one = some[place]
        if (
            many == 0
            or (many == 1 and one.channel == channel)
            or (many == 2 and some is parts and place >= number)
            or (some is parts and place == number)
        ):
            some[place] = one.with_time(new if many in {1, 3} else one.log_time_ns + new - own)


def record_length(rewriting: Rewriting) -> None:
    """The length that a record's head claims."""
    lists = rewriting.parts.lists()
    parts = lists[rewriting.below(len(lists))]
    part = parts[rewriting.below(len(parts))]
    if isinstance(part, Part):
        part.claims = rewriting.near(len(part.content), PLACES)


def index_entries(rewriting: Rewriting) -> None:
    """Entries of a chunk's message indexes: other places and times, one more, one fewer, none."""
    chunks = rewriting.parts.chunks()
    if not chunks:
        message_time(rewriting)
        return
    what = rewriting.below(7)

    def change(entries: dict[int, list[tuple[int, int]]]) -> None:
        if not entries:
            return
        channel, other = (rewriting.one(sorted(entries)) for _ in range(2))
        if what == 0:
            del entries[channel]
        elif what == 1:
            entries[channel], entries[other] = entries[other], entries[channel]
        else:
            _change_entry(rewriting, entries[channel], what)

    chunks[rewriting.below(len(chunks))].reindex = change


def _change_entry(rewriting: Rewriting, pairs: list[tuple[int, int]], what: int) -> None:
    """Change one entry, time and offset, of a message index that is not empty."""
    number = rewriting.below(len(pairs))
    t_ns, at = pairs[number]
    if what == 2:
        pairs[number] = t_ns, rewriting.near(at, PLACES)
    elif what == 3:
        pairs[number] = rewriting.near(t_ns, TIMES), at
    elif what == 4:
        del pairs[number]
    elif what == 5:
        pairs.insert(number, pairs[rewriting.below(len(pairs))])
    else:
        pairs[number] = t_ns, pairs[rewriting.below(len(pairs))][1]


def chunk_index(rewriting: Rewriting) -> None:
    """A chunk index of the summary: times, place, lengths, or the places of message indexes."""
    what, which = rewriting.below(1 << 30), rewriting.below(1 << 30)

    def change(fields: list[list[int]], places: list[dict[int, int]]) -> None:
        number = which % len(fields)
        field = what % 8
        if field < 5:
            fields[number][field] = rewriting.near(fields[number][field], TIMES if field < 2 else PLACES)
        elif field == 5 and places[number]:
            channel = rewriting.one(sorted(places[number]))
            places[number][channel] = rewriting.near(places[number][channel], PLACES)
        elif field == 6 and places[number]:
            del places[number][rewriting.one(sorted(places[number]))]
        else:
            other = rewriting.below(len(fields))
            fields[number], fields[other] = fields[other], fields[number]

    if rewriting.rng.random() < 0.2:
        rewriting.parts.moved = [rewriting.near(0, PLACES)]
    else:
        rewriting.parts.rechunk = change


def statistics(rewriting: Rewriting) -> None:
    """The count of a channel's messages in the statistics."""
    which = rewriting.below(1 << 30)

    def change(counts: dict[int, int]) -> None:
        channel = sorted(counts)[which % len(counts)] if counts else 0
        counts[channel] = rewriting.near(counts.get(channel, 0), LENGTHS)

    rewriting.parts.recount = change


def move_message(rewriting: Rewriting) -> None:
    """Remove a message, or write it again or elsewhere, or on another topic."""
    found, target = rewriting.message(), rewriting.message()
    if found is None or target is None:
        return
    (parts, number), (others, at) = found, target
    one = parts[number]
    match rewriting.below(4):
        case 0:
            del parts[number]
        case 1:
            others.insert(at, Part(one.code, one.content))
        case 2:
            others[at] = Part(MESSAGE, others[at].content[:2] + one.content[2:])
        case 3:
            others[at], parts[number] = Part(one.code, one.content), others[at]


def splice_records(rewriting: Rewriting) -> None:
    """Take over records of another log: messages, definitions, or a whole chunk."""
    other = taken_apart(rewriting.others[rewriting.below(len(rewriting.others))].data)
    mine = rewriting.parts.lists()
    parts = mine[rewriting.below(len(mine))]
    theirs = other.lists()
    source = [one for one in theirs[rewriting.below(len(theirs))] if isinstance(one, Part)]
    wanted = {MESSAGE} if rewriting.rng.random() < 0.5 else {MESSAGE, SCHEMA, CHANNEL}
    source = [one for one in source if one.code in wanted]
    first = rewriting.below(len(source))
    some = source[first : first + 1 + rewriting.below(20)]
    if other.chunks() and rewriting.parts.chunks() and rewriting.rng.random() < 0.4:
        chunk = other.chunks()[rewriting.below(len(other.chunks()))]
        rewriting.parts.data.insert(1 + rewriting.below(len(rewriting.parts.data)), chunk)
    else:
        place = 1 + rewriting.below(len(parts))
        parts[place:place] = some


def reorder(rewriting: Rewriting) -> None:
    """Move, double or drop a whole chunk, or a record of the data section."""
    data = rewriting.parts.data
    if len(data) < 3:
        return
    at, to = 1 + rewriting.below(len(data) - 1), 1 + rewriting.below(len(data) - 1)
    match rewriting.below(3):
        case 0:
            data.insert(to, data.pop(at))
        case 1:
            data.insert(to, data[at])
        case 2:
            del data[at]


def recompress(rewriting: Rewriting) -> None:
    """Another compression of a chunk, or another size that its head claims."""
    chunks = rewriting.parts.chunks()
    if not chunks:
        reorder(rewriting)
        return
    chunk = chunks[rewriting.below(len(chunks))]
    chunk.compression = COMPRESSIONS[rewriting.below(3)]
    if rewriting.rng.random() < 0.4:
        size = len(chunk.raw)
        chunk.oversized = rewriting.near(size, (*LENGTHS, *PLACES)) - size
        chunk.checked &= rewriting.rng.random() < 0.5


def redefine(rewriting: Rewriting) -> None:
    """Letters or lengths in the text of a schema or channel, wherever it is defined."""
    everywhere = [*rewriting.parts.lists(), rewriting.parts.summary]
    found = [(parts, k) for parts in everywhere for k, one in enumerate(parts) if one.code in {SCHEMA, CHANNEL}]
    if not found:
        return
    parts, number = found[rewriting.below(len(found))]
    old = parts[number].content
    new = bytearray(old)
    at = 2 + rewriting.below(len(new) - 2)
    digits = [k for k, letter in enumerate(new) if letter in b"0123456789[]"]
    if digits and rewriting.rng.random() < 0.6:
        at = rewriting.one(digits)
    new[at] = rewriting.one(b"0123456789[]\n #=/_aez\0\xff")
    for some in everywhere if rewriting.rng.random() < 0.7 else [parts]:
        some[:] = [Part(one.code, bytes(new)) if one.content == old and one.code != MESSAGE else one for one in some]


STRUCTURED: tuple[Callable[[Rewriting], None], ...] = (
    *(sequence_length, sequence_length, payload_value, payload_size, message_time, message_time, record_length),
    *(index_entries, index_entries, chunk_index, statistics, move_message, splice_records, reorder, recompress),
    redefine,
)


def rewritten(
    log: IntactLog, others: Sequence[IntactLog], rng: Generator, count: int
) -> tuple[bytes, bytes, list[str]]:
    """The bytes of a log after some mutations, its records without compression, and the names of the mutations.

    Args:
        log: The log.
        others: Logs of which parts can be taken over.
        rng: Makes all choices.
        count: Number of mutations.
    """
    rewriting = Rewriting(taken_apart(log.data), log, others, rng)
    done = []
    for _ in range(count):
        mutation = STRUCTURED[rewriting.below(len(STRUCTURED))]
        mutation(rewriting)
        done.append(mutation.__name__)
    records = b"".join(chunk.raw for chunk in rewriting.parts.chunks())
    return rewriting.parts.stored(), records, done
