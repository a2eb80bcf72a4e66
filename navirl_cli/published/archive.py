"""The published archive, read member by member into memory; its content is not trusted."""

import gzip
import tarfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from typing import IO, Final, cast

from navirl_cli.errors import ArtefactError
from navirl_cli.files import open_regular
from navirl_cli.limits import FREE_BYTES, lifted

#: Limits: bytes of a file, of the unpacked archive, unpacked bytes for each of the archive beyond what every file may
#: unpack to, and bytes of a member's header; number of members. A published file takes a quarter of a megabyte.
MOST_OF_A_FILE: Final = 64 << 20
MOST_IN_ALL: Final = 1 << 30
RATIO: Final = 100
MOST_OF_A_HEADER: Final = 4096
MOST_MEMBERS: Final = 2000

_GZIP: Final = b"\x1f\x8b"
_OTHERS: Final = {b"\xfd7zXZ\x00": "xz", b"BZh": "bzip2", b"\x28\xb5\x2f\xfd": "zstd", b"PK\x03\x04": "zip"}
_CHUNK: Final = 1 << 20


class _Forward:
    """A stream from which tarfile reads headers: forward only, in small pieces, and not beyond a limit.

    Args:
        stream: The archive, decompressed.
        most: The limit, bytes.
    """

    def __init__(self, stream: IO[bytes], most: int) -> None:
        self._stream = stream
        self._most = most
        #: The bytes read last.
        self.last = b""

    def tell(self) -> int:
        """The present place."""
        return self._stream.tell()

    def seek(self, place: int) -> int:
        """Go forward to a place."""
        if place < self.tell():
            raise tarfile.ReadError("a member that leads back")
        if place > self._most:
            raise tarfile.ReadError(f"more than {self._most >> 20} MB unpacked")
        return self._stream.seek(place)

    def read(self, size: int) -> bytes:
        """Part of a header."""
        if not 0 <= size <= MOST_OF_A_HEADER:
            raise tarfile.ReadError(f"a header of {size} bytes")
        self.last = self._stream.read(size)
        return self.last

    def content(self, member: tarfile.TarInfo) -> bytes:
        """A member's bytes, which follow its header."""
        if self.tell() + member.size > self._most:
            raise tarfile.ReadError(f"more than {self._most >> 20} MB unpacked")
        data = self._stream.read(member.size)
        if len(data) < member.size:
            raise tarfile.ReadError("its end within a member")
        return data

    def finish(self) -> None:
        """Read to the end, where gzip has its checksum."""
        if self.last != bytes(tarfile.BLOCKSIZE):
            raise tarfile.ReadError("no end of an archive")
        while self._stream.read(_CHUNK):
            self.seek(self.tell())


def files_in(archive: Path, wanted: Callable[[str], bool]) -> tuple[dict[PurePosixPath, bytes], list[str]]:
    """Read the wanted files of a tar archive, plain or through gzip.

    Args:
        archive: Its path.
        wanted: Whether to read a file, by its name without folders.

    Returns:
        The files' bytes by their paths, and wanted members that were left out, in words: links, and paths that lead out
        of the archive.

    Raises:
        ArtefactError: It cannot be read, is damaged or truncated, or holds more than the study can.
    """
    found: dict[PurePosixPath, bytes] = {}
    lost = []
    try:
        with ExitStack() as stack:
            in_proportion = MOST_IN_ALL if lifted() else FREE_BYTES + RATIO * archive.stat().st_size
            stream = _Forward(_opened(archive, stack), min(MOST_IN_ALL, in_proportion))
            for member in _members(stream):
                path = PurePosixPath(member.name)
                if member.size > MOST_OF_A_FILE:
                    raise tarfile.ReadError(f"{member.name!r} with more than {MOST_OF_A_FILE >> 20} MB")
                if not wanted(path.name) or member.isdir():
                    continue
                if not member.isreg() or member.issparse() or path.is_absolute() or ".." in path.parts:
                    lost.append(f"{archive}: {member.name!r} is a link or device, or leads out of it; left out")
                    continue
                found[path] = stream.content(member)
            stream.finish()
    except (tarfile.TarError, EOFError, OSError, zlib.error, ValueError, RecursionError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise ArtefactError(
            f"{archive}: expected an intact tar archive of the study (runs.tar.gz), found {reason}; download it "
            "again, or give the folder into which it was unpacked"
        ) from error
    return found, lost


def _opened(archive: Path, stack: ExitStack) -> IO[bytes]:
    """The archive's bytes, decompressed."""
    file = stack.enter_context(open_regular(archive))
    head = file.read(max(map(len, _OTHERS)))
    packed = head.startswith(_GZIP)
    for magic, name in _OTHERS.items():
        if head.startswith(magic):
            raise ArtefactError(f"{archive}: expected a tar archive, plain or gzip, found {name}; unpack it first")
    file.seek(0)
    return cast("IO[bytes]", stack.enter_context(gzip.GzipFile(fileobj=file))) if packed else file


def _members(stream: _Forward) -> Iterator[tarfile.TarInfo]:
    """The members' headers in order."""
    with tarfile.open(fileobj=cast("IO[bytes]", stream), mode="r:") as tar:
        for number, member in enumerate(tar):
            if number >= MOST_MEMBERS:
                raise tarfile.ReadError(f"more than {MOST_MEMBERS} members")
            yield member
