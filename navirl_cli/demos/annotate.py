"""Labels into a copy of a log, as its session record."""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import getpid
from pathlib import Path

from navirl_cli.demos.labelling import labelled
from navirl_cli.demos.labels import Labels, labels_by_source
from navirl_cli.demos.listing import TrialSettings, recording_of, trials_in
from navirl_cli.errors import ArtefactError, LabelError, LogError, brief
from navirl_cli.files import replacing
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.insertion import is_walked, write_with_metadata, writing
from navirl_cli.logs.load import LoadOptions
from navirl_cli.logs.messages.reader import Contents, Progress, scan
from navirl_cli.logs.recording import SESSION_RECORD
from navirl_cli.logs.roles.session import session_values
from navirl_cli.logs.sources import Source, sources_of

#: Whole-file compression by the ending of a file's name.
_COMPRESSIONS = {".zst": "zstd", ".zstd": "zstd", ".lz4": "lz4"}


@dataclass(frozen=True)
class Annotated:
    """A log that was written."""

    path: Path
    #: The trials, and those of them that the table names.
    trials: int
    labelled: int
    #: What a reader should know, and the damage that the copy shares with the log.
    notes: tuple[str, ...]
    damage: tuple[str, ...]


def annotate(
    log: Path,
    labels: Labels,
    output: Path,
    settings: TrialSettings,
    options: LoadOptions,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Annotated:
    """Copy a log with a session record that states what a table states of its trials.

    An extraction of the copy gives the demonstrations that one of the log with the table gives.

    Args:
        log: A file, or the folder of one recording.
        labels: The table; rows of other logs are not used.
        output: The file to write; for a folder a new folder.
        settings: Where trials start.
        options: The user's choices about the log.
        force: Whether to replace an existing file. A folder is never replaced.
        progress: Called with bytes done and bytes in all.

    Raises:
        NavirlError: The log cannot be read or the copy not written, or a row fits no trial.
    """
    source = _only_source(log)
    (rows,), notes = labels_by_source(labels, [source])
    recording, trials = trials_in(recording_of(source, options, progress), settings)
    stating = sum(row.states for row in rows)
    if not stating:
        raise LabelError(
            f"{labels.path}: expected labels in the rows of {source.name}, found empty cells; fill them in"
        )
    session = labelled(recording, trials, rows)
    values = {} if session == recording.session else session_values(session)
    contents = [_scanned(path) for path in source.files]
    # readers take the last record of a name, in the last file that has one
    having = [number for number, one in enumerate(contents) if SESSION_RECORD in one.metadata]
    number = having[-1] if having else 0
    before = contents[number].metadata[SESSION_RECORD][-1] if having else {}
    merged = {**before, **{key: value for key, value in values.items() if not _same(before.get(key), value)}}
    if log.is_dir():
        inside = source.files[number].absolute().relative_to(log.absolute())
        with _new_copy(log, output, without=inside) as copy:
            _write(source.files[number], copy / inside, inside.suffix, merged)
    else:
        with replacing(output, force=force) as temporary:
            _write(source.files[0], temporary, output.suffix, merged)
    damage = tuple(str(one) for one in (*source.damage, *(one for content in contents for one in content.damage)))
    return Annotated(output, len(trials), stating, (*notes, *_record_notes(source, before, merged)), damage)


def _only_source(log: Path) -> Source:
    """The recording of the argument, which must be one."""
    sources = sources_of([log])
    if len(sources) > 1:
        raise LogError(f"{log}: expected one recording, found {len(sources)}; annotate them one by one")
    return sources[0]


def _scanned(path: Path) -> Contents:
    with open_log(path) as file:
        return scan(file)


def _same(before: str | None, after: str) -> bool:
    """Whether two values of a record are the same, as texts or as JSON."""
    try:
        return before is not None and (before == after or json.loads(before) == json.loads(after))
    except ValueError:
        return False


def _record_notes(source: Source, before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """What became of an earlier record."""
    if not before:
        return []
    changed = [key for key in after if key in before and before[key] != after[key]]
    added = [key for key in after if key not in before]
    kept = [key for key in before if key not in changed]
    parts = (("changed", changed), ("added", added), ("kept", kept))
    words = "; ".join(f"{word}: {', '.join(keys)}" for word, keys in parts if keys)
    return [f"{source.name}: a session record stands in the log already; the copy's own counts in its place ({words})"]


def _write(log: Path, target: Path, ending: str, values: Mapping[str, str]) -> None:
    """Write the copy of one file, compressed by its name's ending, and read it back."""
    with open_log(log) as raw:
        if raw.damage:
            raise LogError(
                f"{log}: expected a file that decompresses, found: {raw.damage[0].reason}; decompress what is left of "
                "it, and annotate that"
            )
        before = scan(raw)
        # behind damage that ends a walk the record would not be found
        for in_front in (False, True) if is_walked(raw) else (False,):
            with writing(target, _COMPRESSIONS.get(ending.lower(), "")) as stream:
                write_with_metadata(raw, stream, SESSION_RECORD, values, in_front=in_front)
            after = _scanned(target)
            found = after.metadata.get(SESSION_RECORD, ({},))[-1]
            if found == dict(values) and after.counts == before.counts and bool(after.damage) == bool(before.damage):
                return
    raise LogError(
        f"{log}: expected a log that takes another session record, found one that is damaged where the record would "
        "stand; repair a copy with `mcap recover` first"
    )


@contextmanager
def _new_copy(folder: Path, output: Path, *, without: Path) -> Iterator[Path]:
    """A copy of a folder but for one file, under a temporary name until the block ends well."""
    if output.exists() or output.is_symlink():
        raise ArtefactError(f"{output}: exists already; choose another name, because folders are never replaced")
    if output.absolute().is_relative_to(folder.absolute()):
        raise ArtefactError(
            f"{output}: expected a folder outside of {folder}, found one in it; choose another `output`"
        )
    temporary = output.with_name(f".{output.name[:40]}.{getpid()}.tmp")
    left_out = folder / without

    def ignored(parent: str, names: list[str]) -> list[str]:
        return [name for name in names if Path(parent, name) == left_out]

    try:
        shutil.copytree(folder, temporary, ignore=ignored)
        yield temporary
        temporary.rename(output)
    except OSError as error:
        raise ArtefactError(f"{output}: cannot be written: {error.strerror or brief(error)}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
