"""Labels written into a copy of a log: every other byte stays, and the copy says what log and table say."""

import json
import struct
import zlib
from dataclasses import replace
from itertools import islice
from pathlib import Path

import fuzzing
import pytest
import small_logs
import strict_log
from mcap.reader import make_reader
from mutations import mutant
from robot_log import START_NS, Run, write_run

from navirl_cli.demos.annotate import annotate
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.labels import read_labels
from navirl_cli.demos.listing import TrialSettings
from navirl_cli.demos.recordings import extract_recordings
from navirl_cli.errors import ArtefactError, LogError, NavirlError
from navirl_cli.logs.load import LoadOptions
from navirl_cli.logs.messages.reader import read, scan

TABLE = (
    "start_s,participant,condition,cycle,set,robot_radius_m,people_m,nominal_m\n"
    'START,anna,joystick,3,way ü,0.2,"0.7,0.7; 1.1,0.75","-0.5,0; 1.5,0.1"\n'
)
METADATA_INDEX, SUMMARY_OFFSET, CHUNK_INDEX = 0x0D, 0x0E, 0x08


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "trials.csv"
    path.write_text(TABLE.replace("START", "0"), encoding="utf-8")
    return read_labels(path)


@pytest.fixture
def robot_table(tmp_path):
    path = tmp_path / "trials.csv"
    path.write_text(TABLE.replace("START", "1.5"), encoding="utf-8")
    return read_labels(path)


def annotated(log, labels, output, **options):
    return annotate(log, labels, output, TrialSettings(), LoadOptions(), **options)


def demos(*logs, labels=None):
    """The demonstrations without the log's name, and what was lost."""
    found = extract_recordings(logs, ExtractSettings(keep_truncated=True), LoadOptions(), labels=labels)
    return [replace(one, log="") for one in found.demonstrations()], [line.partition(": ")[2] for line in found.lost]


def session_in(data):
    """The last session record, by the strict twin."""
    found = [strict_log.metadata(data[one.contents]) for one in strict_log.walk(data).records if one.code == 0x0C]
    return [values for name, values in found if name == "navirl.session"][-1]


def summary_faults(data):
    """What the records of a summary section say wrongly of the file, by a walk of its own."""
    summary_start, offsets_start, crc = struct.unpack_from("<QQI", data, len(data) - 28)
    if not summary_start:
        return []
    records = list(strict_log.records_in(data, summary_start, len(data) - 37))
    faults = ["CRC"] if crc and crc != zlib.crc32(data[summary_start : len(data) - 12]) else []
    groups = {}
    for one in records:
        start, _ = groups.get(one.code, (one.start, 0))
        groups[one.code] = start, one.stop - start
    offsets = [struct.unpack_from("<BQQ", data, one.start + 9) for one in records if one.code == SUMMARY_OFFSET]
    start, _ = groups.pop(SUMMARY_OFFSET, (offsets_start, 0))
    # the mcap package also writes empty groups
    said = {code: (first, size) for code, first, size in offsets if size}
    if offsets and (start != offsets_start or said != groups):
        faults.append("summary offsets")
    return faults + [f"{one.code:#x} at {one.start}" for one in records if not points_right(data, one)]


def points_right(data, record):
    """Whether an index points to its record, and statistics count the metadata."""
    if record.code == strict_log.STATISTICS:
        (count,) = struct.unpack_from("<I", data, record.start + 9 + 18)
        return count == sum(one.code == strict_log.METADATA for one in strict_log.walk(data).records)
    if record.code not in {METADATA_INDEX, CHUNK_INDEX}:
        return True
    code, skipped = (strict_log.METADATA, 0) if record.code == METADATA_INDEX else (strict_log.CHUNK, 16)
    at, length = struct.unpack_from("<QQ", data, record.start + 9 + skipped)
    return struct.unpack_from("<BQ", data, at) == (code, length - 9)


@pytest.fixture(scope="module")
def variants(tmp_path_factory):
    return {one.name: one for one in small_logs.intact_logs(tmp_path_factory.mktemp("intact"))}


NAMES = [
    *("zstd", "lz4", "uncompressed chunks", "no chunks", "no message index", "no chunk index", "no statistics"),
    *("no channels in the summary", "no summary", "no summary, no chunks", "unchunked, data CRC", "big-endian"),
    *("unchecked, no summary", "ros1", "ros1, no chunks", "json", "json, no chunks"),
    *("file compressed with zstd", "file compressed with lz4"),
]


