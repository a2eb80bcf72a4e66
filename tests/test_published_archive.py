"""The archive: read member by member, without trust in its content; and the folders into which it was unpacked."""

import bz2
import gzip
import io
import lzma
import os
import tarfile

import numpy as np
import published_factory as forge
import pytest

from navirl_cli.errors import ArtefactError
from navirl_cli.published import archive
from navirl_cli.published.runs import DEMONSTRATIONS, EXPECTED, runs_in

INTACT = (
    r"^{}: expected an intact tar archive of the study \(runs\.tar\.gz\), found {}; download it again, or give the "
    "folder "
)
FILES = {"runs/7/nav_map.pkl": b"map", "runs/7/params.pkl": b"ignored", "runs/12/force_demos.pkl": b"demos"}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "runs.tar.gz"


def refused(path, found):
    return pytest.raises(ArtefactError, match=INTACT.format(path, found))


def header(name, size, kind=tarfile.REGTYPE):
    """A member's first block."""
    member = tarfile.TarInfo(name)
    member.size, member.type = size, kind
    return member.tobuf(tarfile.GNU_FORMAT)


def contents(runs):
    return {run.name: dict(run.files) for run in runs}


@pytest.mark.parametrize("mode", ["w:gz", "w"])
@pytest.mark.parametrize("top", ["runs/", "./runs/", "", "deep/in/somewhere/"])
def test_participants_of_an_archive(path, mode, top):
    path.write_bytes(forge.archive({name.replace("runs/", top): data for name, data in FILES.items()}, mode))
    runs, lost = runs_in(path)
    assert contents(runs) == {"12": {"force_demos.pkl": b"demos"}, "7": {"nav_map.pkl": b"map"}}
    assert [run.name for run in runs] == ["12", "7"]
    assert runs[0].place == f"{path}: {top.removeprefix('./')}12"
    assert lost == []


def test_an_archive_of_one_folder_is_named_after_itself(path):
    path.write_bytes(forge.archive({"./force_demos.pkl": b"x"}))
    assert contents(runs_in(path)[0]) == {"runs": {"force_demos.pkl": b"x"}}


def test_a_file_systems_copies_are_no_part_of_the_study(path):
    names = [
        "7/._force_demos.pkl",
        "7/._joystick_parcours_times.txt",
        "7/force_demos.pkl.bak",
        "7/force_parcours_times.txt",
    ]
    path.write_bytes(forge.archive(dict.fromkeys(names, b"x")))
    assert contents(runs_in(path)[0]) == {"7": {"force_parcours_times.txt": b"x"}}


@pytest.mark.parametrize("odd", ["../7/nav_map.pkl", "runs/../../7/nav_map.pkl", "/runs/7/nav_map.pkl"])
def test_members_that_lead_out_of_the_archive_are_not_read(path, odd):
    path.write_bytes(forge.archive(FILES | {odd: b"from outside"}))
    runs, lost = runs_in(path)
    assert contents(runs)["7"] == {"nav_map.pkl": b"map"}
    assert lost == [f"{path}: {odd!r} is a link or device, or leads out of it; left out"]


@pytest.mark.parametrize(
    "kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE, tarfile.CHRTYPE, tarfile.BLKTYPE], ids=str
)
def test_links_and_devices_are_not_followed(path, kind):
    path.write_bytes(forge.archive(FILES | {"runs/7/force_demos.pkl": b""}, kinds={"runs/7/force_demos.pkl": kind}))
    runs, lost = runs_in(path)
    assert contents(runs)["7"] == {"nav_map.pkl": b"map"}
    assert lost == [f"{path}: 'runs/7/force_demos.pkl' is a link or device, or leads out of it; left out"]


def test_a_member_that_claims_gigabytes_is_refused(path):
    path.write_bytes(gzip.compress(header("runs/7/junk", 1 << 33) + bytes(10_000)))
    with refused(path, "'runs/7/junk' with more than 64 MB"):
        runs_in(path)


def test_an_archive_unpacks_in_proportion_to_its_size(path, monkeypatch):
    monkeypatch.setattr(archive, "FREE_BYTES", 1 << 20)
    path.write_bytes(forge.archive(FILES | {f"runs/{i}/junk": bytes(1 << 20) for i in range(4)}))
    assert path.stat().st_size < 10_000
    with refused(path, "more than 1 MB unpacked"):
        runs_in(path)
    monkeypatch.setenv("NAVIRL_NO_LIMITS", "1")
    assert runs_in(path)[0]


