"""Damaged files: what is still read, and what is reported."""

import re
import struct
from itertools import pairwise

import log_factory as forge
import pytest
from damaged_log import FIELDS, damaged, wrenches_before
from mcap.writer import CompressionType

from navirl_cli.logs.container import records
from navirl_cli.logs.container.log_file import LogFile
from navirl_cli.logs.messages.reader import read, scan


@pytest.fixture
def run(tmp_path):
    return forge.forge(tmp_path / "run.mcap", forge.run())


def test_cut_in_a_chunk_of_incompressible_blocks(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), compression=CompressionType.NONE)
    (start, size), before = forge.chunk_starts(path)[4], wrenches_before(path, 4)
    partly = forge.messages_in_chunk(path, 4, "/wrench")
    forge.cut(path, start + size // 2)
    count = len(read(path, {"/wrench": FIELDS}).series["/wrench"])
    assert before < count < before + partly
    (damage,) = damaged(path, slice(count))
    assert re.search(rf"bytes {start} to {start + size // 2} \(\d.* s\): the file ends inside a chunk", damage)
    assert "messages before the cut were read, those after it are lost" in damage


@pytest.mark.parametrize("variant", ["zstd", "lz4"])
def test_cut_in_a_compressed_chunk_gives_its_start(tmp_path, variant):
    # large enough for several blocks in one compressed frame
    path = forge.forge(tmp_path / "run.mcap", forge.run(6000), chunk_size=1 << 20, **forge.WAYS[variant])
    start, size = forge.chunk_starts(path)[0]
    forge.cut(path, start + size * 3 // 4)
    result = read(path, {"/wrench": FIELDS})
    count = len(result.series["/wrench"])
    assert 1000 < count < 6000
    assert result.series["/wrench"].log_time_ns.tolist() == [forge.START_NS + k * 2_000_000 for k in range(count)]
    assert "the file ends inside a chunk" in result.damage[0].reason


def test_cut_in_a_chunks_head_and_in_a_records_head(run):
    start, _ = forge.chunk_starts(run)[3]
    count = wrenches_before(run, 3)
    assert "the file ends inside a chunk's header" in damaged(forge.cut(run, start + 20), slice(count))[0]
    assert "the file ends inside a record" in damaged(forge.cut(run, start + 4), slice(count))[0]
    (damage,) = damaged(forge.cut(run, start), slice(count))
    assert "the file ends without its closing records; everything in it was read" in damage


def test_cut_in_an_index_record(run):
    start, size = forge.chunk_starts(run)[3]
    count = wrenches_before(run, 4)
    (damage,) = damaged(forge.cut(run, start + size + 12), slice(count))
    assert "the file ends inside a record (code 0x07)" in damage


def test_the_last_bytes_lost(run):
    (damage,) = damaged(forge.cut(run, -20), slice(None))
    assert "the file ends inside its closing records; no message is lost" in damage


def test_a_tail_of_zeros(run):
    start, _ = forge.chunk_starts(run)[5]
    count = wrenches_before(run, 5)
    size = run.stat().st_size
    (damage,) = damaged(forge.overwrite(run, start, bytes(size - start)), slice(count))
    assert re.search(rf"bytes {start} to {size} \(\d.* s to its end\): zero bytes where a record should start", damage)


def test_a_bad_chunk_in_the_middle_is_skipped(run):
    start, size = forge.chunk_starts(run)[3]
    before, lost = wrenches_before(run, 3), forge.messages_in_chunk(run, 3, "/wrench")
    forge.overwrite(run, start + size // 2, b"\xff" * 40)
    (damage,) = damaged(run, [*range(before), *range(before + lost, 600)])
    assert f"messages lost: {lost} of /wrench" in damage


def test_a_wrong_crc_is_reported_and_the_chunk_skipped(run):
    start, _ = forge.chunk_starts(run)[2]
    before, lost = wrenches_before(run, 2), forge.messages_in_chunk(run, 2, "/wrench")
    forge.overwrite(run, start + records.HEAD_SIZE + 24, b"\1\2\3\4")
    (damage,) = damaged(run, [*range(before), *range(before + lost, 600)])
    assert ", expected 0x04030201; messages lost: " in damage
    assert "the chunk's CRC is 0x" in damage


def test_a_bad_chunk_without_an_index_is_skipped_too(run):
    start, size = forge.chunk_starts(run)[3]
    before, lost = wrenches_before(run, 3), forge.messages_in_chunk(run, 3, "/wrench")
    forge.overwrite(run, start + size // 2, b"\xff" * 40)
    forge.cut(run, -20)
    first, last = damaged(run, [*range(before), *range(before + lost, 600)])
    assert f"messages lost: {lost} of /wrench" in first
    assert "closing records" in last


def test_unchunked_and_cut(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), use_chunking=False)
    size = path.stat().st_size
    forge.cut(path, size * 6 // 10)
    count = len(read(path, {"/wrench": FIELDS}).series["/wrench"])
    assert 250 < count < 450
    (damage,) = damaged(path, slice(count))
    assert "the file ends inside a record (code 0x05)" in damage


def test_a_damaged_summary_is_not_used(run):
    forge.overwrite(run, forge.summary_start(run) + 30, b"\xff\xff")
    (damage,) = damaged(run, slice(None))
    assert "the summary section is damaged and was not used; no message is lost" in damage
    assert scan(run).topic_count("/wrench") == 600


def test_a_wrong_message_index_is_not_used(run):
    start, size = forge.chunk_starts(run)[1]
    data = run.read_bytes()
    (channel,) = struct.unpack_from("<H", data, start + size + records.HEAD_SIZE)
    assert channel == 1
    forge.overwrite(run, start + size + records.HEAD_SIZE + 6 + 8, struct.pack("<Q", 3))
    assert damaged(run, slice(None)) == []


def test_garbage_between_chunks_is_skipped(run):
    starts = forge.chunk_starts(run)
    start, _ = starts[1]
    forge.overwrite(run, start, b"\x55")
    before, lost = wrenches_before(run, 1), forge.messages_in_chunk(run, 1, "/wrench")
    # the summary names the chunk, so that its first byte is not needed
    assert damaged(run, slice(None)) == []
    forge.cut(run, -20)
    *_, damage, _ = damaged(run, [*range(before), *range(before + lost, 600)])
    assert "no record starts here (code 0x55)" in damage
    assert f"{starts[2][0] - start} bytes are lost" in damage


def test_fewer_messages_than_the_statistics_count(run):
    data = run.read_bytes()
    at = data.index(struct.pack("<HQ", 1, 600), forge.summary_start(run))
    # changed counts are used only where the summary has no CRC
    forge.overwrite(run, at + 2, struct.pack("<Q", 700))
    total = data.index(struct.pack("<Q", 690), forge.summary_start(run))
    forge.overwrite(run, total, struct.pack("<Q", 790))
    forge.overwrite(run, len(data) - 12, bytes(4))
    (damage,) = damaged(run, slice(None))
    assert "the statistics count 700 messages of /wrench, 600 were found" in damage


def test_chunks_without_wanted_channels_are_not_decompressed(tmp_path, monkeypatch):
    calm = [forge.Message("/odom", forge.ODOMETRY, k, forge.cdr(forge.odometry(0, 1.0, 2.0))) for k in range(200)]
    path = forge.forge(tmp_path / "run.mcap", [*forge.run(40), *calm])
    with LogFile(path) as log:
        decompressed = []
        decompressor = log._opener._decompressor
        complete = decompressor.complete
        monkeypatch.setattr(decompressor, "complete", lambda *args: decompressed.append(1) or complete(*args))
        found = list(log.batches(lambda channel: channel.topic == "/wrench"))
    assert sum(len(batch.starts) for batch in found) == 40
    assert 0 < len(decompressed) < len(forge.chunk_starts(path)) / 2
    assert all(first.order[-1] < second.order[0] for first, second in pairwise(found))


def test_a_file_cut_at_any_place(tmp_path):
    """The messages before the cut are read."""
    path = forge.forge(tmp_path / "run.mcap", forge.run(60), chunk_size=2000)
    data = path.read_bytes()
    counts = []
    for size in range(60, len(data), 97):
        path.write_bytes(data[:size])
        result = read(path, {"/wrench": FIELDS})
        assert result.damage
        series = result.series.get("/wrench")
        counts.append(len(series) if series else 0)
    assert counts == sorted(counts)
    assert (counts[0], counts[-1]) == (0, 60)


def test_damage_names_file_bytes_and_reason(run):
    forge.cut(run, -20)
    (damage,) = scan(run).damage
    assert str(damage) == f"{run}: bytes {damage.start} to {damage.stop}: {damage.reason}"
    assert damage.stop == run.stat().st_size
