"""What a file is that is no MCAP file, and what to do with it."""

import stat
from pathlib import Path

from navirl_cli.errors import LogError
from navirl_cli.logs.container.records import MAGIC

#: The command that makes an MCAP bag of another one.
CONVERT = "rosbags-convert --src {path} --dst {stem}_mcap --dst-storage mcap"
#: First bytes, what such a file is, the remedy.
_KNOWN: tuple[tuple[bytes, str, str], ...] = (
    (b"#ROSBAG V", "a ROS 1 bag", "convert it: " + CONVERT),
    (
        b"SQLite format 3\0",
        "a ROS 2 bag in SQLite",
        "convert its folder, metadata.yaml included: " + CONVERT.replace("{path}", "{dir}"),
    ),
    (b"\x1f\x8b", "a file compressed as a whole with gzip", "decompress it first: gzip -dk {path}"),
    (b"PK\x03\x04", "a zip archive", "unpack it first: unzip {path}"),
)


def check_path(path: Path) -> None:
    """Refuse what is no file.

    Raises:
        LogError: The path does not exist, cannot be looked at, or is a folder or a pipe.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise LogError(f"{path}: expected an MCAP file, found nothing there; check the path") from error
    except OSError as error:
        raise LogError(f"{path}: expected an MCAP file, found: {error.strerror}; check path and rights") from error
    if stat.S_ISDIR(mode):
        found = sorted(item.name for item in path.glob("*.mcap"))
        listing = f"it holds {', '.join(found)}" if found else "it holds no .mcap file"
        raise LogError(f"{path}: expected an MCAP file, found a folder ({listing}); give the .mcap files in it")
    if not stat.S_ISREG(mode):
        raise LogError(f"{path}: expected an MCAP file, found a pipe or a device; write it into a file first")


def check_magic(path: Path, head: bytes, size: int, inside: str = "") -> None:
    """Refuse what does not start like an MCAP file.

    Args:
        path: The file.
        head: Its first bytes.
        size: Its size in bytes.
        inside: The compression, zstd or lz4, in which these bytes stood in the file; none if empty.

    Raises:
        LogError: Names what the file is and what to do with it.
    """
    where = f" inside of its {inside} compression" if inside else ""
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


def decompressed_name(path: Path) -> Path:
    """A name beside a file for what it decompresses to."""
    packed = path.suffix in {".zstd", ".zst", ".lz4"}
    return path.with_suffix("") if packed else path.with_name(f"decompressed_{path.name}")


def _describe(path: Path, head: bytes, inside: str) -> str:
    """What the file is, and the remedy."""
    for start, name, remedy in _KNOWN:
        if head.startswith(start):
            plain = decompressed_name(path) if inside else path
            first = f"run {inside} -d {path} {'-o ' * (inside == 'zstd')}{plain}, then " if inside else ""
            return f"{name}; {first}{remedy.format(path=plain, stem=plain.stem, dir=path.parent)}"
    if MAGIC.startswith(head):
        return f"its first {len(head)} bytes only; nothing was recorded: record or copy it again"
    remedy = "give an .mcap file"
    if not head.strip(b"\0"):
        return f"zero bytes; the file was lost when the disk or the power failed: {remedy}"
    if _is_text(head):
        first = head.decode(errors="ignore").lstrip()[:1]
        return f"{'JSON' if first in {'{', '['} else 'text'}; {remedy}"
    return f"the bytes {head[:8].hex(' ')}; {remedy}"


def _is_text(head: bytes) -> bool:
    """Whether the bytes are printable text; a character cut at their end does not matter."""
    text = head.decode(errors="ignore")
    return len(text.encode()) >= len(head) - 3 and all(char.isprintable() or char in "\r\n\t" for char in text)
