"""Files whose records contradict each other: what is read, and what is reported."""

import re
import struct

import log_factory as forge
import pytest
import strict_log
from damaged_log import FIELDS, damaged, without_summary_crc, wrenches_before

from navirl_cli.logs.container import records
from navirl_cli.logs.messages.reader import message_times, read, scan


@pytest.fixture
def run(tmp_path):
    return forge.forge(tmp_path / "run.mcap", forge.run())


def records_of(path, code):
    """Where the contents of records of a type start in the file; chunks are not opened."""
    walked = strict_log.walk(path.read_bytes())
    return [record.start + records.HEAD_SIZE for record in walked.records if record.code == code]


@pytest.mark.parametrize("variant", ["zstd", "no statistics", "uncompressed chunks"])
def test_a_chunk_of_zeros_is_not_an_empty_chunk(tmp_path, variant):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), **forge.WAYS[variant])
    (start, size), lost = forge.chunk_starts(path)[2], forge.messages_in_chunk(path, 2, "/wrench")
    before = wrenches_before(path, 2)
    forge.overwrite(path, start, bytes(size))
    damage, *others = damaged(path, [*range(before), *range(before + lost, 600)])
    if variant == "uncompressed chunks":
        assert "zero bytes where a record should start" in damage
        assert f"the statistics count 600 messages of /wrench, {600 - lost} were found" in others[0]
    else:
        assert others == []
        assert re.search(
            rf"the chunk's header claims 0 bytes, expected {size - 49}; messages lost: {lost} of /w", damage
        )


def test_a_missing_message_that_the_index_lists_is_reported(tmp_path):
    """One bit makes it a message of another channel, which only the index and the statistics show."""
    path = forge.forge(tmp_path / "run.mcap", forge.run(), **forge.WAYS["uncompressed chunks"])
    data = path.read_bytes()
    message = strict_log.walk(data).of("/wrench")[70]
    forge.overwrite(path, data.index(message.record) + records.HEAD_SIZE, b"\3")
    (damage,) = damaged(path, [*range(70), *range(71, 600)])
    assert re.search(r"the chunk's message index lists \d+ messages of /wrench, \d+ were found", damage)


def test_statistics_that_do_not_add_up_are_not_used(run):
    """Recorders may also leave out the counts by channel."""
    at = records_of(run, records.STATISTICS)[0]
    forge.overwrite(without_summary_crc(run), at, struct.pack("<Q", 5000))
    contents = scan(run)
    assert [contents.topic_count(topic) for topic in ("/wrench", "/odom", "/camera")] == [600, 60, 30]
    assert damaged(run, slice(None)) == []


def test_a_summary_with_overlapping_chunks_is_not_used(run):
    at = records_of(run, records.CHUNK_INDEX)[1]
    forge.overwrite(without_summary_crc(run), at + 24, struct.pack("<Q", 100_000))
    (damage,) = damaged(run, slice(None))
    assert "the summary section is damaged and was not used; no message is lost" in damage


def test_a_file_without_the_record_that_ends_its_data(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), **forge.WAYS["no summary"])
    data = path.read_bytes()
    last = strict_log.walk(data).chunks()[-1]
    path.write_bytes(data[: last.start] + data[-37:])
    result = read(path, {"/wrench": FIELDS})
    assert 400 < len(result.series["/wrench"]) < 600
    (damage,) = result.damage
    assert (damage.start, damage.stop) == (last.start, last.start)
    assert damage.reason == "the record that ends the data is missing; messages before it may be missing, too"


def test_names_that_cannot_be_printed_are_escaped(tmp_path):
    message = forge.Message("/wre\nnch\x1b[2J", forge.WRENCH, 1, forge.cdr(forge.wrench(0, (1, 2, 3))))
    (channel,) = scan(forge.forge(tmp_path / "run.mcap", [message])).channels
    assert channel.topic == "/wre\\nnch\\x1b[2J"


@pytest.mark.parametrize("offset", [2**64 - 1, 2**63, 10**9, 8])
def test_an_index_of_metadata_that_points_nowhere(tmp_path, offset):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), metadata=[("session", {"a": "1"})])
    (at,) = records_of(path, 0x0D)
    forge.overwrite(without_summary_crc(path), at, struct.pack("<Q", offset))
    assert scan(path).metadata == {"session": ({"a": "1"},)}