def test_an_archive_that_unpacks_to_more_than_a_gigabyte_is_refused(path, monkeypatch):
    monkeypatch.setattr(archive, "MOST_IN_ALL", 4 << 20)
    path.write_bytes(forge.archive(FILES | {f"runs/{i}/junk": bytes(1 << 20) for i in range(4)}))
    with refused(path, "more than 4 MB unpacked"):
        runs_in(path)
    path.write_bytes(gzip.compress(gzip.decompress(forge.archive(FILES)) + bytes(5 << 20)))
    with refused(path, "more than 4 MB unpacked"):
        runs_in(path)


@pytest.mark.parametrize("kind", [tarfile.GNUTYPE_LONGNAME, tarfile.GNUTYPE_LONGLINK, tarfile.XHDTYPE, tarfile.XGLTYPE])
def test_a_header_that_claims_gigabytes_is_refused(path, kind):
    path.write_bytes(gzip.compress(header("long", 1 << 33, kind) + bytes(10_000)))
    with refused(path, "a header of 8589934592 bytes"):
        runs_in(path)


def test_a_member_of_negative_size_ends_the_reading(path):
    block = bytearray(header("runs/7/junk", 0))
    block[124:136] = (-2048).to_bytes(12, "big", signed=True)
    block[148:156] = b" " * 8
    block[148:156] = b"%06o\0 " % sum(block)
    path.write_bytes(gzip.compress(header("a", 0) * 4 + bytes(block) + bytes(1024)))
    with refused(path, "(a member that leads back|no end of an archive)"):  # the latter where Python sees it itself
        runs_in(path)


def test_very_many_members_are_refused(path):
    path.write_bytes(gzip.compress(header("x", 0) * 2001 + bytes(1024)))
    with refused(path, "more than 2000 members"):
        runs_in(path)


def test_headers_in_headers_end_the_reading(path):
    path.write_bytes(gzip.compress((header("x", 1, tarfile.GNUTYPE_LONGNAME) + b"y" + bytes(511)) * 2000 + bytes(1024)))
    with refused(path, ".*"):
        runs_in(path)


@pytest.mark.parametrize("mode", ["w:gz", "w"])
def test_every_cut_of_an_archive_is_refused(path, mode):
    whole = forge.archive(FILES, mode)
    # the bytes after the first of the two empty blocks do not matter
    stop = len(whole) if mode == "w:gz" else len(whole.rstrip(b"\0")) + 512
    for length in (*range(0, stop, 41), stop - 9):
        path.write_bytes(whole[:length])
        with refused(path, ".+"):
            runs_in(path)


def test_wrong_bytes_are_reported(path):
    whole = forge.archive(FILES, "w")
    damaged = bytearray(whole)
    damaged[512 * 2] ^= 1  # the second header's name
    path.write_bytes(damaged)
    with refused(path, "no end of an archive"):
        runs_in(path)
    packed = bytearray(gzip.compress(whole))
    packed[-6] ^= 1  # of the checksum
    path.write_bytes(packed)
    with refused(path, "CRC check failed .*"):
        runs_in(path)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"", "empty file"),
        (b"hello", "truncated header"),
        (b"no tar" + bytes(600), "(bad checksum|invalid header)"),
        (b"\x1f\x8b", "Compressed file ended before the end-of-stream marker was reached"),
        (gzip.compress(b"hello", mtime=0), "truncated header"),
    ],
)
def test_what_is_no_archive_is_refused(path, data, found):
    path.write_bytes(data)
    with refused(path, found):
        runs_in(path)


def test_damaged_archives_give_files_or_an_expected_error(path):
    rng = np.random.default_rng(0)
    outcomes = set()
    for mode in ("w", "w:gz"):
        whole = np.frombuffer(forge.archive(FILES, mode), dtype=np.uint8)
        for _ in range(300):
            data = whole.copy()
            places = rng.integers(0, min(len(data), 2700), size=rng.integers(1, 4))
            data[places] = rng.integers(0, 256, size=len(places))
            path.write_bytes(data.tobytes())
            try:
                outcomes.add(len(runs_in(path)[0]))
            except ArtefactError as error:
                outcomes.add("refused" if str(error).startswith(f"{path}: expected ") else str(error))
    assert {2, "refused"} <= outcomes <= {1, 2, "refused"}


