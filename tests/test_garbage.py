"""Bytes that changed: everything before and behind them is read, and what is lost or doubtful is said."""

import struct
import time

import log_factory as forge
import lz4.frame
import numpy as np
import pytest
import strict_log
import zstandard
from log_factory import START_NS
from minute_log import BEHIND, CHANNELS, CUT, Log, body, check, fewest, lost_in, overwritten, sound, unpacked

from navirl_cli.logs.messages.reader import read

TOPICS = {channel: topic for topic, channel in CHANNELS.items()}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "minute.mcap"


def noise(count: int) -> bytes:
    """Bytes of which the first is no record's code."""
    return b"\x55" + np.random.default_rng(count).bytes(count - 1)


def behind(log: Log, at: int) -> int:
    """Where the first record starts behind a byte: a message that is not compressed, or a chunk."""
    starts = [record.start for record in log.strict.records if record.code == strict_log.CHUNK]
    starts += [body(log, told).start for told in log.strict.messages]
    return min(start for start in starts if start > at)


def hidden(log: Log) -> Log:
    """The same file without its last bytes, hence without a summary, but with message indexes."""
    bare = Log.__new__(Log)
    bare.__dict__.update(log.__dict__, data=log.data[:-20])
    return bare


def ending(log: Log) -> tuple:
    """The note on the last bytes."""
    (end,) = [one.start for one in log.strict.records if one.code == strict_log.DATA_END]
    return end, len(log.data), None, "the file ends inside its closing records; no message is lost"


@pytest.mark.parametrize("way", ["zstd", "zstd, no summary", "lz4", "cut zstd"])
def test_garbage_over_the_head_of_a_compressed_chunk(path, way):
    log = hidden(sound("zstd")) if way == "cut zstd" else sound(way)
    number = fewest(log)
    chunk = log.chunks[number]
    kept = log.without(log.inside(number))
    data = overwritten(log, chunk.start, noise(64))
    if way in {"zstd", "lz4"}:
        # the summary knows where it stands, and its message indexes what is lost
        reason = rf"the chunk's head does not parse \(.*\); {lost_in(log, number, way)}"
        check(path, data, kept, (chunk.start, log.end(number), log.span(number), reason))
        return
    following = log.chunks[number + 1].start
    span = log.latest_s(chunk.start), log.span(number + 1)[0]
    reason = rf"no record starts here \(code 0x55\); {following - chunk.start} bytes are lost"
    check(path, data, kept, (chunk.start, following, span, reason), *([ending(log)] if way == "cut zstd" else []))


@pytest.mark.parametrize("way", ["unchecked", "unchecked, no summary"])
def test_garbage_over_the_head_of_a_chunk_that_is_not_compressed(path, way):
    """Its messages stand there as if there were no chunk."""
    log = sound(way)
    number = fewest(log)
    chunk = log.chunks[number]
    data = overwritten(log, chunk.start, noise(64))
    following = behind(log, chunk.start + 64)
    lost = [told for told in log.inside(number) if body(log, told).start < following]
    assert len(lost) <= 1
    first = next(told for told in log.strict.messages if body(log, told).start == following)
    assert first.chunk == chunk
    span = log.latest_s(chunk.start), (first.log_time_ns - START_NS) / 1e9
    reason = rf"no record starts here \(code 0x55\); {following - chunk.start} bytes are lost"
    notes = [(chunk.start, following, span, reason)]
    if lost and way == "unchecked":
        topic, count = TOPICS[lost[0].channel], sum(told.channel == lost[0].channel for told in log.wanted)
        counted = f"{count} messages of {topic} promised by the statistics, {count - 1} are there"
        notes.append((0, len(data), None, counted))
    check(path, data, log.without(lost), *notes)


def test_garbage_over_a_message_index(path):
    """What the summary does not need is not missed; without it the walk goes on behind."""
    log = sound("zstd")
    number = fewest(log)
    stop = log.chunks[number].stop
    check(path, overwritten(log, stop, noise(64)), log.wanted)
    bare = hidden(log)
    following = log.chunks[number + 1].start
    span = log.span(number)[1], log.span(number + 1)[0]
    reason = rf"no record starts here \(code 0x55\); {following - stop} bytes are lost"
    check(path, overwritten(bare, stop, noise(64)), log.wanted, (stop, following, span, reason), ending(bare))


def test_garbage_over_a_message_that_stands_alone(path):
    log = sound("unchunked, no summary")
    told = log.wanted[20_000]
    following = behind(log, told.place.start + 64)
    after = next(one for one in log.strict.messages if one.place.start == following)
    span = log.latest_s(told.place.start), (after.log_time_ns - START_NS) / 1e9
    reason = rf"no record starts here \(code 0x55\); {following - told.place.start} bytes are lost"
    data = overwritten(log, told.place.start, noise(64))
    check(path, data, log.without([told]), (told.place.start, following, span, reason))