@pytest.mark.parametrize("place", [2**64 - 1, 2**63, 0, 100])
def test_a_chunk_index_that_points_to_no_message_index(run, place):
    at = records_of(run, records.CHUNK_INDEX)[1]
    forge.overwrite(without_summary_crc(run), at + 32 + 4 + 2, struct.pack("<Q", place))
    assert damaged(run, slice(None)) == []
    assert message_times(run)[0].topic_count("/wrench") == 600


def test_a_message_index_without_entries(run):
    data = run.read_bytes()
    at = records_of(run, records.MESSAGE_INDEX)[0]
    (size,) = struct.unpack_from("<I", data, at + 2)
    # the rest of it becomes a record for private use
    forge.overwrite(run, at - 8, struct.pack("<QHI", 6, *struct.unpack_from("<H", data, at), 0))
    forge.overwrite(run, at + 6, struct.pack("<BQ", records.PRIVATE, size - records.HEAD_SIZE))
    contents, times = message_times(run)
    assert [contents.topic_count(topic) for topic in ("/wrench", "/odom", "/camera")] == [600, 60, 30]
    assert all(len(some) for some in times.values())
    assert damaged(run, slice(None)) == []


def test_a_summary_that_contradicts_the_chunks_is_reported(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), **forge.WAYS["uncompressed chunks"])
    at = path.read_bytes().rindex(b"/odom")
    forge.overwrite(path, at, b"/odor")
    result = read(path, {"/wrench": FIELDS, "/odom": ("header.stamp",)})
    assert "/odom" not in result.series
    (damage,) = result.damage
    assert damage.reason == (
        "a schema or channel record cannot be used: channel 2 is defined twice, as (2, '/odor', 'cdr') and as "
        "(2, '/odom', 'cdr'); the first definition is used"
    )
    kind = path.read_bytes().rindex(b"nav_msgs/msg/Odometry")
    forge.overwrite(forge.overwrite(path, at, b"/odom"), kind, b"nav_msgs/msg/Odometer")
    (damage,) = read(path, {"/odom": ("header.stamp",)}).damage
    assert "schema 2 is defined twice, as 'nav_msgs/msg/Odometer' and as 'nav_msgs/msg/Odometry'" in damage.reason


def test_a_summary_with_channels_and_without_schemas(tmp_path):
    path = forge.forge(tmp_path / "run.mcap", forge.run(), repeat_schemas=False)
    assert {channel.schema_name for channel in scan(path).channels} == {forge.WRENCH, forge.ODOMETRY, forge.BROKEN}
    assert damaged(path, slice(None)) == []


def test_message_times_report_what_they_miss(run):
    """Without a summary the chunks are opened and checked."""
    start, _ = forge.chunk_starts(run)[2]
    lost = forge.messages_in_chunk(run, 2, "/wrench")
    forge.overwrite(run, start + records.HEAD_SIZE + 24, b"\1\2\3\4")
    assert message_times(run)[0].topic_count("/wrench") == 600
    forge.cut(run, -20)
    contents, _ = message_times(run)
    assert contents.topic_count("/wrench") == 600 - lost
    assert "the chunk's CRC is 0x" in contents.damage[0].reason


def test_times_that_the_indexes_leave_out_are_found(run):
    """The statistics show that some are missing."""
    data = run.read_bytes()
    at = next(at for at in records_of(run, records.MESSAGE_INDEX) if struct.unpack_from("<H", data, at) == (1,))
    forge.overwrite(run, at, b"\2")
    assert message_times(run)[0].topic_count("/wrench") == 600
    assert damaged(run, slice(None)) == []


def test_damage_is_reported_in_the_order_of_the_file(run):
    for number in (5, 1, 3):
        start, _ = forge.chunk_starts(run)[number]
        forge.overwrite(run, start + records.HEAD_SIZE + 24, b"\1\2\3\4")
    forge.cut(run, -20)
    starts = [damage.start for damage in read(run, {"/wrench": FIELDS}, threads=4).damage]
    assert len(starts) == 4
    assert starts == sorted(starts)
