"""Folders of demonstrations files, one a log, and the manifest that names them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any, Final

from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import ArtefactError
from navirl_cli.files import MANIFEST, Input

#: How a log ended: with demonstrations, refused, or its process ended; the last is tried again.
DONE: Final = "done"
FAILED: Final = "failed"
LOST: Final = "lost"


@dataclass(frozen=True)
class Part:
    """A file of a log."""

    address: str
    size_bytes: int
    #: What changes with the file: of an object in a store its etag, of a local file inode, size and time.
    etag: str
    #: Of the bytes; None where the file was never read.
    sha256: str | None


@dataclass(frozen=True)
class Entry:
    """A log."""

    log: str
    files: tuple[Part, ...]
    #: Of options and version that it was extracted with.
    options_sha256: str
    status: str
    #: Why there are no demonstrations.
    reason: str | None = None
    #: The demonstrations file in the folder, and its hash.
    file: str | None = None
    file_sha256: str | None = None
    #: Trials, skipped ones included, and those that became demonstrations.
    trials: int = 0
    demonstrations: int = 0
    #: What was damaged or skipped, and what is unusual.
    lost: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def address(self) -> str:
        """Of its first file."""
        return self.files[0].address


def manifest_path(path: Path) -> Path:
    """The manifest of a folder; the path itself of any other file."""
    return path / MANIFEST if path.is_dir() else path


def write_manifest(folder: Path, settings: Mapping[str, Any], entries: Iterable[Entry]) -> None:
    """Write the manifest of a folder, over an older one."""
    logs = [{**asdict(one), "files": [asdict(file) for file in one.files]} for one in entries]
    write_json(folder / MANIFEST, "manifest", {"settings": dict(settings), "logs": logs}, force=True)


def read_manifest(path: Path) -> list[Entry]:
    """The logs of a manifest, or of the manifest in a folder.

    Raises:
        ArtefactError: It is missing or is no manifest.
    """
    entries = []
    for one in read_json(manifest_path(path), "manifest")["logs"]:
        files = tuple(Part(**file) for file in one["files"])
        texts = {name: tuple(one[name]) for name in ("lost", "notes")}
        entries.append(Entry(**{**one, "files": files, **texts}))
    return entries


def inputs_of(entries: Iterable[Entry]) -> list[Input]:
    """The files of the logs that gave demonstrations."""
    files = [file for one in entries if one.file is not None for file in one.files]
    return [Input(PurePosixPath(one.address).name, one.sha256) for one in files if one.sha256 is not None]


def read_listed(path: Path, contents: Sequence[tuple[Entry, Sequence[Demonstration]]]) -> list[Demonstration]:
    """Demonstrations of several files as those of one: a participant's trials are numbered throughout.

    Args:
        path: The manifest, for messages.
        contents: Of each file.

    Raises:
        ArtefactError: The manifest lists none.
    """
    before: Counter[str] = Counter()
    found = []
    for entry, demonstrations in contents:
        ids = numbered(entry, [(one.participant, one.id) for one in demonstrations], before)
        found += [replace(one, id=name) for one, name in zip(demonstrations, ids, strict=True)]
    if not found:
        raise ArtefactError(f"{path}: expected logs with demonstrations, found none among {len(contents)}")
    return found


def numbered(entry: Entry, trials: Sequence[tuple[str, str]], before: Counter[str]) -> list[str]:
    """Ids of the trials of a file, numbered after those of the files before it.

    Args:
        entry: The log.
        trials: Participant and id in the file of each.
        before: Number of trials by participant so far, skipped ones included; those of the log are added.
    """
    ids = [f"{participant}/{before[participant] + int(name.rpartition('/')[2])}" for participant, name in trials]
    before.update(dict.fromkeys({participant for participant, _ in trials}, entry.trials))
    return ids


def hash_of(data: bytes) -> str:
    """SHA-256 of bytes, in hexadecimal digits."""
    return sha256(data).hexdigest()
