"""From a user's arguments (files, bag folders, folders of recordings, patterns) to the recordings to read."""

import glob
import os
import re
import stat
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Final

from navirl_cli.errors import LogError, brief
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.sniff import CONVERT, check_path
from navirl_cli.logs.yaml_file import read_mapping
from navirl_cli.remote import Remote, path_of

#: What rosbag2 writes when a recording ends.
METADATA: Final = "metadata.yaml"
_INFO: Final = "rosbag2_bagfile_information"
#: A recording's file name; the group leaves out the ending of whole-file compression.
_MCAP: Final = re.compile(r"(.*\.mcap)(?:\.(?:zstd|zst|lz4))?", re.IGNORECASE | re.DOTALL)


@dataclass(frozen=True)
class Source:
    """One recording: the file that holds it, or the files in order."""

    #: File name, or the bag folder's name.
    name: str
    files: tuple[Path, ...]
    #: Files that are missing.
    damage: tuple[Damage, ...] = ()
    #: What is unusual about the files, in words.
    notes: tuple[str, ...] = ()


def sources_of(
    arguments: Sequence[Path | str], *, join: bool = False, refused: list[LogError] | None = None
) -> list[Source]:
    """Turn a command's arguments into recordings.

    A file is a recording, whatever its name. A rosbag2 folder is one, with its files in the order of metadata.yaml or,
    where the recorder was killed before it wrote that, in the order of their numbers. In any other folder and below it,
    every .mcap file and every bag is a recording. A pattern with * ** ? or [ stands for all that it matches.

    Args:
        arguments: Paths or patterns.
        join: Take all files as one recording, under the name of the first.
        refused: Collects the errors of arguments, and of bags in folders, where others are good; None to raise them.

    Returns:
        The recordings in the order of the arguments, those of a folder or pattern by name (10 after 9). No file is in
        two of them.

    Raises:
        LogError: An argument is missing, holds no recording, or is a bag that navirl cannot read.
    """
    errors: list[LogError] = []
    found = [source for argument in arguments for source in _attempted(_of_argument, argument, errors)]
    sources = _once([source for source in found if _readable(source, errors)])
    if errors and (refused is None or not sources):
        raise errors[0]
    if refused is not None:
        refused += errors
    if not join or not sources:
        return [_with_hint(source) for source in sources]
    joined = sources[0]
    for part in sources[1:]:
        joined = Source(joined.name, joined.files + part.files, joined.damage + part.damage, joined.notes + part.notes)
    return [joined]


def _attempted(
    find: Callable[[Any, list[LogError]], list[Source]], argument: Path | str, errors: list[LogError]
) -> list[Source]:
    """The recordings found; none after an error, which is kept."""
    try:
        return find(argument, errors)
    except LogError as error:
        errors.append(error)
        return []


def _of_argument(argument: Path | str, errors: list[LogError]) -> list[Source]:
    """The recordings of one argument."""
    path, text = path_of(argument), os.fspath(argument)
    if _is_folder(path):
        found = _recordings(path, set(), errors)
        if not found and not errors:
            raise LogError(f"{path}: expected .mcap files in this folder or below it, found {_content(path)}")
        return found
    if not isinstance(path, Remote) and not _mode(path) and any(sign in text for sign in "*?["):
        return _of_pattern(text, errors)
    check_path(path)
    return [Source(path.name, (path,))]


def _content(folder: Path) -> str:
    """The content of a folder without recordings, and the remedy."""
    entries = _listing(folder)
    for entry in entries:
        if entry.suffix == ".bag":
            return f"{entry.name}; convert it: {CONVERT.format(path=entry, stem=entry.stem)}"
        if entry.suffix == ".db3":
            made = CONVERT.format(path=folder, stem=folder.resolve().name)
            return f"{entry.name}; make metadata.yaml of it by `ros2 bag reindex`, then convert the folder: {made}"
    return f"{_some(entries) or 'an empty one'}; give the folder that holds the recordings"


def _of_pattern(pattern: str, errors: list[LogError]) -> list[Source]:
    """The recordings that a pattern matches."""
    matches = sorted({Path(match) for match in glob.iglob(pattern, recursive=True)}, key=_natural)  # noqa: PTH207
    folders = {match for match in matches if _is_folder(match)}
    # files in a folder that matches are found with the folder
    matches = [match for match in matches if not folders.intersection(match.parents)]
    others = [match for match in matches if match not in folders and not _MCAP.fullmatch(match.name)]
    seen: set[Path] = set()
    found: list[Source] = []
    for match in matches:
        if match in folders:
            found += _recordings(match, seen, errors)
        elif match not in others:
            found.append(Source(match.name, (match,)))
    if found and others:
        note = f"{pattern}: {len(others)} other files match and are left out: {_some(others)}"
        found[0] = replace(found[0], notes=(*found[0].notes, note))
    # without any name of an MCAP file the others are meant: reading them gives the error
    found = found or [Source(file.name, (file,)) for file in others]
    if not found and not errors:
        matched = f"folders without any ({_some(matches)})" if matches else "no file"
        raise LogError(
            f"{pattern}: expected a pattern that matches recordings, found one that matches {matched}; check it"
        )
    return found