@pytest.mark.parametrize("way", ["unchecked", "unchecked, no summary"])
def test_garbage_over_a_messages_length_in_a_chunk(path, way):
    log = sound(way)
    told = log.inside(fewest(log))[200]
    number = log.chunks.index(told.chunk)
    length = strict_log.chunk_head(log.data[told.chunk.inside])[0]
    reason = (
        f"no record starts at byte {told.place.start} of {length} of the uncompressed chunk; what stands up to byte "
        f"{told.place.stop} was read by its message index, or is lost"
    )
    data = overwritten(log, body(log, told).start + 1, noise(8))
    topic = TOPICS[told.channel]
    count = sum(one.channel == told.channel for one in log.inside(number))
    counted = f"{count} messages of {topic} in the chunk's message index, {count - 1} are there"
    reasons = [reason] if "no summary" in way else [reason, counted]
    place = told.chunk.start, log.end(number), log.span(number)
    check(path, data, log.without([told]), *((*place, words) for words in reasons))


@pytest.mark.parametrize("way", ["zstd", "zstd, no summary", "unchecked", "unchecked, no summary"])
@pytest.mark.parametrize("wrong", [-1000, -1, 1, 1000, 2**40])
def test_a_wrong_chunk_length_is_put_right_by_the_chunks_own_head(path, way, wrong):
    log = sound(way)
    chunk = log.chunks[fewest(log)]
    length = chunk.stop - chunk.start - 9 + wrong
    check(path, overwritten(log, chunk.start + 1, struct.pack("<Q", length)), log.wanted)


def test_a_wrong_crc_of_the_data(path):
    log = sound("unchunked")
    (end,) = [one.start for one in log.strict.records if one.code == strict_log.DATA_END]
    (crc,) = struct.unpack_from("<I", log.data, end + 9)
    reason = (
        rf"the CRC of the data section is 0x[0-9a-f]{{8}}, expected {crc:#010x}: bytes have changed, and a message "
        "that reads well may be wrong"
    )
    image = next(told for told in log.strict.messages[15_000:] if len(told.whole) > 10_000)
    data = overwritten(log, image.place.start + 5_000, b"changed")
    check(path, data, log.wanted, (0, end, None, reason))


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
@pytest.mark.parametrize("way", ["zstd", "unchecked, no summary", "unchunked"])
def test_compressed_as_a_whole_and_cut_at_60_per_cent(path, kind, way):
    log = sound(way)
    packed = zstandard.compress(log.data) if kind == "zstd" else lz4.frame.compress(log.data)
    packed = packed[: len(packed) * 6 // 10]
    size = len(unpacked(kind, packed))
    assert 0.55 < size / len(log.data) < 0.65
    record = next(one for one in log.strict.records if one.stop > size)
    number = log.chunks.index(record) if record in log.chunks else None
    left = record.stop - size
    inside = rf"the file ends inside a record \(code {record.code:#04x}\), {left} bytes before its end; {BEHIND}"
    span = (log.latest_s(size), None) if number is None else log.span(number)
    if number is not None:
        there = f"{size - record.start - 9} of {record.stop - record.start - 9} bytes are there"
        inside = rf"the file ends inside a chunk \({there}\); {CUT}"
    outside = f"the {kind} compression is cut; what stood behind is lost, what stands before is read"
    notes = (record.start, size, span, inside), (cut_block(kind, packed), len(packed), None, outside)
    check(path, packed, log.before(size), *sorted(notes, key=lambda note: note[0]))


def cut_block(kind: str, packed: bytes) -> int:
    """Where the block starts that a cut goes through."""
    at = zstandard.frame_header_size(packed) if kind == "zstd" else 15
    while True:
        if kind == "zstd":
            mark = int.from_bytes(packed[at : at + 3], "little")
            following = at + 3 + (1 if mark >> 1 & 3 == 1 else mark >> 3)
        else:
            following = at + 4 + (int.from_bytes(packed[at : at + 4], "little") & 0x7FFFFFFF)
        if following > len(packed):
            return at
        at = following


@pytest.mark.parametrize("way", ["uncompressed chunks", "no summary, no chunks"])
def test_many_holes_take_no_longer_than_they_must(tmp_path, way):
    """Every third record is spoilt; behind each a megabyte would be searched."""
    path = forge.forge(tmp_path / "run.mcap", forge.run(3000), **{**forge.WAYS[way], "chunk_size": 1 << 20})
    log = Log(path)
    data = bytearray(log.data)
    for told in log.strict.messages[3::3]:
        data[body(log, told).start] = 0x55
    path.write_bytes(data)
    begun = time.perf_counter()
    result = read(path, {"/wrench": ("header.stamp",)})
    assert time.perf_counter() - begun < 10
    spoilt = {id(told) for told in log.strict.messages[3::3]}
    kept = [told.log_time_ns for told in log.strict.of("/wrench") if id(told) not in spoilt]
    assert result.series["/wrench"].log_time_ns.tolist() == kept
    assert len(result.damage) >= len(spoilt)