def test_every_variant_of_the_format_is_tried(variants):
    assert set(variants) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_the_copy_holds_every_byte_and_one_record_more(tmp_path, variants, table, name):
    log = tmp_path / "log.mcap"
    log.write_bytes(variants[name].stored)
    found = annotated(log, table, tmp_path / "copy.mcap")
    assert (found.labelled, found.trials, found.damage) == (1, 1, ())
    before, after = variants[name].data, (tmp_path / "copy.mcap").read_bytes()
    one, other = strict_log.walk(before), strict_log.walk(after)
    end = next(record.start for record in one.records if record.code == strict_log.DATA_END)
    new = other.records[[record.start for record in other.records].index(end)]
    assert after[:end] == before[:end]
    assert new.code == strict_log.METADATA
    assert after[new.stop] == strict_log.DATA_END
    assert strict_log.metadata(after[new.contents])[0] == "navirl.session"
    assert (other.counted, other.indexed) == (one.counted, one.indexed)
    assert summary_faults(before) == summary_faults(after) == []
    kept = {strict_log.SCHEMA, strict_log.CHANNEL, CHUNK_INDEX}
    assert [before[r.start : r.stop] for r in one.records if r.start >= end and r.code in kept] == [
        after[r.start : r.stop] for r in other.records if r.start >= end and r.code in kept
    ]
    with (tmp_path / "copy.mcap").open("rb") as file:
        known = [record.name for record in make_reader(file, validate_crcs=True).iter_metadata()]
    assert known[-1] == "navirl.session"
    assert demos(tmp_path / "copy.mcap") == demos(log, labels=table)


@pytest.mark.parametrize("ending", [".zst", ".zstd", ".lz4"])
def test_the_name_chooses_the_compression_of_the_copy(tmp_path, variants, table, ending):
    log, copy = tmp_path / "log.mcap", tmp_path / f"copy.mcap{ending}"
    log.write_bytes(variants["uncompressed chunks"].stored)
    annotated(log, table, copy)
    annotated(log, table, tmp_path / "plain.mcap")
    assert copy.stat().st_size < log.stat().st_size / 2
    assert strict_log.decompressed(copy.read_bytes()) == (tmp_path / "plain.mcap").read_bytes()
    assert demos(copy) == demos(log, labels=table)


@pytest.mark.parametrize("name", ["zstd", "no chunks", "no summary", "uncompressed chunks"])
@pytest.mark.parametrize("share", [0.7, 0.97])
def test_a_log_without_its_end_keeps_what_it_has(tmp_path, variants, table, name, share):
    """Nothing points to places in it, so that the record may stand before the messages."""
    log, copy = tmp_path / "log.mcap", tmp_path / "copy.mcap"
    data = variants[name].data
    log.write_bytes(data[: round(share * len(data))])
    found = annotated(log, table, copy)
    assert found.damage
    after = copy.read_bytes()
    _, new = islice(strict_log.records_in(after, 8, len(after)), 2)
    assert strict_log.metadata(after[new.contents])[1]["robot_radius_m"] == "0.2"
    assert after[: new.start] + after[new.stop :] == log.read_bytes()
    (before, lost), (same, still) = demos(log, labels=table), demos(copy)
    assert before == same
    assert len(still) == len(lost) > 0


def test_damage_stays_damage(tmp_path, variants, table):
    """A wrong CRC of the data, a broken chunk and a broken summary: the copy reports the same."""
    kind = variants["unchunked, data CRC"]
    broken = bytearray(kind.data)
    message = kind.strict.of("/camera")[1].place
    broken[message.stop - 3] ^= 0x10
    summary = bytearray(variants["zstd"].data)
    (start,) = struct.unpack_from("<Q", summary, len(summary) - 28)
    summary[start + 30] ^= 0x10
    for data in (broken, summary):
        log, copy = tmp_path / "log.mcap", tmp_path / "copy.mcap"
        log.write_bytes(data)
        annotated(log, table, copy, force=True)
        assert read(copy, {"/wrench": ["wrench.force.x"]}).damage
        (one, lost), (other, still) = demos(log, labels=table), demos(copy)
        assert (one, len(lost)) == (other, len(still))
        assert lost