def _recordings(folder: Path, seen: set[Path], errors: list[LogError]) -> list[Source]:
    """The recordings in a folder and below it, possibly none; folders in `seen` are skipped."""
    here = folder.resolve()
    if here in seen:
        return []
    seen.add(here)
    entries = _listing(folder)
    files = [entry for entry in entries if _MCAP.fullmatch(entry.name) and not _is_folder(entry)]
    bag = _of_metadata(folder, here.name, files) if folder / METADATA in entries else Source(here.name, ())
    if bag.files:
        return [bag]
    found = _loose(folder, here.name, files)
    for entry in entries:
        if _is_folder(entry):
            found += _attempted(lambda below, errors: _recordings(below, seen, errors), entry, errors)
    if found:
        found[0] = replace(found[0], damage=bag.damage + found[0].damage, notes=bag.notes + found[0].notes)
    elif bag.damage:
        missing = _some([damage.path for damage in bag.damage])
        raise LogError(
            f"{folder}: expected the files that metadata.yaml lists ({missing}), found none of them; copy them into it"
        )
    return found


def _of_metadata(folder: Path, name: str, files: Sequence[Path]) -> Source:
    """The recording that metadata.yaml describes; without files where it is unusable or all its files are missing."""
    try:
        listed, info = _listed(folder / METADATA)
    except LogError as error:
        return Source(name, (), (), (str(error),))
    _refuse_foreign(folder, listed, info)
    damage, notes, there = [], [], []
    for wanted in listed:
        file = _same(folder / wanted, files)
        if file is None:
            damage.append(Damage(folder / wanted, 0, 0, "listed in metadata.yaml, but missing; its messages are lost"))
        else:
            there.append(file)
            if file.name != wanted:
                notes.append(f"{name}: metadata.yaml lists {wanted}; {file.name} is read for it")
    if left := [file.name for file in files if file not in there]:
        notes.append(f"{name}: metadata.yaml does not list {', '.join(left)}; left out")
    return Source(name, tuple(there), tuple(damage), tuple(notes) if there else ())


def _listed(path: Path) -> tuple[list[str], Mapping[Any, Any]]:
    """The names of a bag's files by its metadata.yaml, and the rest of its content."""
    remedy = "the folder's files are taken without it"
    info = read_mapping(path, remedy).get(_INFO)
    if not isinstance(info, dict):
        raise LogError(f"{path}: key {_INFO}: expected keys and values, found {brief(info)}; {remedy}")
    listed = info.get("relative_file_paths")
    if not listed and isinstance(info.get("files"), list):
        listed = [entry.get("path") if isinstance(entry, dict) else None for entry in info["files"]]
    if not isinstance(listed, list) or not listed or not all(isinstance(name, str) and name for name in listed):
        raise LogError(f"{path}: key relative_file_paths: expected names of files, found {brief(listed)}; {remedy}")
    # old recorders put the folder's name before that of the file
    return [PurePosixPath(name).name for name in listed], info


def _refuse_foreign(folder: Path, listed: Iterable[str], info: Mapping[Any, Any]) -> None:
    """Refuse a bag whose files or messages navirl cannot read."""
    if info.get("storage_identifier") == "sqlite3" or any(".db3" in PurePosixPath(name).suffixes for name in listed):
        found = "a ROS 2 bag in SQLite"
    elif str(info.get("compression_mode")).lower() == "message" and info.get("compression_format") != "zstd":
        packed = brief(info.get("compression_format"))
        found = f"one whose messages are compressed one by one (compression_mode: MESSAGE) by {packed}, not by zstd"
    else:
        return
    made = CONVERT.format(path=folder, stem=folder.resolve().name)
    raise LogError(f"{folder}: expected a bag in MCAP, found {found}; convert it: {made}")


def _same(wanted: Path, files: Sequence[Path]) -> Path | None:
    """A file by its name, else the same one with or without whole-file compression."""
    if stat.S_ISREG(_mode(wanted)):
        return wanted
    return next((file for file in files if _plain(file) == _plain(wanted)), None)


