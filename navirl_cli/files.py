"""Files: identified by name and hash when read, and written completely or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from stat import S_ISDIR, S_ISREG

from navirl_cli.errors import ArtefactError


@dataclass(frozen=True)
class Input:
    """An input file of a result."""

    file: str
    sha256: str

    @staticmethod
    def of(path: Path) -> "Input":
        """Name and hash of a file.

        Raises:
            ArtefactError: It cannot be read.
        """
        digest = sha256()
        try:
            with path.open("rb") as stream:
                while block := stream.read(1 << 20):
                    digest.update(block)
        except OSError as error:
            raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
        return Input(path.name, digest.hexdigest())


@contextmanager
def replacing(path: Path, *, force: bool) -> Iterator[Path]:
    """Write a file under a temporary name in the same folder and rename it when the block ends well.

    Args:
        path: The file to write.
        force: Whether an existing file may be replaced.

    Yields:
        The temporary name. After an exception the temporary file is removed.

    Raises:
        ArtefactError: The file exists and may not be replaced, or its folder is missing or cannot be written.
    """
    check_writable(path, force=force)
    path = path.resolve()  # replace the target of a link, not the link
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


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
        raise ArtefactError(f"{path}: exists already; choose another name, or replace it with `force`")
    if not path.parent.is_dir():
        raise ArtefactError(f"{path}: expected an existing folder, found none at {path.parent}; create it")
    if not os.access(path.parent, os.W_OK):
        raise ArtefactError(f"{path}: the folder {path.parent} cannot be written; choose another `output`")
