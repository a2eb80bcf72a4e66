"""Bytes that changed: everything before and after them is read, and what is lost or doubtful is reported."""

import struct

import log_factory as forge
import lz4.frame
import numpy as np
import pytest
import strict_log
import zstandard
from log_factory import START_NS
from minute_log import BEHIND, CHANNELS, CUT, Log, body, check, decompressed, fewest, intact, lost_in, overwritten

from navirl_cli.logs.container import resync
from navirl_cli.logs.messages.reader import read

TOPICS = {channel: topic for topic, channel in CHANNELS.items()}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "minute.mcap"


def noise(count: int) -> bytes:
    """Random bytes, of which the first is not the code of a record."""
    return b"\x55" + np.random.default_rng(count).bytes(count - 1)


def next_record(log: Log, at: int) -> int:
    """Where the next chunk or uncompressed message after a byte starts."""
    starts = [record.start for record in log.strict.records if record.code == strict_log.CHUNK]
    starts += [body(log, message).start for message in log.strict.messages]
    return min(start for start in starts if start > at)


def without_summary(log: Log) -> Log:
    """The same file without its last bytes: the summary is lost, the message indexes are not."""
    bare = Log.__new__(Log)
    bare.__dict__.update(log.__dict__, data=log.data[:-20])
    return bare


def ending(log: Log) -> tuple:
    """The damage of the last bytes."""
    (end,) = [one.start for one in log.strict.records if one.code == strict_log.DATA_END]
    return end, len(log.data), None, "the file ends inside its closing records; no message is lost"


@pytest.mark.parametrize("variant", ["zstd", "zstd, no summary", "lz4", "cut zstd"])
def test_garbage_over_the_head_of_a_compressed_chunk(path, variant):
    log = without_summary(intact("zstd")) if variant == "cut zstd" else intact(variant)
    number = fewest(log)
    chunk = log.chunks[number]
    kept = log.without(log.inside(number))
    data = overwritten(log, chunk.start, noise(64))
    if variant in {"zstd", "lz4"}:
        # the summary says where the chunk stands, and its message indexes what is lost
        reason = rf"the chunk's header does not parse \(.*\); {lost_in(log, number, variant)}"
        check(path, data, kept, (chunk.start, log.end(number), log.span(number), reason))
        return
    following = log.chunks[number + 1].start
    span = log.latest_s(chunk.start), log.span(number + 1)[0]
    reason = rf"no record starts here \(code 0x55\); {following - chunk.start} bytes are lost"
    check(path, data, kept, (chunk.start, following, span, reason), *([ending(log)] if variant == "cut zstd" else []))


@pytest.mark.parametrize("variant", ["unchecked", "unchecked, no summary"])
def test_garbage_over_the_head_of_a_chunk_that_is_not_compressed(path, variant):
    """Its messages are read as if they stood outside of a chunk."""
    log = intact(variant)
    number = fewest(log)
    chunk = log.chunks[number]
    data = overwritten(log, chunk.start, noise(64))
    following = next_record(log, chunk.start + 64)
    lost = [message for message in log.inside(number) if body(log, message).start < following]
    assert len(lost) <= 1
    first = next(message for message in log.strict.messages if body(log, message).start == following)
    assert first.chunk == chunk
    span = log.latest_s(chunk.start), (first.log_time_ns - START_NS) / 1e9
    reason = rf"no record starts here \(code 0x55\); {following - chunk.start} bytes are lost"
    damages = [(chunk.start, following, span, reason)]
    if lost and variant == "unchecked":
        topic, count = TOPICS[lost[0].channel], sum(message.channel == lost[0].channel for message in log.wanted)
        counted = f"the statistics count {count} messages of {topic}, {count - 1} were found"
        damages.append((0, len(data), None, counted))
    check(path, data, log.without(lost), *damages)


def test_garbage_over_a_message_index(path):
    """With a summary the index is not needed; without one, the walk goes on after it."""
    log = intact("zstd")
    number = fewest(log)
    stop = log.chunks[number].stop
    check(path, overwritten(log, stop, noise(64)), log.wanted)
    bare = without_summary(log)
    following = log.chunks[number + 1].start
    span = log.span(number)[1], log.span(number + 1)[0]
    reason = rf"no record starts here \(code 0x55\); {following - stop} bytes are lost"
    check(path, overwritten(bare, stop, noise(64)), log.wanted, (stop, following, span, reason), ending(bare))


def test_garbage_over_a_message_outside_of_chunks(path):
    log = intact("unchunked, no summary")
    message = log.wanted[20_000]
    following = next_record(log, message.place.start + 64)
    after = next(one for one in log.strict.messages if one.place.start == following)
    span = log.latest_s(message.place.start), (after.log_time_ns - START_NS) / 1e9
    reason = rf"no record starts here \(code 0x55\); {following - message.place.start} bytes are lost"
    data = overwritten(log, message.place.start, noise(64))
    check(path, data, log.without([message]), (message.place.start, following, span, reason))