def _loose(folder: Path, name: str, files: Sequence[Path]) -> list[Source]:
    """The recordings among files without metadata.yaml: pieces named like the folder are one recording."""
    chosen: dict[str, Path] = {}
    # a plain file goes before its compressed forms
    for file in files:
        chosen.setdefault(_plain(file), file)
    pieces = _pieces(name, chosen.values())
    found = [Source(name, tuple(pieces.values()), tuple(_missing_pieces(folder, name, pieces)))] if pieces else []
    alone = set(chosen.values()).difference(pieces.values())
    found += [Source(file.name, (file,)) for file in files if file in alone]
    if left := [file.name for file in files if file not in chosen.values()]:
        note = f"{name}: left out as compressed copies of other files: {', '.join(left)}"
        found[0] = replace(found[0], notes=(note,))
    return found


def _pieces(name: str, files: Iterable[Path]) -> dict[int, Path]:
    """The files that rosbag2 would write into a folder of this name, by their numbers in order."""
    pattern = re.compile(re.escape(name) + r"_(0|[1-9][0-9]*)\.mcap", re.IGNORECASE)
    found = {int(match[1]): file for file in files if (match := pattern.fullmatch(_plain(file)))}
    # a date is not the number of a piece
    limit = max(1000, 2 * len(found))
    return {number: found[number] for number in sorted(found) if number < limit}


def _missing_pieces(folder: Path, name: str, numbers: Iterable[int]) -> Iterator[Damage]:
    """The pieces missing before and between those found; rosbag2 counts from 0."""
    following = 0
    for number in numbers:
        if number > following:
            upto = f" and those up to {name}_{number - 1}.mcap" if number - following > 1 else ""
            reason = f"missing, while later pieces of the recording exist; its messages{upto} are lost"
            yield Damage(folder / f"{name}_{following}.mcap", 0, 0, reason)
        following = number + 1


def _readable(source: Source, errors: list[LogError]) -> bool:
    """Whether a recording's files can be read; if not, the reason is kept."""
    try:
        for file in source.files:
            check_path(file)
    except LogError as error:
        errors.append(error)
        return False
    return True


def _once(sources: Sequence[Source]) -> list[Source]:
    """Read no file twice, also not through a link; of two recordings the one with more files keeps it."""
    owners: dict[tuple[int, int], int] = {}
    files: defaultdict[int, list[Path]] = defaultdict(list)
    notes: defaultdict[int, list[str]] = defaultdict(list)
    for number in sorted(range(len(sources)), key=lambda number: -len(sources[number].files)):
        for file in sources[number].files:
            key = (file.stat().st_dev, file.stat().st_ino)
            if key in owners:
                notes[owners[key]].append(f"{file} is given more than once; read once")
            else:
                owners[key] = number
                files[number].append(file)
    return [
        replace(sources[number], files=tuple(files[number]), notes=(*sources[number].notes, *notes[number]))
        for number in sorted(files)
    ]


def _with_hint(source: Source) -> Source:
    """A file given alone, with a note where it is a piece of a longer recording."""
    file = source.files[0]
    folder = file.absolute().parent
    if isinstance(file, Remote) or source.name != file.name or not _pieces(folder.name, [file]):
        return source
    pieces = _pieces(folder.name, folder.glob(f"{glob.escape(folder.name)}_*"))
    if len(pieces) < 2:
        return source
    note = f"{file.name} is one of {len(pieces)} pieces of a recording; give the folder {folder} to read them as one"
    return replace(source, notes=(*source.notes, note))


def _plain(file: Path) -> str:
    """A file's name without the ending of whole-file compression."""
    match = _MCAP.fullmatch(file.name)
    return match[1] if match else file.name


def _natural(path: Path) -> tuple[list[str | int], str]:
    """Sorts piece 10 after piece 9."""
    parts = re.split(r"([0-9]+)", str(path).casefold())
    return [int(part) if number % 2 else part for number, part in enumerate(parts)], str(path)


def _some(paths: Sequence[Path]) -> str:
    """Up to three names."""
    return ", ".join([path.name for path in paths[:3]] + ["..."] * (len(paths) > 3))


def _listing(folder: Path) -> list[Path]:
    """The content of a folder, by name, without hidden files."""
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise LogError(f"{folder}: expected a readable folder, found: {error.strerror}; check its rights") from error
    return sorted(entries, key=_natural)


def _is_folder(path: Path) -> bool:
    return stat.S_ISDIR(_mode(path))


def _mode(path: Path) -> int:
    """The mode of a path, 0 where it does not exist."""
    try:
        return path.stat().st_mode
    except OSError:
        return 0
