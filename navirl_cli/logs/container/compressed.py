"""Opening a log: plain MCAP, or with whole-file compression by zstd or lz4.

A compressed file is decompressed block by block (zstd: RFC 8878, 3.1.1; lz4: LZ4 Frame Format 1.6) into a temporary
file. All blocks before a cut or a damaged one are kept, and memory holds one block.
"""

import io
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import zstandard

from navirl_cli.errors import LogError
from navirl_cli.files import open_regular
from navirl_cli.limits import REMEDY, Allowance, in_mb
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.container.remote_file import RemoteFile, Stream
from navirl_cli.logs.container.sniff import check_magic, check_path, check_start, decompressed_name
from navirl_cli.remote import Remote

_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_LZ4: Final = b"\x04\x22\x4d\x18"
#: A skippable frame, which both formats allow: these bytes after one of 0x50 to 0x5f.
_SKIPPED: Final = b"\x2a\x4d\x18"
#: A zstd frame may need 2 GB of memory; libzstd refuses more than this, which `zstd --ultra -22` needs.
_MAX_WINDOW_BYTES: Final = 128 << 20
_MAX_LZ4_BLOCK_BYTES: Final = 4 << 20
#: Enough to identify a file.
_HEAD_BYTES: Final = 512
_BUFFER: Final = 1 << 20


def open_log(path: Path) -> RawFile:
    """Open a log, and decompress a compressed one into a temporary file.

    Args:
        path: An MCAP file, or one in zstd or lz4 frames; identified by its bytes, not by its name.

    Raises:
        LogError: The file does not exist or cannot be read; it is not MCAP; nothing of it decompresses; there is no
            free space for the decompressed file.
    """
    check_path(path)
    if isinstance(path, Remote):
        return _open_remote(path)
    with ExitStack() as on_failure:
        try:
            file = on_failure.enter_context(open_regular(path))
            size = os.fstat(file.fileno()).st_size
            head = file.read(_HEAD_BYTES)
            file.seek(0)
        except OSError as error:
            raise LogError(f"{path}: expected a readable file, found: {error.strerror}; check its rights") from error
        if compression := _compression(head):
            return _decompressed(path, file, size, compression)
        check_magic(path, head, size)
        on_failure.pop_all()
    return RawFile(path, file, size)


def _open_remote(path: Remote) -> RawFile:
    """Open a log in a store; a compressed one is read as a whole."""
    raw = RemoteFile(path)
    with ExitStack() as on_failure:
        on_failure.callback(raw.close)
        head = raw.read(0, _HEAD_BYTES)
        if compression := _compression(head):
            return _decompressed(
                path,
                io.BufferedReader(Stream(raw), _BUFFER),  # type: ignore[type-var]
                raw.size,
                compression,
            )
        check_magic(path, head, raw.size)
        on_failure.pop_all()
    return raw


def _compression(head: bytes) -> str:
    """The compression of a file, by its first bytes; empty for none."""
    if head.startswith(_LZ4):
        return "lz4"
    return "zstd" if head.startswith(_ZSTD) or _is_skipped(head) else ""


def _is_skipped(head: bytes) -> bool:
    return head[1:4] == _SKIPPED and head[0] >> 4 == 5


def _decompressed(path: Path, file: BinaryIO, size: int, compression: str) -> RawFile:
    """A temporary file with the bytes that decompress."""
    damage: list[Damage] = []
    done, most = 0, Allowance().most(size)
    with ExitStack() as on_failure:
        try:
            target = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
            on_failure.callback(_discard, target)
            head = b""
            for raw in _Decompression(path, file, size, compression, damage).blocks():
                if len(head) < _HEAD_BYTES and (head := head + raw[:_HEAD_BYTES]):
                    check_start(path, head, compression)  # before the disk is filled
                target.write(raw)
                done += len(raw)
                if done > most:
                    raise LogError(
                        f"{path}: expected at most {in_mb(most)} in {size} bytes of {compression}, found more; {REMEDY}"
                    )
            target.seek(0)
        except OSError as error:
            folder = tempfile.tempdir or os.environ.get("TMPDIR", "/tmp")  # noqa: S108 - where Python looks first
            raise LogError(
                f"{path}: expected free space in {folder} for the decompressed file, found: {error.strerror} after "
                f"{done} bytes; free some space, or name another folder in the environment variable TMPDIR"
            ) from error
        if damage and not done:
            expected = f"expected MCAP compressed with {compression}"
            raise LogError(f"{path}: {expected}, found: {damage[0].reason}; copy it again")
        check_magic(path, target.read(_HEAD_BYTES), done, compression)
        target.seek(0)
        on_failure.pop_all()
    return RawFile(path, target, done, tuple(damage))


def _discard(target: BinaryIO) -> None:
    """Close a file, even if there is no free space for its last bytes."""
    with suppress(OSError):
        target.close()


