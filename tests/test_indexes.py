"""Message indexes that are wrong, and definitions in chunks that are not opened."""

import struct

import log_factory as forge
import numpy as np
import pytest
from damaged_log import COUNT, FIELDS, TIMES_NS, damaged, without_summary_crc
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from navirl_cli.logs.container.records import HEAD_SIZE, PRIVATE
from navirl_cli.logs.messages.reader import message_times, read, scan

WRENCH_ID, ODOMETRY_ID = 1, 2
#: Options of a file whose only indexes are those of messages.
NO_SUMMARY = {
    "index_types": IndexType.MESSAGE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}


def indexes(path, channel=WRENCH_ID):
    """Where the contents of a channel's message indexes start in the file."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    return [index.message_index_offsets[channel] + HEAD_SIZE for index in summary.chunk_indexes]


def rewrite(path, change, channel=WRENCH_ID):
    """Change the (n, 2) times and offsets of a channel in every chunk; a private record fills the rest."""
    data = bytearray(path.read_bytes())
    for at in indexes(path, channel):
        (size,) = struct.unpack_from("<I", data, at + 2)
        entries = np.frombuffer(bytes(data[at + 6 : at + 6 + size]), dtype="<u8").reshape(-1, 2)
        changed = change(entries.copy()).astype("<u8").tobytes()
        struct.pack_into("<QHI", data, at - 8, 6 + len(changed), channel, len(changed))
        data[at + 6 : at + 6 + len(changed)] = changed
        if left := size - len(changed):
            struct.pack_into("<BQ", data, at + 6 + len(changed), PRIVATE, left - HEAD_SIZE)
    path.write_bytes(data)
    return path


@pytest.fixture
def run(tmp_path):
    return forge.forge(tmp_path / "run.mcap", forge.run(COUNT))


def check_all(path):
    """Every wrench is read, and no damage is reported."""
    assert damaged(path, slice(None)) == []


def shifted(by):
    return lambda entries: entries + np.array([0, by], dtype="<u8")


def of_odometry(path):
    """Replace the first offsets of the wrench by those of the odometry."""
    data, places = path.read_bytes(), iter(indexes(path, ODOMETRY_ID))

    def change(entries):
        at = next(places)
        entries[0] = np.frombuffer(data[at + 6 : at + 22], dtype="<u8")
        return entries

    return change


@pytest.mark.parametrize(
    "change", [lambda entries: entries[::2], lambda entries: entries[:1], lambda entries: entries[:0]]
)
def test_an_index_that_leaves_messages_out(run, change):
    check_all(rewrite(run, change))


def test_a_chunk_index_that_leaves_a_channel_out(run):
    data, start = run.read_bytes(), forge.summary_start(run)
    for at in indexes(run)[1::2]:
        place = data.index(struct.pack("<HQ", WRENCH_ID, at - HEAD_SIZE), start)
        forge.overwrite(run, place, struct.pack("<H", ODOMETRY_ID))
    check_all(without_summary_crc(run))


@pytest.mark.parametrize("by", [1, 2**64 - 1, 5, 8192, 2**31, 2**62, 2**63])
def test_an_index_that_points_to_wrong_bytes(run, by):
    check_all(rewrite(run, shifted(by)))


def test_an_index_that_points_to_another_channels_messages(run):
    check_all(rewrite(run, of_odometry(run)))


@pytest.mark.parametrize("options", [{}, NO_SUMMARY])
def test_an_index_of_another_channel(tmp_path, run, options):
    """The index records of wrench and odometry change their channels."""
    places = indexes(run), indexes(run, ODOMETRY_ID)
    path = forge.forge(tmp_path / "other.mcap", forge.run(COUNT), **options)
    for mine, others in zip(*places, strict=True):
        forge.overwrite(path, mine, struct.pack("<H", ODOMETRY_ID))
        forge.overwrite(path, others, struct.pack("<H", WRENCH_ID))
    check_all(path)


@pytest.mark.parametrize(
    "options",
    [{}, NO_SUMMARY],
)
def test_an_index_of_an_undefined_channel(tmp_path, run, options):
    path = forge.forge(tmp_path / "other.mcap", forge.run(COUNT), **options)
    for at in indexes(run):
        forge.overwrite(path, at, struct.pack("<H", 99))
    check_all(path)


def test_an_index_that_names_a_message_twice_in_place_of_another(run):
    def change(entries):
        entries[1] = entries[0]
        return entries

    check_all(rewrite(run, change))


def test_an_index_that_leaves_messages_out_of_a_file_without_statistics(tmp_path):
    check_all(
        rewrite(
            forge.forge(tmp_path / "run.mcap", forge.run(COUNT), use_statistics=False), lambda entries: entries[::2]
        )
    )


def test_an_index_that_leaves_messages_out_beside_damage(run):
    start, _ = forge.chunk_starts(run)[0]
    lost = forge.messages_in_chunk(run, 0, "/wrench")
    rewrite(run, lambda entries: entries[::2])
    forge.overwrite(run, start + HEAD_SIZE + 24, b"\1\2\3\4")
    assert len(read(run, {"/wrench": FIELDS}).series["/wrench"]) == COUNT - lost


def test_times_come_from_indexes_or_from_the_messages(run):
    contents, times = message_times(run)
    assert times[WRENCH_ID].tolist() == TIMES_NS.tolist()
    assert contents.topic_count("/wrench") == COUNT


def late(path, *, split, statistics):
    """Much of /a, the definitions of /b, more of /a, messages of /b; with `split`, channel /b stands with these."""
    with path.open("wb") as file:
        options = NO_SUMMARY | {"use_statistics": statistics}
        writer = Writer(file, chunk_size=300, compression=CompressionType.NONE, **options)
        writer.start("ros2", "forged")
        a = writer.register_channel("/a", "cdr", writer.register_schema("a/msg/A", "ros2msg", b"float64 x\n"))
        add(writer, a, range(60))
        schema = writer.register_schema("b/msg/B", "ros2msg", b"float64 y\n")
        b = None if split else writer.register_channel("/b", "cdr", schema)
        add(writer, a, range(60, 100))
        add(writer, b or writer.register_channel("/b", "cdr", schema), range(30))
        add(writer, a, range(100, 105))
        writer.finish()
    return path


def add(writer, channel, numbers):
    for number in numbers:
        writer.add_message(channel, number, b"\0\1\0\0" + np.float64(number).tobytes(), number)


PLACES = pytest.mark.parametrize(
    ("split", "statistics"),
    [(False, False), (True, False), (False, True), (True, True)],
)


@pytest.mark.parametrize("threads", [1, 4])
@pytest.mark.parametrize("wants", [{"/b": ("y",)}, {"/a": ("x",), "/b": ("y",)}])
@PLACES
def test_definitions_in_a_chunk_that_was_skipped(tmp_path, split, statistics, wants, threads):
    """The message index of the chunk names /a only, so that it is not opened for /b."""
    result = read(late(tmp_path / "run.mcap", split=split, statistics=statistics), wants, threads=threads)
    assert result.damage == ()
    for topic, (field,) in wants.items():
        assert result.series[topic].columns[field].tolist() == list(range({"/a": 105, "/b": 30}[topic]))


@PLACES
def test_scan_finds_definitions_in_chunks_that_it_does_not_open(tmp_path, split, statistics):
    contents = scan(late(tmp_path / "run.mcap", split=split, statistics=statistics))
    assert [(channel.topic, channel.schema_name) for channel in contents.channels] == [
        ("/a", "a/msg/A"),
        ("/b", "b/msg/B"),
    ]
    assert (contents.topic_count("/a"), contents.topic_count("/b")) == (105, 30)
