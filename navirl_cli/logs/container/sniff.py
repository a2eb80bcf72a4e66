"""Identification of files that are not MCAP, with a remedy."""

import stat
from pathlib import Path

from navirl_cli.errors import LogError
from navirl_cli.files import not_regular
from navirl_cli.logs.container.records import MAGIC

#: The command that converts another bag to MCAP.
CONVERT = "rosbags-convert --src {path} --dst {stem}_mcap --dst-storage mcap"
#: First bytes of a file, its format, the remedy.
_KNOWN: tuple[tuple[bytes, str, str], ...] = (
    (b"#ROSBAG V", "a ROS 1 bag", "convert it: " + CONVERT),
    (
        b"SQLite format 3\0",
        "a ROS 2 bag in SQLite",
        "convert its folder, metadata.yaml included: " + CONVERT.replace("{path}", "{dir}"),
    ),
    (b"\x1f\x8b", "a file compressed with gzip", "decompress it first: gzip -dk {path}"),
    (b"PK\x03\x04", "a zip archive", "unpack it first: unzip {path}"),
)


def check_path(path: Path) -> None:
    """Refuse a path that is not a file.

    Raises:
        LogError: The path does not exist or is not accessible, or it is a folder, a pipe or a device.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise LogError(f"{path}: expected an MCAP file, found no file there; check the path") from error
    except OSError as error:
        raise LogError(f"{path}: expected an MCAP file, found: {error.strerror}; check path and rights") from error
    if stat.S_ISDIR(mode):
        found = sorted(item.name for item in path.glob("*.mcap"))
        listing = f"it holds {', '.join(found)}" if found else "it holds no .mcap file"
        raise LogError(f"{path}: expected an MCAP file, found a folder ({listing}); give the .mcap files in it")
    if reason := not_regular(mode):
        raise LogError(f"{path}: expected an MCAP file, found {reason}")


def check_magic(path: Path, head: bytes, size: int, inside: str = "") -> None:
    """Refuse a file that does not start like MCAP.

    Args:
        path: The file.
        head: Its first bytes.
        size: Its size in bytes.
        inside: The whole-file compression, zstd or lz4, from which these bytes come; empty for none.

    Raises:
        LogError: The file is not MCAP; the message names its format and the remedy.
    """
    where = f" inside the {inside} compression" if inside else ""
    if size == 0:
        raise LogError(f"{path}: expected an MCAP file{where}, found an empty file; record or copy it again")
    if head.startswith(MAGIC):
        if size == len(MAGIC):
            raise LogError(
                f"{path}: expected an MCAP header after the magic{where}, found the end of the file (8 bytes); "
                "nothing was recorded: record or copy it again"
            )
        return
    raise LogError(f"{path}: expected an MCAP file{where}, found {_describe(path, head, inside)}")


def check_start(path: Path, head: bytes, inside: str) -> None:
    """Refuse the first bytes that a compressed file decompresses to, as soon as they cannot be MCAP's.

    Raises:
        LogError: As :func:`check_magic`.
    """
    if head[: len(MAGIC)] != MAGIC[: len(head)]:
        check_magic(path, head, len(head), inside)


def decompressed_name(path: Path) -> Path:
    """A name for the decompressed file, in the same folder."""
    compressed = path.suffix in {".zstd", ".zst", ".lz4"}
    return path.with_suffix("") if compressed else path.with_name(f"decompressed_{path.name}")


def _describe(path: Path, head: bytes, inside: str) -> str:
    """The format of the file, and the remedy."""
    for start, name, remedy in _KNOWN:
        if head.startswith(start):
            plain = decompressed_name(path) if inside else path
            first = f"run {inside} -d {path} {'-o ' * (inside == 'zstd')}{plain}, then " if inside else ""
            return f"{name}; {first}{remedy.format(path=plain, stem=plain.stem, dir=path.parent)}"
    if MAGIC.startswith(head):
        return f"only its first {len(head)} bytes; nothing was recorded: record or copy it again"
    remedy = "give an .mcap file"
    if not head.strip(b"\0"):
        return f"zero bytes only (power or disk failure); {remedy}"
    if _is_text(head):
        first = head.decode(errors="ignore").lstrip()[:1]
        return f"{'JSON' if first in {'{', '['} else 'text'}; {remedy}"
    return f"the bytes {head[:8].hex(' ')}; {remedy}"


def _is_text(head: bytes) -> bool:
    """Whether the bytes are printable text; the last character may be cut."""
    text = head.decode(errors="ignore")
    return len(text.encode()) >= len(head) - 3 and all(char.isprintable() or char in "\r\n\t" for char in text)
