import os
import re

import numpy as np
import pytest

from navirl_cli.errors import LogError
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.sources import Source, sources_of

METADATA = """rosbag2_bagfile_information:
  version: 9
  storage_identifier: {storage}
  duration:
    nanoseconds: 5
  relative_file_paths: {paths}
  compression_format: "{compression}"
  compression_mode: "{mode}"
  files: {files}
  custom_data: ~
  ros_distro: jazzy
"""


def put(*paths):
    """Files of different contents, in folders made for them."""
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(os.fsencode(path))
    return paths[0]


def describe(folder, paths, *, storage="mcap", compression="", mode="", files="[]"):
    """The folder's metadata.yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    text = METADATA.format(storage=storage, paths=paths, compression=compression, mode=mode, files=files)
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
    return folder


def bag(folder, *names, **options):
    put(*(folder / name for name in names))
    return describe(folder, list(names), **options)


def names_of(sources):
    return [(source.name, [file.name for file in source.files]) for source in sources]


def test_files_are_recordings_whatever_their_names(tmp_path):
    names = ["b.mcap", "a.mcap.zstd", "a.mcap.zst", "a.mcap.lz4", "A.MCAP", "r.bag", "without", "[1].mcap"]
    paths = [tmp_path / name for name in names]
    put(*paths)
    assert sources_of(paths) == [Source(path.name, (path,)) for path in paths]
    assert sources_of([str(path) for path in paths]) == sources_of(paths)
    assert sources_of([]) == sources_of([], join=True) == []


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(LogError, match=r"none.mcap: expected an MCAP file, found no file there; check the path"):
        sources_of([tmp_path / "none.mcap"])
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "none.mcap")
    for argument in (tmp_path, tmp_path / "gone.mcap", tmp_path / "*.mcap"):
        with pytest.raises(LogError, match=r"gone.mcap: expected an MCAP file, found no file there; check the path"):
            sources_of([argument])


def test_a_bag_gives_its_files_in_the_order_of_its_metadata(tmp_path):
    folder = bag(tmp_path / "walk", "walk_2.mcap", "walk_10.mcap", "walk_0.mcap")
    expected = [Source("walk", tuple(folder / f"walk_{number}.mcap" for number in (2, 10, 0)))]
    assert sources_of([folder]) == sources_of([f"{folder}/"]) == expected


def test_a_bag_is_called_like_its_folder_however_that_is_given(tmp_path, monkeypatch):
    folder = bag(tmp_path / "walk", "walk_0.mcap")
    (folder / "sub").mkdir()
    monkeypatch.chdir(folder / "sub")
    (source,) = sources_of([".."])
    assert source.name == "walk"
    assert source.files[0].samefile(folder / "walk_0.mcap")
    monkeypatch.chdir(folder)
    assert sources_of(["."])[0].name == "walk"


@pytest.mark.parametrize(
    ("listed", "files"),
    [
        ("[walk/walk_0.mcap, walk/walk_1.mcap]", "[]"),
        ("[/home/robot/walk/walk_0.mcap, ../walk_1.mcap]", "[]"),
        ("[]", "[{path: walk_0.mcap, message_count: 3}, {path: walk_1.mcap}]"),
        ("~", "[{path: walk_0.mcap}, {path: walk_1.mcap}]"),
        ("[walk_0.mcap, walk_1.mcap, walk_0.mcap]", "[]"),
    ],
)
def test_every_form_of_listing_files_is_read(tmp_path, listed, files):
    folder = bag(tmp_path / "walk", "walk_0.mcap", "walk_1.mcap")
    describe(folder, listed, files=files)
    (source,) = sources_of([folder])
    assert source.files == (folder / "walk_0.mcap", folder / "walk_1.mcap")
    assert source.damage == ()


def test_a_storage_without_a_name_is_read(tmp_path):
    # ros2 bag reindex leaves it out
    assert names_of(sources_of([bag(tmp_path / "w", "w_0.mcap", storage='""')])) == [("w", ["w_0.mcap"])]


def test_files_compressed_or_decompressed_since_are_found(tmp_path):
    folder = bag(tmp_path / "w", "w_0.mcap.zstd", "w_1.mcap", "w_2.mcap.zstd", compression="zstd", mode="FILE")
    describe(folder, ["w_0.mcap", "w_1.mcap.zstd", "w_2.mcap.zstd"], compression="zstd", mode="FILE")
    (source,) = sources_of([folder])
    assert [file.name for file in source.files] == ["w_0.mcap.zstd", "w_1.mcap", "w_2.mcap.zstd"]
    assert source.damage == ()
    assert source.notes == (
        "w: metadata.yaml lists w_0.mcap; w_0.mcap.zstd is read for it",
        "w: metadata.yaml lists w_1.mcap.zstd; w_1.mcap is read for it",
    )


def test_missing_and_unlisted_files_of_a_bag_are_reported(tmp_path):
    folder = bag(tmp_path / "w", "w_1.mcap")
    describe(folder, ["w_0.mcap", "w_1.mcap", "w_2.mcap"])
    put(folder / "w_1.mcap.zstd", folder / "later.mcap", folder / ".hidden.mcap", folder / "notes.txt")
    reason = "listed in metadata.yaml, but missing; its messages are lost"
    assert sources_of([folder]) == [
        Source(
            "w",
            (folder / "w_1.mcap",),
            (Damage(folder / "w_0.mcap", 0, 0, reason), Damage(folder / "w_2.mcap", 0, 0, reason)),
            ("w: metadata.yaml does not list later.mcap, w_1.mcap.zstd; left out",),
        )
    ]


def test_a_bag_without_any_of_its_files_is_refused(tmp_path):
    folder = describe(tmp_path / "w", ["a.mcap", "b.mcap", "c.mcap", "d.mcap"])
    message = (
        f"{folder}: expected the files that metadata.yaml lists (a.mcap, b.mcap, c.mcap, ...), found none of them; "
        "copy them into it"
    )
    for argument in (folder, tmp_path):
        with pytest.raises(LogError, match=re.escape(message)):
            sources_of([argument])


def test_renamed_files_of_a_bag_are_read_and_reported(tmp_path):
    folder = describe(tmp_path / "w", ["rosbag2_2024_0.mcap"])
    put(folder / "third_walk.mcap")
    reason = "listed in metadata.yaml, but missing; its messages are lost"
    assert sources_of([folder]) == [
        Source(
            "third_walk.mcap", (folder / "third_walk.mcap",), (Damage(folder / "rosbag2_2024_0.mcap", 0, 0, reason),)
        )
    ]


@pytest.mark.parametrize(
    ("listed", "options", "found"),
    [
        ("[w_0.db3]", {"storage": "sqlite3"}, "a ROS 2 bag in SQLite"),
        ("[w_0.db3.zstd]", {"storage": '""'}, "a ROS 2 bag in SQLite"),
        (
            "[w_0.mcap]",
            {"compression": "lz4", "mode": "MESSAGE"},
            "one whose messages are compressed one by one (compression_mode: MESSAGE) by 'lz4', not by zstd",
        ),
    ],
)
def test_bags_that_cannot_be_read_are_refused(tmp_path, listed, options, found):
    folder = describe(tmp_path / "w", listed, **options)
    put(folder / "w_0.mcap")
    message = (
        f"{folder}: expected a bag in MCAP, found {found}; convert it: rosbags-convert --src {folder} --dst w_mcap "
        "--dst-storage mcap"
    )
    with pytest.raises(LogError, match=re.escape(message)):
        sources_of([folder])


TAKEN = "; the folder's files are taken without it"


@pytest.mark.parametrize(
    ("text", "note"),
    [
        ("", "metadata.yaml: expected YAML with keys and values, found an empty file" + TAKEN),
        ("rosbag2_bagfile", "metadata.yaml: expected YAML with keys and values, found 'rosbag2_bagfile'" + TAKEN),
        ("a: [1, 2\nb: 3", "found line 2: expected ',' or ']', but got ':'" + TAKEN),
        ("a: 3\n", "metadata.yaml: key rosbag2_bagfile_information: expected keys and values, found None" + TAKEN),
        ("rosbag2_bagfile_information: [1]", "key rosbag2_bagfile_information: expected keys and values, found [1]"),
        *[
            (f"rosbag2_bagfile_information: {{{entries}}}", f"expected names of files, found {found}" + TAKEN)
            for entries, found in [
                ("version: 9", "None"),
                ("relative_file_paths: []", "[]"),
                ("relative_file_paths: w_0.mcap", "'w_0.mcap'"),
                ("relative_file_paths: [3]", "[3]"),
                ("relative_file_paths: ['']", "['']"),
                ("relative_file_paths: {a: b}", "{'a': 'b'}"),
                ("files: [w_0.mcap]", "[None]"),
                ("files: {path: w_0.mcap}", "None"),
            ]
        ],
    ],
)
def test_an_invalid_metadata_file_is_noted(tmp_path, text, note):
    folder = tmp_path / "w"
    put(folder / "w_1.mcap", folder / "w_0.mcap")
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
    (source,) = sources_of([folder])
    assert names_of([source]) == [("w", ["w_0.mcap", "w_1.mcap"])]
    assert source.damage == ()
    (found,) = source.notes
    assert found.startswith(f"{folder}/metadata.yaml: ")
    assert note in found


def test_pieces_without_metadata_are_one_recording_in_the_order_of_their_numbers(tmp_path):
    folder = tmp_path / "my.walk [1]"
    put(*(folder / f"my.walk [1]_{number}.mcap{'.zstd' * (number % 2)}" for number in range(12)))
    (source,) = sources_of([folder])
    assert source == Source(
        "my.walk [1]", tuple(folder / f"my.walk [1]_{number}.mcap{'.zstd' * (number % 2)}" for number in range(12))
    )


def test_missing_pieces_are_reported(tmp_path):
    folder = tmp_path / "w"
    put(*(folder / f"w_{number}.mcap" for number in (1, 2, 7, 9, 12)))
    (source,) = sources_of([folder])
    assert [file.name for file in source.files] == [f"w_{number}.mcap" for number in (1, 2, 7, 9, 12)]
    there = "missing, while later pieces of the recording exist; its messages"
    assert source.damage == (
        Damage(folder / "w_0.mcap", 0, 0, f"{there} are lost"),
        Damage(folder / "w_3.mcap", 0, 0, f"{there} and those up to w_6.mcap are lost"),
        Damage(folder / "w_8.mcap", 0, 0, f"{there} are lost"),
        Damage(folder / "w_10.mcap", 0, 0, f"{there} and those up to w_11.mcap are lost"),
    )


def test_dates_are_no_numbers_of_pieces(tmp_path):
    folder = tmp_path / "w"
    put(*(folder / f"w_{date}.mcap" for date in (20240501, 20240502)), folder / "w_007.mcap", folder / "w_.mcap")
    assert [source.name for source in sources_of([folder])] == [
        "w_007.mcap", "w_20240501.mcap", "w_20240502.mcap", "w_.mcap"
    ]  # fmt: skip
    put(folder / "w_0.mcap")
    assert names_of(sources_of([folder]))[:2] == [("w", ["w_0.mcap"]), ("w_007.mcap", ["w_007.mcap"])]
    many = tmp_path / "v"
    put(*(many / f"v_{number}.mcap" for number in range(300, 1400)))
    (source,) = sources_of([many])
    assert len(source.files) == 1100
    assert len(source.damage) == 1


def test_other_files_of_a_folder_are_recordings_of_their_own(tmp_path):
    folder = tmp_path / "w"
    put(*(folder / name for name in ("w_1.mcap", "w_0.mcap", "run10.mcap", "run9.mcap.lz4", "Run8.MCAP", "ww_2.mcap")))
    put(folder / "notes.txt", folder / ".run11.mcap", folder / ".trash" / "run12.mcap", folder / "run.mcap.bak")
    (folder / "folder.mcap").mkdir()
    sources = sources_of([folder])
    assert names_of(sources) == [
        ("w", ["w_0.mcap", "w_1.mcap"]),
        ("Run8.MCAP", ["Run8.MCAP"]),
        ("run9.mcap.lz4", ["run9.mcap.lz4"]),
        ("run10.mcap", ["run10.mcap"]),
        ("ww_2.mcap", ["ww_2.mcap"]),
    ]
    assert all(source.damage == source.notes == () for source in sources)


def test_a_file_beside_its_compressed_form_is_read_once(tmp_path):
    put(tmp_path / "a.mcap", tmp_path / "a.mcap.zstd", tmp_path / "b.mcap.zst", tmp_path / "b.mcap.lz4")
    sources = sources_of([tmp_path])
    assert [source.name for source in sources] == ["a.mcap", "b.mcap.lz4"]
    note = f"{tmp_path.name}: left out as compressed copies of other files: a.mcap.zstd, b.mcap.zst"
    assert sources[0].notes == (note,)


def test_bags_and_files_below_a_folder_are_found(tmp_path):
    bag(tmp_path / "p10" / "b", "b_0.mcap", "b_1.mcap")
    put(tmp_path / "p9" / "deep" / "c" / "c_0.mcap", tmp_path / "p9" / "deep" / "alone.mcap", tmp_path / "z.mcap")
    bag(tmp_path / "p9" / ".old", "old_0.mcap")
    (tmp_path / "empty").mkdir()
    assert names_of(sources_of([tmp_path])) == [
        ("z.mcap", ["z.mcap"]),
        ("alone.mcap", ["alone.mcap"]),
        ("c", ["c_0.mcap"]),
        ("b", ["b_0.mcap", "b_1.mcap"]),
    ]


def test_links_that_lead_back_are_followed_once(tmp_path):
    put(tmp_path / "a" / "x.mcap", tmp_path / "b" / "y.mcap")
    (tmp_path / "a" / "to_b").symlink_to(tmp_path / "b")
    (tmp_path / "b" / "to_a").symlink_to(tmp_path / "a")
    sources = sources_of([tmp_path])
    assert sorted(source.name for source in sources) == ["x.mcap", "y.mcap"]
    assert all(source.notes == () for source in sources)


@pytest.mark.parametrize(
    ("files", "found"),
    [
        ([], "an empty one; give the folder that holds the recordings"),
        (["a.txt", "b.txt"], "a.txt, b.txt; give the folder that holds the recordings"),
        (["a", "b", "c", "d"], "a, b, c, ...; give"),
        (["a", "w_0.db3"], ("w_0.db3; make metadata.yaml of it by `ros2 bag reindex`, then convert the folder: "
         "rosbags-convert --src {folder} --dst w_mcap --dst-storage mcap")),
        (["old.bag"], "old.bag; convert it: rosbags-convert --src {folder}/old.bag --dst old_mcap --dst-storage mcap"),
        ([".hidden.mcap"], "an empty one; give"),
    ],
)  # fmt: skip
def test_a_folder_without_recordings_is_refused(tmp_path, files, found):
    folder = tmp_path / "w"
    folder.mkdir()
    for name in files:
        put(folder / name)
    message = f"{folder}: expected .mcap files in this folder or below it, found {found.format(folder=folder)}"
    with pytest.raises(LogError, match=re.escape(message)):
        sources_of([folder])


def test_a_folder_that_may_not_be_read_is_named(tmp_path, monkeypatch):
    def refuse(_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(tmp_path), "iterdir", refuse)
    with pytest.raises(LogError, match=r"expected a readable folder, found: Permission denied; check its rights"):
        sources_of([tmp_path])


def test_patterns_mean_all_files_that_they_match(tmp_path, monkeypatch):
    put(*(tmp_path / f"run{number}.mcap" for number in (1, 2, 10)), tmp_path / "run.txt", tmp_path / ".run3.mcap")
    bag(tmp_path / "run4", "run4_0.mcap", "run4_1.mcap")
    monkeypatch.chdir(tmp_path)
    assert names_of(sources_of(["*.mcap"])) == [(f"run{n}.mcap", [f"run{n}.mcap"]) for n in (1, 2, 10)]
    assert [source.name for source in sources_of(["run[12].mcap", tmp_path / "run1?.mcap"])] == [
        "run1.mcap", "run2.mcap", "run10.mcap"
    ]  # fmt: skip
    sources = sources_of(["run*"])
    assert [source.name for source in sources] == ["run1.mcap", "run2.mcap", "run4", "run10.mcap"]
    assert sources[0].notes == ("run*: 1 other files match and are left out: run.txt",)
    assert names_of(sources_of(["*.txt"])) == [("run.txt", ["run.txt"])]
    with pytest.raises(
        LogError, match=r"\*\.bag: expected a pattern that matches recordings, found one that matches no"
    ):
        sources_of(["*.bag"])


def test_double_stars_go_into_folders(tmp_path, monkeypatch):
    bag(tmp_path / "data" / "p1" / "w", "w_0.mcap", "w_1.mcap")
    put(tmp_path / "data" / "p2" / "x.mcap", tmp_path / "data" / "p3" / "notes.txt")
    monkeypatch.chdir(tmp_path)
    for pattern in ("data/**", "data/**/*", "data/*", "**/data", str(tmp_path / "**")):
        sources = sources_of([pattern])
        assert names_of(sources) == [("w", ["w_0.mcap", "w_1.mcap"]), ("x.mcap", ["x.mcap"])], pattern
        assert all(source.notes == () for source in sources)
    assert [source.name for source in sources_of(["**/*.mcap"])] == ["w_0.mcap", "w_1.mcap", "x.mcap"]
    with pytest.raises(LogError, match=r"found one that matches folders without any \(p3\); check it"):
        sources_of(["data/*3"])


def test_an_existing_name_is_no_pattern(tmp_path):
    put(tmp_path / "run[1].mcap", tmp_path / "run1.mcap")
    assert names_of(sources_of([tmp_path / "run[1].mcap"])) == [("run[1].mcap", ["run[1].mcap"])]


def test_the_same_file_is_read_once(tmp_path, monkeypatch):
    file = put(tmp_path / "a.mcap")
    (tmp_path / "link.mcap").symlink_to(file)
    (tmp_path / "hard.mcap").hardlink_to(file)
    other = put(tmp_path / "b.mcap")
    monkeypatch.chdir(tmp_path)
    sources = sources_of([file, other, "./a.mcap", "link.mcap", "hard.mcap"])
    assert names_of(sources) == [("a.mcap", ["a.mcap"]), ("b.mcap", ["b.mcap"])]
    assert sources[0].notes == tuple(
        f"{name} is given more than once; read once" for name in ("a.mcap", "link.mcap", "hard.mcap")
    )
    assert sources[1].notes == ()


def test_a_bag_keeps_a_file_that_is_given_beside_it(tmp_path):
    folder = bag(tmp_path / "w", "w_0.mcap", "w_1.mcap")
    for arguments in ([folder / "w_1.mcap", folder], [folder, folder / "w_1.mcap"], [folder / "w_1.mcap", tmp_path]):
        (source,) = sources_of(arguments)
        assert source == Source(
            "w",
            (folder / "w_0.mcap", folder / "w_1.mcap"),
            (),
            (f"{folder}/w_1.mcap is given more than once; read once",),
        )


def test_joined_files_are_one_recording_under_the_first_name(tmp_path):
    first = describe(tmp_path / "w", ["w_0.mcap", "w_1.mcap"])
    put(first / "w_1.mcap", tmp_path / "z.mcap")
    second = tmp_path / "v"
    put(second / "v_1.mcap")
    (source,) = sources_of([first, second, tmp_path / "z.mcap", tmp_path / "z.mcap"], join=True)
    assert names_of([source]) == [("w", ["w_1.mcap", "v_1.mcap", "z.mcap"])]
    assert [damage.path.name for damage in source.damage] == ["w_0.mcap", "v_0.mcap"]
    assert source.notes == (f"{tmp_path}/z.mcap is given more than once; read once",)
    pieces = [second / "v_1.mcap", put(second / "v_2.mcap")]
    assert sources_of(pieces, join=True) == [Source("v_1.mcap", tuple(pieces))]


def test_a_piece_given_alone_is_reported(tmp_path, monkeypatch):
    folder = bag(tmp_path / "[w]", "[w]_0.mcap", "[w]_1.mcap.zstd", "[w]_2.mcap")
    note = f"[w]_1.mcap.zstd is one of 3 pieces of a recording; give the folder {folder} to read them as one"
    assert sources_of([folder / "[w]_1.mcap.zstd"])[0].notes == (note,)
    monkeypatch.chdir(folder)
    assert sources_of(["[w]_1.mcap.zstd"])[0].notes == (note,)
    assert len([source for source in sources_of(["*.mcap*"]) if source.notes]) == 3
    assert sources_of([put(tmp_path / "v" / "v_0.mcap")])[0].notes == ()
    assert sources_of([put(folder / "alone.mcap")])[0].notes == ()


def test_mutated_metadata_never_breaks_the_reading(tmp_path):
    folder = bag(tmp_path / "w", "w_0.mcap", "w_1.mcap", files="[{path: w_0.mcap, starting_time: 2024-05-01}]")
    text = (folder / "metadata.yaml").read_text(encoding="utf-8")
    rng = np.random.default_rng(4)
    signs = list("[]{}:,-?&*!|>'\"%@`#\n\t 0123aeE._~=<\x00\x85é")
    usual = 0
    for _ in range(300):
        letters = list(text)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(letters)))
            letters[at : at + int(rng.choice([0, 1, 1, 20]))] = rng.choice(signs, rng.integers(0, 3)).tolist()
        (folder / "metadata.yaml").write_text("".join(letters), encoding="utf-8")
        try:
            sources = sources_of([folder])
        except LogError as error:
            assert "; " in str(error)  # noqa: PT017
            continue
        usual += names_of(sources) == [("w", ["w_0.mcap", "w_1.mcap"])]
    assert usual > 150