@pytest.mark.parametrize("variant", ["unchecked", "unchecked, no summary"])
def test_garbage_over_a_messages_length_in_a_chunk(path, variant):
    log = intact(variant)
    message = log.inside(fewest(log))[200]
    number = log.chunks.index(message.chunk)
    length = strict_log.chunk_head(log.data[message.chunk.contents])[0]
    reason = (
        f"no record starts at byte {message.place.start} of {length} of the uncompressed chunk; messages up to byte "
        f"{message.place.stop} were read by the message index, or are lost"
    )
    data = overwritten(log, body(log, message).start + 1, noise(8))
    topic = TOPICS[message.channel]
    count = sum(one.channel == message.channel for one in log.inside(number))
    counted = f"the chunk's message index lists {count} messages of {topic}, {count - 1} were found"
    reasons = [reason] if "no summary" in variant else [reason, counted]
    place = message.chunk.start, log.end(number), log.span(number)
    check(path, data, log.without([message]), *((*place, reason) for reason in reasons))


@pytest.mark.parametrize(
    ("variant", "wrong"),
    [
        # each length of two files that differ in all, both signs of the others
        pytest.param(
            variant,
            wrong,
            marks=[] if variant in {"zstd, no summary", "unchecked"} or abs(wrong) == 1 else pytest.mark.slow,
        )
        for variant in ("zstd", "zstd, no summary", "unchecked", "unchecked, no summary")
        for wrong in (-1000, -1, 1, 1000, 2**40)
    ],
)
def test_a_wrong_chunk_length_is_corrected_by_the_chunks_own_head(path, variant, wrong):
    log = intact(variant)
    chunk = log.chunks[fewest(log)]
    right = chunk.stop - chunk.start - 9
    data = overwritten(log, chunk.start + 1, struct.pack("<Q", right + wrong))
    reason = f"a chunk record gives its length as {right + wrong} bytes, expected {right} by its header; it was read by its header"  # noqa: E501
    # with a summary nobody needs the length
    span = log.span(fewest(log))
    check(path, data, log.wanted, *[(chunk.start, chunk.start + 9, span, reason)] * ("no summary" in variant))


def test_a_wrong_crc_of_the_data(path):
    log = intact("unchunked")
    (end,) = [one.start for one in log.strict.records if one.code == strict_log.DATA_END]
    (crc,) = struct.unpack_from("<I", log.data, end + 9)
    reason = (
        rf"the CRC of the data section is 0x[0-9a-f]{{8}}, expected {crc:#010x}: some bytes have changed, so values "
        "that look valid may be wrong"
    )
    image = next(message for message in log.strict.messages[15_000:] if len(message.record) > 10_000)
    data = overwritten(log, image.place.start + 5_000, b"changed")
    check(path, data, log.wanted, (0, end, None, reason))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize("variant", ["zstd", "unchecked, no summary", "unchunked"])
def test_a_compressed_file_cut_at_60_per_cent(path, compression, variant):
    log = intact(variant)
    stored = zstandard.compress(log.data) if compression == "zstd" else lz4.frame.compress(log.data)
    stored = stored[: len(stored) * 6 // 10]
    size = len(decompressed(compression, stored))
    assert 0.55 < size / len(log.data) < 0.65
    record = next(one for one in log.strict.records if one.stop > size)
    number = log.chunks.index(record) if record in log.chunks else None
    left = record.stop - size
    inside = rf"the file ends inside a record \(code {record.code:#04x}\), {left} bytes before its end; {BEHIND}"
    span = (log.latest_s(size), None) if number is None else log.span(number)
    if number is not None:
        there = f"{size - record.start - 9} of {record.stop - record.start - 9} bytes are there"
        inside = rf"the file ends inside a chunk \({there}\); {CUT}"
    outside = f"the {compression} data are cut off; everything before was read, the rest is lost"
    damages = (record.start, size, span, inside), (cut_block(compression, stored), len(stored), None, outside)
    check(path, stored, log.before(size), *sorted(damages, key=lambda damage: damage[0]))


def cut_block(compression: str, stored: bytes) -> int:
    """Where the block starts that is cut."""
    at = zstandard.frame_header_size(stored) if compression == "zstd" else 15
    while True:
        if compression == "zstd":
            mark = int.from_bytes(stored[at : at + 3], "little")
            following = at + 3 + (1 if mark >> 1 & 3 == 1 else mark >> 3)
        else:
            following = at + 4 + (int.from_bytes(stored[at : at + 4], "little") & 0x7FFFFFFF)
        if following > len(stored):
            return at
        at = following


@pytest.mark.parametrize("variant", ["uncompressed chunks", "no summary, no chunks"])
def test_little_is_searched_behind_each_of_many_gaps(tmp_path, monkeypatch, variant):
    """Every third record is damaged; to search up to a megabyte behind each would take hundreds of times the file."""
    searched = []
    candidates = resync._candidates
    monkeypatch.setattr(resync, "_candidates", lambda block: searched.append(len(block)) or candidates(block))
    path = forge.forge(tmp_path / "run.mcap", forge.run(3000), **{**forge.WAYS[variant], "chunk_size": 1 << 20})
    log = Log(path)
    data = bytearray(log.data)
    for message in log.strict.messages[3::3]:
        data[body(log, message).start] = 0x55
    path.write_bytes(data)
    result = read(path, {"/wrench": ("header.stamp",)})
    assert sum(searched) < 20 * len(data)
    damaged = {id(message) for message in log.strict.messages[3::3]}
    kept = [message.log_time_ns for message in log.strict.of("/wrench") if id(message) not in damaged]
    assert result.series["/wrench"].log_time_ns.tolist() == kept
    assert len(result.damage) >= len(damaged)
