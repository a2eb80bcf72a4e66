"""Files that are no regular files, YAML that grows, and maps of impossible sizes: refused in one line."""

import os
import socket
import tracemalloc
import zlib

import pytest

from navirl_cli.artefacts.store import read_json
from navirl_cli.documents.sheets import _text
from navirl_cli.errors import LogError, NavirlError, brief
from navirl_cli.files import Input, open_regular
from navirl_cli.irl.terms.registry import _from_file
from navirl_cli.logs.map_file import read_map
from navirl_cli.logs.yaml_file import read_mapping
from navirl_cli.published.archive import files_in

HEAD = "resolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
READERS = {
    "artefact": lambda path: read_json(path, "demonstrations"),
    "sheet": _text,
    "hash": Input.of,
    "archive": lambda path: files_in(path, lambda _: True),
    "yaml": lambda path: read_mapping(path, "save it again"),
    "map": read_map,
    "term": lambda path: _from_file(f"{path}:MyTerm"),
}


def fifo(path):
    os.mkfifo(path)
    return path


def listening(path):
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))
    return path


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_only_regular_files_are_read(tmp_path, monkeypatch, read):
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    for path, found in (
        (fifo(tmp_path / "fifo"), "a pipe"),
        (listening(tmp_path.joinpath("s").relative_to(tmp_path)), "a socket"),
        (tmp_path / "/dev/zero", "a device"),
        (tmp_path, "a folder"),
    ):
        with pytest.raises(NavirlError, match=rf"{found}( \(FIFO\))?, expected a regular file; ") as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_the_picture_of_a_map_is_a_regular_file(tmp_path):
    fifo(tmp_path / "m.pgm")
    (tmp_path / "m.yaml").write_text(f"image: m.pgm\n{HEAD}")
    with pytest.raises(LogError, match=r"a pipe \(FIFO\), expected a regular file; save its bytes to a file first"):
        read_map(tmp_path / "m.yaml")


def test_a_regular_file_is_read_through_a_link(tmp_path):
    (tmp_path / "file").write_bytes(b"abc")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    with open_regular(tmp_path / "link") as file:
        assert file.read() == b"abc"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a: &a [x, x]\nimage: *a\n", r"line 2: an alias \(\*a\); write it out"),
        ("a: " + "[" * 20_000, "line 1: more than 40 levels of nesting"),
        ("".join(f"k{k}: &a{k} 1\n" for k in range(20_000)), "line 101: more than 100 anchors"),
        ("a: 1\n" * 2_000_000, "more than 8.39 MB"),
    ],
    ids=["aliases", "nesting", "anchors", "size"],
)
def test_yaml_that_grows_is_refused_before_a_document_is_built(tmp_path, text, problem):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(LogError, match=problem):
        read_mapping(path, "save it again")


def test_a_value_is_never_written_out_whole_in_a_message():
    shared = ["x"] * 9
    for _ in range(30):
        shared = [shared] * 9
    deep = []
    for _ in range(100_000):
        deep = [deep]
    values = (shared, {"a": shared}, (shared,), {("x",) * 9}, deep, "x" * 10_000_000, 10**10_000)
    tracemalloc.start()
    for value in values:
        assert len(brief(value)) <= 60
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()


@pytest.mark.parametrize("value", [[1, "a"], {"a": [1.5, None], 2: {}}, "it's", b"x", [], (1, 2), (1,), {1, 2}, True])
def test_a_short_value_is_shown_as_python_writes_it(value):
    assert brief(value) == repr(value)


def test_a_picture_is_decoded_only_if_its_cells_are_in_proportion_to_its_bytes(tmp_path):
    def chunk(name, data):
        body = name + data
        return len(data).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")

    size = (9_000).to_bytes(4, "big") * 2
    rows = zlib.compress(bytes(1000))
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size + b"\x08\0\0\0\0") + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    (tmp_path / "m.png").write_bytes(png)
    (tmp_path / "m.yaml").write_text(f"image: m.png\n{HEAD}")
    tracemalloc.start()
    with pytest.raises(LogError, match=r"of 9000 x 9000 cells, expected at most 671\d+ for its size"):
        read_map(tmp_path / "m.yaml")
    assert tracemalloc.get_traced_memory()[1] < 30e6
    tracemalloc.stop()