def test_an_earlier_record_is_merged_and_stays_in_the_file(tmp_path, robot_table):
    entries = [
        {"t_ns": START_NS + 1_500_000_000, "cycle": 1, "stop_ns": START_NS + 11_000_000_000},
        {"t_ns": START_NS + 90_000_000_000, "cycle": 8},
    ]
    before = {"participant": "carl", "trials": json.dumps(entries), "completion_s": '{"force": [5.0]}', "note": "wet"}
    log, copy, again = (tmp_path / name for name in ("log.mcap", "copy.mcap", "again.mcap"))
    write_run(log, Run(session=before))
    found = annotated(log, robot_table, copy)
    session = session_in(copy.read_bytes())
    (note,) = found.notes
    assert note.startswith("log.mcap: a session record stands in the log already; the copy's own counts in its place ")
    assert note.endswith("(changed: trials; added: robot_radius_m; kept: participant, completion_s, note)")
    assert {key: session[key] for key in ("participant", "completion_s", "note")} == {
        key: before[key] for key in ("participant", "completion_s", "note")
    }
    first, second = json.loads(session["trials"])
    assert (first["stop_ns"], first["cycle"], first["participant"]) == (START_NS + 11_000_000_000, 3, "anna")
    assert second == entries[1]
    assert [one["note"] for one in scan(copy).metadata["navirl.session"]] == ["wet", "wet"]
    assert demos(copy) == demos(log, labels=robot_table)
    annotated(copy, robot_table, again)
    assert session_in(again.read_bytes()) == session
    assert demos(again) == demos(copy)


def test_a_table_that_changes_nothing_changes_nothing(navirl, tmp_path):
    """A table as inspect writes it, of a log that states everything."""
    log = Path(__file__).parent.parent / "sample_logs" / "p01.mcap"
    (tmp_path / "trials.csv").write_text(navirl("inspect", log, "--trials").stdout)
    done = navirl("annotate", log, "trials.csv", "-o", "copy.mcap")
    assert "counts in its place (kept: participant, trials)" in done.stderr
    records = scan(tmp_path / "copy.mcap").metadata["navirl.session"]
    assert records[0] == records[1]


def test_a_record_inside_a_log_without_its_end_is_refused(tmp_path, robot_table):
    """The new record would stand before the old one, which readers would take."""
    log = tmp_path / "log.mcap"
    annotated(write_run(log), robot_table, log, force=True)
    data = log.read_bytes()
    (start,) = struct.unpack_from("<Q", data, len(data) - 28)
    log.write_bytes(data[:start])
    other = replace(robot_table, rows=tuple(replace(row, cycle=5) for row in robot_table.rows))
    with pytest.raises(
        LogError, match="expected a log that takes another session record, found one that is damaged where"
    ):
        annotated(log, other, tmp_path / "copy.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.mcap", "trials.csv"]


@pytest.mark.parametrize("numbers", [range(60), pytest.param(range(60, 960), marks=pytest.mark.slow)], ids=str)
def test_a_broken_log_is_refused_or_its_copy_gives_the_same(tmp_path, table, numbers):
    logs = fuzzing.logs()
    copies = 0
    for number in numbers:
        log, copy = tmp_path / f"{number}.mcap", tmp_path / f"copy{number}.mcap"
        log.write_bytes(mutant(number, logs, seed=13).data)
        try:
            annotated(log, table, copy)
        except NavirlError:
            assert not copy.exists()
            continue
        copies += 1
        (before, lost), (after, still) = outcome(log, table), outcome(copy, None)
        assert before == after, number
        assert bool(lost) == bool(still), number
    assert copies > len(numbers) / 4


def outcome(log, labels):
    """Demonstrations and losses, or that it is refused."""
    try:
        return demos(log, labels=labels)
    except NavirlError:
        return "refused", []


def bag(tmp_path, variants, *names, record_in=None):
    """A rosbag2 folder of several files."""
    folder = tmp_path / "walk"
    folder.mkdir()
    listed = []
    for number, name in enumerate(names):
        ending = {"zstd": ".zstd", "lz4": ".lz4"}.get(variants[name].compression, "")
        listed.append(f"walk_{number}.mcap{ending}")
        (folder / listed[-1]).write_bytes(variants[name].stored)
    if record_in is not None:
        path = folder / listed[record_in]
        (tmp_path / "old.csv").write_text("start_s,participant,set\n0,olga,old\n")
        annotated(path, read_labels(tmp_path / "old.csv"), path, force=True)
    files = "".join(f"    - {name}\n" for name in listed)
    text = f"rosbag2_bagfile_information:\n  storage_identifier: mcap\n  relative_file_paths:\n{files}"
    (folder / "metadata.yaml").write_text(text)
    (folder / "notes").mkdir()
    (folder / "notes" / "day.txt").write_text("sunny")
    return folder


