"""Where the files of each participant are: in the published archive, or in the folder into which it was unpacked."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from navirl_cli.errors import ArtefactError
from navirl_cli.files import read_regular
from navirl_cli.published.archive import MOST_OF_A_FILE, files_in

MAP: Final = "nav_map.pkl"
DEMONSTRATIONS: Final = ("force_demos.pkl", "joystick_demos.pkl", "obs_avoidance_demos.pkl")
#: How the files of completion times end; their names begin with the modality.
TIMES: Final = "_parcours_times.txt"
#: What a participant has.
EXPECTED: Final = (MAP, *DEMONSTRATIONS, f"force{TIMES}", f"joystick{TIMES}")


@dataclass(frozen=True)
class Run:
    """The files of one participant."""

    #: The participant: the name of their folder.
    name: str
    #: The folder, for messages.
    place: str
    #: Bytes by file name.
    files: Mapping[str, bytes]
    #: Unreadable files, in words.
    lost: tuple[str, ...] = ()


def is_wanted(name: str) -> bool:
    """Whether a file of this name is part of the study; names with a leading dot are a file system's."""
    return name in EXPECTED or (name.endswith(TIMES) and not name.startswith("."))


def runs_in(path: Path) -> tuple[list[Run], list[str]]:
    """The participants of the study, in order of their names.

    Args:
        path: The archive; or a folder that holds participants' folders, one that holds such a folder named runs, or
            one participant's folder.

    Returns:
        Participants, and data left out, in words.

    Raises:
        ArtefactError: No participant is found, or the archive cannot be read.
    """
    if not path.exists():
        raise ArtefactError(f"{path}: expected the study's archive or folder, found neither; check the path")
    runs, lost = (_in_folder(path), []) if path.is_dir() else _in_archive(path)
    usable = [run for run in runs if run.name.isprintable()]
    lost += [f"{run.place!r}: its name is not printable; left out" for run in runs if run not in usable]
    if not usable:
        raise ArtefactError(
            f"{path}: expected the study's archive (runs.tar.gz), or the folder into which it was unpacked, with a "
            f"folder for each participant that holds {DEMONSTRATIONS[0]}, found none; give one of the two"
        )
    return sorted(usable, key=lambda run: run.name), lost


def _in_folder(root: Path) -> list[Run]:
    """One participant's folder, or those within, or those within runs."""
    for folders in ([root], _folders(root), _folders(root / "runs")):
        runs = [run for folder in folders if (run := _run_of(folder)) is not None]
        if runs:
            return runs
    return []


def _folders(root: Path) -> Sequence[Path]:
    """The folders in a folder, which may be missing."""
    return [path for path in _listed(root) if path.is_dir()] if root.is_dir() else []


def _listed(folder: Path) -> list[Path]:
    """The content of a folder, in order."""
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise ArtefactError(
            f"{folder}: expected a readable folder, found: {error.strerror}; make it readable"
        ) from error


def _run_of(folder: Path) -> Run | None:
    """The files of a participant's folder; None for another folder."""
    files, lost = {}, []
    try:
        paths = sorted(path for path in folder.iterdir() if is_wanted(path.name))
    except OSError as error:
        raise ArtefactError(
            f"{folder}: expected a readable folder, found: {error.strerror}; make it readable"
        ) from error
    for path in paths:
        try:
            if path.is_file() and path.stat().st_size <= MOST_OF_A_FILE:
                files[path.name] = read_regular(path)
            else:
                lost.append(
                    f"{path}: expected a file of at most {MOST_OF_A_FILE >> 20} MB, found something else; left out"
                )
        except OSError as error:
            lost.append(f"{path}: cannot be read: {error.strerror}; left out")
    return Run(folder.resolve().name, str(folder), files, tuple(lost)) if paths else None


def _in_archive(archive: Path) -> tuple[list[Run], list[str]]:
    """A participant for each folder of the archive that holds files of the study."""
    found, lost = files_in(archive, is_wanted)
    folders: dict[PurePosixPath, dict[str, bytes]] = {}
    for path, data in found.items():
        folders.setdefault(path.parent, {})[path.name] = data
    runs = [
        Run(folder.name or archive.name.partition(".")[0], f"{archive}: {folder}", files)
        for folder, files in folders.items()
    ]
    _check_names(archive, runs)
    return runs, lost


def _check_names(archive: Path, runs: Iterable[Run]) -> None:
    """Refuse two participants with one folder's name: logs are named after them."""
    seen: dict[str, str] = {}
    for run in runs:
        if run.name in seen:
            raise ArtefactError(
                f"{archive}: expected one folder for each participant, found two of {run.name!r} ({seen[run.name]} and "
                f"{run.place}); unpack it and rename one of the folders"
            )
        seen[run.name] = run.place
