"""Damage of every form: what is still read of a minute of log, bit by bit, and what is reported."""

import io
import re

import pytest
import strict_log
from mcap.reader import NonSeekingReader
from minute_log import (
    ALL,
    BEHIND,
    CHANNELS,
    CUT,
    OPTIONS,
    TRUTH,
    WANTS,
    body,
    check,
    fewest,
    intact,
    lost_in,
    overwritten,
)

from navirl_cli.errors import LogError
from navirl_cli.logs.container.damage import Damage, DamageList
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import message_times, read, scan

S = 1_000_000_000
ZEROS = rf"zero bytes where a record should start \(power or disk failure\); {BEHIND}"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "minute.mcap"


def test_the_twin_reads_as_mcap_does():
    log = intact("zstd")
    assert len(log.wanted) == ALL
    assert all(log.strict.channels[number][1] == topic for topic, number in CHANNELS.items())
    assert 58 <= len(log.chunks) <= 62
    messages = NonSeekingReader(io.BytesIO(log.data)).iter_messages(topics=list(TRUTH), log_time_order=False)
    assert [(message.log_time, message.data) for _, _, message in messages] == [
        (message.log_time_ns, message.payload) for message in log.wanted
    ]


@pytest.mark.parametrize("variant", OPTIONS)
def test_an_intact_file_is_read_without_damage(path, variant):
    check(path, intact(variant).data, intact(variant).wanted)


@pytest.mark.parametrize("variant", ["zstd", "zstd, no summary", "lz4", "unchecked", "unchecked, no summary"])
def test_cut_in_a_chunk(path, variant):
    log = intact(variant)
    cut = log.cut_behind(20_022)
    number = log.chunk_of(20_022)
    chunk = log.chunks[number]
    kept = log.before(cut)
    assert 20_022 <= len(kept) < ALL
    assert len(kept) > log.wanted.index(log.inside(number)[0]) + 100
    there, size = cut - chunk.start - 9, chunk.stop - chunk.start - 9
    reason = rf"the file ends inside a chunk \({there} of {size} bytes are there\); {CUT}"
    check(path, log.data[:cut], kept, (chunk.start, cut, log.span(number), reason))


@pytest.mark.parametrize("variant", ["zstd", "unchecked"])
def test_cut_in_an_index_record(path, variant):
    log = intact(variant)
    number = log.chunk_of(20_242)
    chunk = log.chunks[number]
    cut = chunk.stop + 15
    kept = log.before(cut)
    assert len(kept) >= 20_242
    index = next(record for record in log.strict.records if record.start == chunk.stop)
    reason = rf"the file ends inside a record \(code 0x07\), {index.stop - cut} bytes before its end; {BEHIND}"
    check(path, log.data[:cut], kept, (chunk.stop, cut, (log.latest_s(cut), None), reason))


@pytest.mark.parametrize("variant", OPTIONS)
def test_the_last_bytes_are_lost(path, variant):
    log = intact(variant)
    data = log.data[:-20]
    end = next(record for record in log.strict.records if record.code == strict_log.DATA_END)
    check(
        path,
        data,
        log.wanted,
        (end.start, len(data), None, "the file ends inside its closing records; no message is lost"),
    )


@pytest.mark.parametrize("variant", ["zstd", "zstd, no summary", "unchecked"])
def test_a_tail_of_zeros(path, variant):
    log = intact(variant)
    number = log.chunk_of(19_692) + 1
    chunk, size = log.chunks[number], len(log.data)
    kept = log.before(chunk.start)
    assert len(kept) >= 19_692
    note = chunk.start, size, (log.latest_s(chunk.start), None), ZEROS
    check(path, log.data[: chunk.start] + bytes(size - chunk.start), kept, note)


@pytest.mark.parametrize("variant", ["zstd", "zstd, no summary", "lz4"])
def test_zeros_from_within_a_chunk_that_is_compressed(path, variant):
    """Nothing of a chunk that does not decompress can be trusted."""
    log = intact(variant)
    number = log.chunk_of(19_692) + 1
    chunk, size = log.chunks[number], len(log.data)
    kept = log.before(chunk.start)
    assert len(kept) >= 19_692
    check(
        path,
        log.data[: chunk.start + 200_000].ljust(size, b"\0"),
        kept,
        (
            *chunk[1:],
            log.span(number),
            r"the chunk does not decompress \((zstd|lz4): .*\); messages lost: an unknown number",
        ),
        (chunk.stop, size, (log.span(number)[1], None), ZEROS),
    )


@pytest.mark.parametrize("variant", ["unchecked", "unchecked, no summary"])
def test_zeros_from_within_a_chunk_that_is_not_compressed(path, variant):
    log = intact(variant)
    number = log.chunk_of(20_000)
    chunk, size, first = log.chunks[number], len(log.data), log.wanted[20_000]
    last = log.strict.messages[log.strict.messages.index(first) - 1]
    length = last.place.stop + chunk.stop - body(log, last).stop
    reason = (
        f"no record starts at byte {first.place.start} of {length} of the uncompressed chunk; messages up to byte "
        f"{length} were read by the message index, or are lost"
    )
    check(
        path,
        log.data[: body(log, first).start].ljust(size, b"\0"),
        log.wanted[:20_000],
        (*chunk[1:], log.span(number), reason),
        (chunk.stop, size, (log.span(number)[1], None), ZEROS),
    )