@dataclass
class _Decompression:
    """The walk over the frames of a compressed file."""

    path: Path
    file: BinaryIO
    size: int
    compression: str
    damage: list[Damage]
    #: First byte of the section of a frame that is being read, and its bytes so far.
    at: int = 0
    section: bytes = b""

    def blocks(self) -> Iterator[bytes]:
        """Yield the decompressed blocks; add what cannot be decompressed to the damage."""
        while self.at < self.size:
            start, head = self.at, self._peeked()
            if _is_skipped(head):
                self._skip()
            elif head == _ZSTD:
                yield from self._frame(
                    start, self._zstd_sections(), zstandard.ZstdDecompressor().decompressobj().decompress
                )
            elif head == _LZ4:
                yield from self._frame(start, self._lz4_sections(), _lz4())
            else:
                self._stop(f"no {self.compression} frame starts here ({head.hex(' ')}); the rest is lost")

    def _frame(self, start: int, sections: Iterator[str], decompress: Callable[[bytes], bytes]) -> Iterator[bytes]:
        """Yield the decompressed blocks of one frame."""
        is_checksum = False
        try:
            for name in sections:
                is_checksum = name == "checksum"
                raw = decompress(self.section)
                self.at, self.section = self.at + len(self.section), b""
                yield raw
        except EOFError:
            with suppress(zstandard.ZstdError, RuntimeError):
                # the first bytes of a block that is stored uncompressed can be used
                yield decompress(self.section)
            self._stop(f"the {self.compression} data are cut off; everything before was read, the rest is lost")
        except (zstandard.ZstdError, RuntimeError) as error:
            if not is_checksum:
                self._stop(f"the {self.compression} data are damaged ({error}); the rest is lost")
                return
            stop = self.at + len(self.section)
            reason = f"the {self.compression} checksum is wrong; some decompressed bytes are wrong, unknown which"
            self.damage.append(Damage(self.path, start, stop, reason))
            self.at, self.section = stop, b""

    def _zstd_sections(self) -> Iterator[str]:
        """Read the sections of a zstd frame into `section`, and yield their names."""
        descriptor = self._take(5)[4]
        single = descriptor >> 5 & 1
        self._take(1 - single + (0, 1, 2, 4)[descriptor & 3] + (single, 2, 4, 8)[descriptor >> 6])
        window = zstandard.get_frame_parameters(self.section).window_size
        if window > _MAX_WINDOW_BYTES:
            raise LogError(
                f"{self.path}: expected a zstd frame with a window of at most {_MAX_WINDOW_BYTES >> 20} MiB, found "
                f"one of {window >> 20} MiB; decompress it first: "
                f"zstd -d --long=31 {self.path} -o {decompressed_name(self.path)}"
            )
        yield "head"
        last = False
        while not last:
            mark = int.from_bytes(self._take(3), "little")
            last, repeated = bool(mark & 1), mark >> 1 & 3 == 1
            self._take(1 if repeated else mark >> 3)
            yield "block"
        if descriptor & 4:
            self._take(4)
            yield "checksum"

    def _lz4_sections(self) -> Iterator[str]:
        """Read the sections of an lz4 frame into `section`, and yield their names."""
        flags = self._take(6)[4]
        self._take(1 + 8 * (flags >> 3 & 1) + 4 * (flags & 1))
        yield "head"
        while mark := int.from_bytes(self._take(4), "little") & 0x7FFFFFFF:
            if mark > _MAX_LZ4_BLOCK_BYTES:
                raise RuntimeError(f"a block of {mark} bytes")
            self._take(mark + 4 * (flags >> 4 & 1))
            yield "block"
        self._take(4 * (flags >> 2 & 1))
        yield "checksum"

    def _take(self, count: int) -> bytes:
        data = self._read(count)
        self.section += data
        if len(data) < count:
            raise EOFError
        return data

    def _read(self, count: int) -> bytes:
        try:
            return self.file.read(count)
        except OSError as error:
            raise LogError(
                f"{self.path}: expected {self.size} readable bytes, found: {error.strerror} after byte {self.at}; "
                "copy what can be read to another disk"
            ) from error

    def _peeked(self) -> bytes:
        self.file.seek(self.at)
        head = self._read(4)
        self.file.seek(self.at)
        return head

    def _skip(self) -> None:
        """Step over a skippable frame."""
        self.file.seek(self.at + 4)
        stop = self.at + 8 + int.from_bytes(self._read(4), "little")
        if stop > self.size:
            self._stop("the file ends inside a skippable frame; the rest is lost")
        else:
            self.at = stop

    def _stop(self, reason: str) -> None:
        """Add damage up to the end of the file, and go there."""
        self.damage.append(Damage(self.path, self.at, self.size, reason))
        self.at = self.size


def _lz4() -> Callable[[bytes], bytes]:
    import lz4.frame

    return lz4.frame.LZ4FrameDecompressor().decompress  # type: ignore[no-any-return]