def test_two_folders_of_one_name_are_refused(path):
    path.write_bytes(forge.archive({"a/7/nav_map.pkl": b"1", "b/7/nav_map.pkl": b"2"}))
    with pytest.raises(
        ArtefactError,
        match=r"expected one folder for each participant, found two of '7' \(.*: a/7 and .*: b/7\); unpack",
    ):
        runs_in(path)


def test_a_name_that_cannot_be_written_is_left_out(path):
    path.write_bytes(forge.archive(FILES | {"runs/7\n/nav_map.pkl": b"x", "runs/\udcff/nav_map.pkl": b"x"}))
    runs, lost = runs_in(path)
    assert sorted(contents(runs)) == ["12", "7"]
    assert [line.endswith(": its name is not printable; left out") for line in lost] == [True, True]
    assert all(line.isprintable() for line in lost)


@pytest.mark.parametrize("top", ["", "runs", "2316"])
def test_participants_of_a_folder(tmp_path, top):
    for name in ("2316", "a b"):
        folder = tmp_path / "study" / ("runs" if top == "runs" else "") / name
        folder.mkdir(parents=True)
        (folder / "nav_map.pkl").write_bytes(b"map")
        (folder / "params.pkl").write_bytes(b"ignored")
    root = tmp_path / "study" / ("2316" if top == "2316" else "")
    runs, lost = runs_in(root)
    names = ["2316"] if top == "2316" else ["2316", "a b"]
    assert contents(runs) == {name: {"nav_map.pkl": b"map"} for name in names}
    assert lost == []


def test_the_present_folder_has_a_name(tmp_path, monkeypatch):
    (tmp_path / "nav_map.pkl").write_bytes(b"map")
    monkeypatch.chdir(tmp_path)
    (run,), _ = runs_in(type(tmp_path)())
    assert run.name == tmp_path.name


def test_what_is_no_plain_file_of_a_folder_is_left_out(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "nav_map.pkl")
    (tmp_path / "joystick_demos.pkl").mkdir()
    (tmp_path / "obs_avoidance_demos.pkl").symlink_to("nowhere")
    (tmp_path / "force_demos.pkl").write_bytes(bytes(100))
    monkeypatch.setattr("navirl_cli.published.runs.MOST_OF_A_FILE", 99)
    (run,), _ = runs_in(tmp_path)
    assert run.files == {}
    left = sorted([*DEMONSTRATIONS, "nav_map.pkl"])
    assert list(run.lost) == [
        f"{tmp_path / name}: expected a file of at most 0 MB, found something else; left out" for name in left
    ]


@pytest.mark.parametrize("kind", ["folder", "archive"])
def test_without_participants_the_import_is_refused(tmp_path, kind):
    (tmp_path / "other").mkdir()
    root = tmp_path
    if kind == "archive":
        root = tmp_path / "runs.tar.gz"
        root.write_bytes(forge.archive({"README": b""}))
    with pytest.raises(
        ArtefactError,
        match=rf"^{root}: expected the study's archive \(runs\.tar\.gz\), or the folder into which it was unpacked, "
        r"with a folder for each participant that holds force_demos\.pkl, found none; give one of the two$",
    ):
        runs_in(root)


def test_what_is_expected_of_a_participant():
    assert io.StringIO("\n".join(EXPECTED)).read().split() == [
        "nav_map.pkl",
        "force_demos.pkl",
        "joystick_demos.pkl",
        "obs_avoidance_demos.pkl",
        "force_parcours_times.txt",
        "joystick_parcours_times.txt",
    ]


@pytest.mark.parametrize(
    ("pack", "name"), [(lzma.compress, "xz"), (bz2.compress, "bzip2"), (lambda data: b"PK\3\4" + data, "zip")]
)
def test_other_compressions_are_named(tmp_path, pack, name):
    path = tmp_path / "runs.tar.other"
    path.write_bytes(pack(gzip.decompress(forge.archive(FILES))))
    with pytest.raises(ArtefactError, match=rf"found {name}; unpack it first"):
        runs_in(path)


def test_a_missing_path_is_reported(tmp_path):
    with pytest.raises(ArtefactError, match=r"nosuch: expected the study's archive or folder, found neither"):
        runs_in(tmp_path / "nosuch")
