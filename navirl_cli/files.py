"""Files: identified by name and hash when read, and written completely or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from errno import EINVAL
from hashlib import sha256
from itertools import count
from pathlib import Path
from shutil import rmtree
from socket import gethostname
from stat import S_ISBLK, S_ISCHR, S_ISDIR, S_ISFIFO, S_ISREG, S_ISSOCK
from typing import BinaryIO, Final

from navirl_cli.errors import ArtefactError
from navirl_cli.remote import Remote

#: The file that lists a folder of demonstrations files.
MANIFEST = "manifest.json"
#: Numbers of this process's temporary files.
_NUMBERS = count()
#: What a path can be besides a regular file.
_NOT_REGULAR: Final = (
    (S_ISDIR, "a folder"),
    (S_ISFIFO, "a pipe (FIFO)"),
    (S_ISSOCK, "a socket"),
    (S_ISCHR, "a device"),
    (S_ISBLK, "a device"),
)


class NotRegularError(OSError):
    """A path is something else than a regular file; `strerror` says what, and the remedy."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file, never a FIFO, which would block, a device, which may have no end, or a socket.

    Args:
        path: Its name.

    Raises:
        OSError: There is no such file, it cannot be read, or it is something else (:class:`NotRegularError`).
    """
    _check_regular(path, path.stat().st_mode)  # a device is not even opened
    file = os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)), "rb")
    try:
        _check_regular(path, os.fstat(file.fileno()).st_mode)
    except OSError:
        file.close()
        raise
    return file


def read_regular(path: Path) -> bytes:
    """The bytes of a regular file; raises as :func:`open_regular`."""
    with open_regular(path) as file:
        return file.read()


def not_regular(mode: int) -> str:
    """What a path is by the mode of its status, for a message after "found", with the remedy; "" for a regular file."""
    if S_ISREG(mode):
        return ""
    name = next((name for is_one, name in _NOT_REGULAR if is_one(mode)), "something else")
    remedy = "name a file in it" if S_ISDIR(mode) else "save its bytes to a file first"
    return f"{name}, expected a regular file; {remedy}"


def _check_regular(path: Path, mode: int) -> None:
    if reason := not_regular(mode):
        raise NotRegularError(EINVAL, reason, str(path))


@dataclass(frozen=True)
class Input:
    """An input file of a result."""

    file: str
    sha256: str

    @staticmethod
    def of(path: Path) -> "Input":
        """Name and hash of a file.

        Of an object in a store the hash is that of what was read of it, of a folder that of its manifest, which names
        the hashes of the others.

        Raises:
            ArtefactError: It cannot be read.
        """
        if isinstance(path, Remote):
            return Input(path.name, path.fetched.sha256)
        digest, name = sha256(), path.name
        if path.is_dir() and (path / MANIFEST).exists():
            path, name = path / MANIFEST, f"{path.resolve().name}/{MANIFEST}"
        try:
            with open_regular(path) as stream:
                while block := stream.read(1 << 20):
                    digest.update(block)
        except OSError as error:
            raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
        return Input(name, digest.hexdigest())


@contextmanager
def replacing(path: Path, *, force: bool) -> Iterator[Path]:
    """Write a file under a temporary name in the same folder and give it its name when the block ends well.

    Temporary files that a killed process of this machine left in the folder are removed first.

    Args:
        path: The file to write.
        force: Whether an existing file may be replaced. If not, a file that appears while the block runs stays.

    Yields:
        The temporary name. After an exception the temporary file is removed.

    Raises:
        ArtefactError: The file exists and may not be replaced, or its folder is missing or cannot be written.
    """
    check_writable(path, force=force)
    path = path.resolve()  # replace the target of a link, not the link
    _remove_stale(path.parent)
    temporary = _temporary(path.parent)
    try:
        yield temporary
        if force:
            temporary.replace(path)
        else:
            _name_new(temporary, path)
    except FileExistsError:
        raise ArtefactError(_exists(path)) from None
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _exists(path: Path) -> str:
    """The message for a file that may not be replaced."""
    return f"{path}: exists already; choose another name, or replace it with `force`"


def _name_new(temporary: Path, path: Path) -> None:
    """Give a temporary file its name, unless a file has it.

    Raises:
        FileExistsError: A file has the name.
    """
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links: an empty file of ours holds the name
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        temporary.replace(path)


def _temporary(folder: Path) -> Path:
    """A new hidden name in a folder, short whatever the name of the result: names may have 255 bytes."""
    return folder / f"{_prefix()}{os.getpid()}-{next(_NUMBERS)}.tmp"


def _prefix() -> str:
    """How names of temporary files of this machine begin; containers number their processes by themselves."""
    try:
        numbering = Path("/proc/self/ns/pid").stat().st_ino
    except OSError:
        numbering = 0
    return f".navirl-{sha256(f'{gethostname()} {numbering}'.encode()).hexdigest()[:8]}-"


def _remove_stale(folder: Path) -> None:
    """Remove temporary files and folders of processes of this machine that do not run any more."""
    for one in folder.glob(f"{_prefix()}*.tmp"):
        process = one.name.removeprefix(_prefix()).partition("-")[0]
        if process.isdigit() and not _runs(int(process)):
            with suppress(OSError):
                rmtree(one) if one.is_dir() else one.unlink()


def _runs(process: int) -> bool:
    """Whether a process of this machine runs; True where that cannot be known."""
    if os.name != "posix":  # where signal 0 ends a process
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it belongs to another user
        return True
    return True


@contextmanager
def swapped_folder(path: Path) -> Iterator[Path]:
    """Write a folder of results under a temporary name, and put it in place as a whole when the block ends well.

    Files of an older folder that the new one does not have are carried over. A process that is killed leaves the older
    folder or the new one. Only where a folder cannot be renamed (the root of a mounted file system) its files are
    replaced one by one.

    Args:
        path: The folder.

    Yields:
        The temporary folder.

    Raises:
        ArtefactError: It cannot be made.
    """
    path = path.resolve()
    with new_folder(path.parent):
        # the root of a mount cannot be renamed, and a shell would stay in the renamed folder
        beside = os.access(path.parent, os.W_OK) and not path.is_mount() and path != Path.cwd()
        home = path.parent if beside else path
        _remove_stale(home)
        new = _temporary(home)
        try:
            new.mkdir()
            yield new
            if beside:
                _swap(new, path)
            else:
                _carry_over(new, path)
        except OSError as error:
            raise ArtefactError(f"{path}: cannot be written: {error.strerror or error}") from error
        finally:
            rmtree(new, ignore_errors=True)


def _swap(new: Path, path: Path) -> None:
    """Rename a folder to a name that another one may have; what only that one holds moves over."""
    old = path.with_name(f"{path.name[:200]}.old-{os.getpid()}")
    if path.exists():
        path.rename(old)
    new.rename(path)
    if old.exists():
        _carry_over(old, path, keep=True)
        rmtree(old)


def _carry_over(source: Path, target: Path, *, keep: bool = False) -> None:
    """Move the files of a folder into another one; with ``keep`` only those that it does not have."""
    for one in sorted(path for path in source.rglob("*") if not path.is_dir() or path.is_symlink()):
        moved = target / one.relative_to(source)
        if not (keep and (moved.exists() or moved.is_symlink())):
            moved.parent.mkdir(parents=True, exist_ok=True)
            one.replace(moved)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Make a folder for results, with its parents, unless it exists.

    Yields:
        The folder. New folders that are still empty when the block ends are removed, also after an exception or an
        interrupt.

    Raises:
        ArtefactError: It cannot be made.
    """
    made: list[Path] = []
    try:
        made = [one for one in (path, *path.parents) if not one.exists()]
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be made a folder: {error.strerror}; choose another `output`") from error
    try:
        yield path
    finally:
        with suppress(OSError):  # of the first folder that is not empty; its parents hold it
            for one in made:
                one.rmdir()


def check_writable(path: Path, *, force: bool) -> None:
    """Check before a long computation that its result can be written.

    Raises:
        ArtefactError: As in :func:`replacing`.
    """
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        kind = None
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be written: {error.strerror}") from error
    if kind is not None and not S_ISREG(kind):
        what = "a folder; name a file in it" if S_ISDIR(kind) else "something else; choose another name"
        raise ArtefactError(f"{path}: expected the name of a file to write, found {what}")
    if kind is not None and not force:
        raise ArtefactError(_exists(path))
    if not path.parent.is_dir():
        raise ArtefactError(f"{path}: expected an existing folder, found none at {path.parent}; create it")
    if not os.access(path.parent, os.W_OK):
        raise ArtefactError(f"{path}: the folder {path.parent} cannot be written; choose another `output`")
