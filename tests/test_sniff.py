import gzip
import re

import log_factory as forge
import pytest
import zstandard

from navirl_cli.errors import LogError
from navirl_cli.logs.reader import read, scan
from navirl_cli.logs.records import MAGIC

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
    "r.mcap.gz": (gzip.compress(MAGIC), "a file compressed as a whole with gzip; decompress it first: gzip -dk {path}"),
    "r.mcap.zstd": (
        zstandard.compress(MAGIC),
        "a file compressed as a whole with zstd; decompress it first: zstd -d {path}",
    ),
    "r.zip": (b"PK\x03\x04" + bytes(9), "a zip archive; unpack it first: unzip {path}"),
    "empty.mcap": (b"", "an empty file; record or copy it again"),
    "half_magic.mcap": (MAGIC[:5], "its first 5 bytes only; nothing was recorded: record or copy it again"),
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
    "zeros.mcap": (bytes(400), "found zero bytes; the file was lost when the disk or the power failed"),
    "data.json": (b'{"a": [1, 2]}', "found JSON; give an .mcap file"),
    "notes.txt": ("Größe\n".encode() * 9, "found text; give an .mcap file"),
    "photo.png": (b"\x89PNG\r\n\x1a\n" + bytes(99), "found the bytes 89 50 4e 47 0d 0a 1a 0a; give an .mcap file"),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("call", [scan, lambda path: read(path, {"/wrench": None})])
def test_what_is_no_log_is_named(tmp_path, name, call):
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
    with pytest.raises(LogError, match=r"none.mcap: expected an MCAP file, found nothing there; check the path"):
        scan(tmp_path / "none.mcap")
