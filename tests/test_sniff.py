"""Files that are not MCAP: their format and the remedy are named."""

import gzip
import os
import re

import log_factory as forge
import lz4.frame
import pytest
import zstandard

from navirl_cli.errors import LogError
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.records import MAGIC
from navirl_cli.logs.container.sniff import check_magic, check_path, decompressed_name
from navirl_cli.logs.messages.reader import read, scan

CASES = {
    "ros1.bag": (
        b"#ROSBAG V2.0\n" + bytes(99),
        "a ROS 1 bag; convert it: rosbags-convert --src {path} --dst ros1_mcap --dst-storage mcap",
    ),
    "r.db3": (
        b"SQLite format 3\0" + bytes(99),
        (
            "a ROS 2 bag in SQLite; convert its folder, metadata.yaml included: "
            "rosbags-convert --src {dir} --dst r_mcap --dst-storage mcap"
        ),
    ),
    "r.mcap.gz": (gzip.compress(MAGIC), "a file compressed with gzip; decompress it first: gzip -dk {path}"),
    "r.zip": (b"PK\x03\x04" + bytes(9), "a zip archive; unpack it first: unzip {path}"),
    "empty.mcap": (b"", "an empty file; record or copy it again"),
    "half_magic.mcap": (MAGIC[:5], "only its first 5 bytes; nothing was recorded: record or copy it again"),
    "magic.mcap": (
        MAGIC,
        "expected an MCAP header after the magic, found the end of the file (8 bytes); nothing was recorded",
    ),
    "half_header.mcap": (
        MAGIC + b"\1\x20\0\0\0\0\0\0\0ab",
        "expected a header record after the magic, found the end of the file after 19 bytes; nothing was recorded",
    ),
    "quarter.mcap": (
        MAGIC + b"\1",
        "expected a header record after the magic, found the end of the file after 9 bytes",
    ),
    "no_header.mcap": (
        MAGIC + b"\5" + bytes(60),
        "expected a header record after the magic, found record code 0x05; the file is damaged",
    ),
    "bad_header.mcap": (MAGIC + b"\1\4\0\0\0\0\0\0\0\xff\xff\xff\xff", "found one that does not parse ("),
    "zeros.mcap": (bytes(400), "found zero bytes only (power or disk failure)"),
    "data.json": (b'{"a": [1, 2]}', "found JSON; give an .mcap file"),
    "notes.txt": ("Größe\n".encode() * 9, "found text; give an .mcap file"),
    "photo.png": (b"\x89PNG\r\n\x1a\n" + bytes(99), "found the bytes 89 50 4e 47 0d 0a 1a 0a; give an .mcap file"),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("call", [scan, lambda path: read(path, {"/wrench": ()})])
def test_files_that_are_not_mcap_are_identified(tmp_path, name, call):
    content, message = CASES[name]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError, match=re.escape(message.format(path=path, dir=tmp_path))) as caught:
        call(path)
    assert str(caught.value).startswith(f"{path}: expected ")
    assert "\n" not in str(caught.value)


def test_a_folder_and_a_missing_file(tmp_path):
    with pytest.raises(LogError, match=r"found a folder \(it holds no .mcap file\); give the .mcap files in it"):
        scan(tmp_path)
    forge.forge(tmp_path / "b_0.mcap", forge.run(1))
    with pytest.raises(LogError, match=r"found a folder \(it holds b_0.mcap\); give"):
        scan(tmp_path)
    with pytest.raises(LogError, match=r"none.mcap: expected an MCAP file, found no file there; check the path"):
        scan(tmp_path / "none.mcap")


def test_a_pipe_is_refused_before_it_blocks(tmp_path):
    os.mkfifo(tmp_path / "pipe.mcap")
    found = r"a pipe \(FIFO\), expected a regular file; save its bytes"
    with pytest.raises(LogError, match=f"pipe.mcap: expected an MCAP file, found {found}"):
        check_path(tmp_path / "pipe.mcap")


def test_an_inaccessible_path(tmp_path):
    with pytest.raises(LogError, match=r"expected an MCAP file, found: File name too long; check path and rights"):
        check_path(tmp_path / ("a" * 300))
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(LogError, match=r"file/a.mcap: expected an MCAP file, found no file there; check the path"):
        check_path(tmp_path / "file" / "a.mcap")


INSIDE = {
    "ros1.bag": (
        "a ROS 1 bag; run {command}, then convert it: rosbags-convert --src {plain} --dst ros1_mcap --dst-storage mcap"
    ),
    "r.db3": (
        "a ROS 2 bag in SQLite; run {command}, then convert its folder, metadata.yaml included: "
        "rosbags-convert --src {dir} --dst r_mcap --dst-storage mcap"
    ),
    "r.zip": "a zip archive; run {command}, then unpack it first: unzip {plain}",
    "empty.mcap": "an empty file; record or copy it again",
    "half_magic.mcap": "only its first 5 bytes; nothing was recorded: record or copy it again",
    "magic.mcap": "the end of the file (8 bytes); nothing was recorded: record or copy it again",
    "zeros.mcap": "zero bytes only (power or disk failure); give an .mcap file",
    "data.json": "JSON; give an .mcap file",
}


@pytest.mark.parametrize("name", INSIDE)
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_compressed_files_that_are_not_mcap_are_identified(tmp_path, name, compression):
    plain = tmp_path / name
    path = tmp_path / f"{name}.{compression}"
    path.write_bytes({"zstd": zstandard.compress, "lz4": lz4.frame.compress}[compression](CASES[name][0]))
    command = f"zstd -d {path} -o {plain}" if compression == "zstd" else f"lz4 -d {path} {plain}"
    message = INSIDE[name].format(command=command, plain=plain, dir=tmp_path)
    with pytest.raises(LogError, match=re.escape(f" inside the {compression} compression, found {message}")) as caught:
        open_log(path)
    assert str(caught.value).startswith(f"{path}: expected an MCAP ")


def test_files_that_start_like_mcap_pass(tmp_path):
    check_magic(tmp_path, MAGIC + b"\1", 9)
    check_magic(tmp_path, MAGIC + b"\1", 9, "zstd")


def test_the_decompressed_file_has_another_name(tmp_path):
    assert decompressed_name(tmp_path / "a.mcap.zst") == tmp_path / "a.mcap"
    assert decompressed_name(tmp_path / "a.mcap") == tmp_path / "decompressed_a.mcap"