@pytest.mark.parametrize(
    ("names", "record_in", "changed"),
    [
        (("zstd",), None, 0),
        (("zstd", "uncompressed chunks"), None, 0),
        (("zstd", "uncompressed chunks"), 1, 1),
        (("file compressed with zstd", "zstd"), None, 0),
    ],
)
def test_of_a_bag_one_file_changes(tmp_path, variants, table, names, record_in, changed):
    folder, copy = bag(tmp_path, variants, *names, record_in=record_in), tmp_path / "labelled"
    found = annotated(folder, table, copy)
    assert found.path == copy
    files = sorted(path.relative_to(folder) for path in folder.rglob("*"))
    assert sorted(path.relative_to(copy) for path in copy.rglob("*")) == files
    plain = [file for file in files if (folder / file).is_file()]
    different = [str(file) for file in plain if (folder / file).read_bytes() != (copy / file).read_bytes()]
    assert [name.partition(".")[0] for name in different] == [f"walk_{changed}"]
    assert demos(copy)[0] == demos(folder, labels=table)[0]
    with pytest.raises(ArtefactError, match="labelled: exists already; choose another name, because folders are never"):
        annotated(folder, table, copy, force=True)
    with pytest.raises(ArtefactError, match="expected a folder outside of"):
        annotated(folder, table, folder / "copy")


def test_nothing_is_left_where_writing_fails(tmp_path, variants, table, monkeypatch):
    folder = bag(tmp_path, variants, "zstd")
    log = tmp_path / "log.mcap"
    log.write_bytes(variants["zstd"].stored)
    before = sorted(tmp_path.rglob("*"))

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("navirl_cli.demos.annotate.write_with_metadata", fail)
    for one, output in ((folder, tmp_path / "copy"), (log, tmp_path / "copy.mcap")):
        with pytest.raises(ArtefactError, match=r"copy.*: cannot be written: No space left on device"):
            annotated(one, table, output)
    assert sorted(tmp_path.rglob("*")) == before


def test_an_empty_table_is_not_written(navirl, tmp_path):
    log = write_run(tmp_path / "log.mcap")
    (tmp_path / "trials.csv").write_text(navirl("inspect", log, "--trials").stdout)
    error = navirl("annotate", log, "trials.csv", "-o", "copy.mcap", code=1).stderr
    assert "trials.csv: expected labels in the rows of log.mcap, found empty cells; fill them in" in error
    assert not (tmp_path / "copy.mcap").exists()


def test_refusals_leave_no_copy(navirl, tmp_path, variants):
    log = tmp_path / "log.mcap"
    log.write_bytes(variants["zstd"].stored)
    (tmp_path / "trials.csv").write_text("start_s,cycle\n2.5,1\n")
    error = navirl("annotate", log, "trials.csv", "-o", "copy.mcap", code=1).stderr
    assert "expected the start of a trial of log.mcap, found 2.5 s; near are the trials 1 at 0.0 s" in error
    assert "another file than the input" in navirl("annotate", log, "trials.csv", "-o", log, code=2).stderr
    (tmp_path / "two").mkdir()
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / "two" / name).write_bytes(variants["zstd"].stored)
    error = navirl("annotate", "two", "trials.csv", "-o", "copy", code=1).stderr
    assert "two: expected one recording, found 2; annotate them one by one" in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.mcap", "trials.csv", "two"]


def test_the_command_says_how_many_trials_have_labels(navirl, tmp_path, variants):
    log = tmp_path / "log.mcap"
    log.write_bytes(variants["zstd"].stored[:-40])
    (tmp_path / "trials.csv").write_text("start_s,cycle\n0,1\n")
    done = navirl("annotate", log, "trials.csv", "-o", "copy.mcap", code=3)
    assert done.stdout == "copy.mcap: 1 of 1 trial labelled\n"
    done = navirl("annotate", log, "trials.csv", "-o", "copy.mcap", "--force", "--json", code=3)
    assert json.loads(done.stdout) == {"log": "copy.mcap", "trials": 1, "labelled": 1}
    assert "exists already" in navirl("annotate", log, "trials.csv", "-o", "copy.mcap", code=1).stderr


def test_a_log_that_is_no_mcap_is_refused(tmp_path, table):
    (tmp_path / "log.mcap").write_bytes(b"hello")
    with pytest.raises(NavirlError, match="expected an MCAP file"):
        annotated(tmp_path / "log.mcap", table, tmp_path / "copy.mcap")