@pytest.mark.parametrize("variant", ["zstd", "zstd, no summary"])
def test_a_bad_chunk_in_the_middle(path, variant):
    log = intact(variant)
    number = fewest(log)
    chunk = log.chunks[number]
    kept = log.without(log.inside(number))
    assert len(kept) >= 32_450
    data = overwritten(log, chunk.start + 50_000, b"\xff" * 150_000)
    reason = rf"the chunk does not decompress \(zstd: .*\); {lost_in(log, number, variant)}"
    check(path, data, kept, (chunk.start, log.end(number), log.span(number), reason))


@pytest.mark.parametrize("variant", ["zstd", "zstd, no summary", "lz4"])
def test_a_wrong_chunk_crc(path, variant):
    log = intact(variant)
    number = fewest(log)
    chunk = log.chunks[number]
    crc = strict_log.chunk_head(log.data[chunk.contents])[1]
    data = overwritten(log, chunk.start + 9 + 24, b"\1\2\3\4")
    reason = rf"the chunk's CRC is {crc:#010x}, expected 0x04030201; {lost_in(log, number, variant)}"
    kept = log.without(log.inside(number))
    assert len(kept) >= 32_450
    check(path, data, kept, (chunk.start, log.end(number), log.span(number), reason))


@pytest.mark.parametrize("variant", ["unchunked", "unchunked, no summary"])
def test_unchunked_and_cut_at_60_per_cent(path, variant):
    log = intact(variant)
    cut = log.wanted[19_802].place.start + 50
    assert cut / len(log.data) == pytest.approx(0.6, abs=0.002)
    kept = log.before(cut)
    assert len(kept) == 19_802
    record = log.wanted[19_802].place
    reason = rf"the file ends inside a record \(code 0x05\), {record.stop - cut} bytes before its end; {BEHIND}"
    check(path, log.data[:cut], kept, (record.start, cut, (log.latest_s(cut), None), reason))


def test_no_message_index(path):
    check(path, intact("no message index").data, intact("no message index").wanted)
    assert not intact("no message index").strict.indexed


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (0, "expected an MCAP file, found an empty file; record or copy it again"),
        (5, "expected an MCAP file, found only its first 5 bytes; nothing was recorded: record or copy it again"),
        (8, r"expected an MCAP header after the magic, found the end of the file \(8 bytes\); nothing was recorded"),
        (
            12,
            "expected a header record after the magic, found the end of the file after 12 bytes; nothing was recorded",
        ),
        (
            20,
            "expected a header record after the magic, found the end of the file after 20 bytes; nothing was recorded",
        ),
    ],
)
@pytest.mark.parametrize("use", [scan, message_times, lambda path: read(path, WANTS), load_recording])
def test_only_the_magic_or_cut_in_the_header(path, size, message, use):
    path.write_bytes(intact("zstd").data[:size])
    with pytest.raises(LogError, match=f"^{re.escape(str(path))}: {message}"):
        use(path)


def test_nothing_but_the_header(path):
    path.write_bytes(intact("zstd").data[: intact("zstd").chunks[0].start])
    (note,) = scan(path).damage
    assert note.reason == "the file ends without its closing records; everything in it was read"
    with pytest.raises(LogError, match=r"minute.mcap: holds no messages: the file ends before the first one; copy it"):
        load_recording(path)


# --- the list of damage


def test_damage_is_dated_from_the_files_first_message_wherever_that_stands(path):
    damage = DamageList(path)
    damage.add_gap(0, 10, "before any message")
    damage.add(20, 30, "a chunk", (5 * S, 6 * S))
    damage.met((4 * S, 7 * S))
    damage.add_gap(40, 50, "between")
    damage.met(None)
    damage.met((9 * S, 10 * S))
    damage.add_gap(60, 70, "the rest")
    damage.add(80, 80, "no time")
    expected = [(0.0, 0.0), (1.0, 2.0), (3.0, 5.0), (6.0, None), None]
    assert [one.span_s for one in damage.in_order()] == expected
    # the earliest message stands behind the others: the last gap ends before it begins
    damage.met((1 * S, 2 * S))
    moved = [(3.0, 3.0), (4.0, 5.0), (6.0, 8.0), (9.0, 9.0), None]
    assert [one.span_s for one in damage.in_order()] == moved


def test_damage_is_listed_once_and_by_place(path):
    known = Damage(path, 50, 60, "the zstd data are cut off")
    damage = DamageList(path, [known])
    damage.add(70, 80, "found first", (0, None))
    damage.add(10, 20, "found later", (1_500_000_000, 2_000_000_000))
    damage.add(10, 20, "found later", (1_500_000_000, 2_000_000_000))
    first, second, third = damage.in_order()
    assert str(first) == f"{path}: bytes 10 to 20 (0.00 s to 0.50 s): found later"
    assert second == known
    assert str(third) == f"{path}: bytes 70 to 80 (0.00 s to its end): found first"
