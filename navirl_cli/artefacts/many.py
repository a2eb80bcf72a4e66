"""Many logs to a folder of demonstrations files, one a log, with a manifest.

A log whose files and options have not changed since is not read again. One bad log does not stop the others. An
interrupt keeps what is finished.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from navirl_cli import __version__
from navirl_cli.artefacts.demonstrations import demonstrations_document, gain_document
from navirl_cli.artefacts.manifest import DONE, FAILED, LOST, Entry, Part, hash_of, read_manifest, write_manifest
from navirl_cli.artefacts.store import as_bytes
from navirl_cli.demos.extract import ExtractSettings, numbered
from navirl_cli.demos.labels import Label, Labels
from navirl_cli.demos.recordings import Job, extracted, rows_of, sources_for
from navirl_cli.errors import ArtefactError, DemonstrationError, LabelError, NavirlError, WorkerLostError, counted
from navirl_cli.files import MANIFEST, Input, new_folder, replacing
from navirl_cli.logs.load import LoadOptions
from navirl_cli.logs.sources import Source
from navirl_cli.parallel import as_completed
from navirl_cli.remote import Remote

#: The manifest is written again when this many times the duration of the last writing have passed, and this time, s.
_TIMES: Final = 20
_LEAST_S: Final = 2.0

#: Called with bytes done and in all, and a text.
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Written:
    """What a worker sends back of a log."""

    #: The demonstrations file.
    content: bytes
    inputs: tuple[Input, ...]
    trials: int
    demonstrations: int
    lost: tuple[str, ...]
    notes: tuple[str, ...]
    fetched: tuple[str, ...]


@dataclass(eq=False)
class Folder:
    """Extraction of many logs into a folder."""

    path: Path
    settings: ExtractSettings
    options: LoadOptions
    #: The settings as artefacts state them, and the files of options.
    said: Mapping[str, Any]
    files: Sequence[Input] = ()
    #: By address of the first file, in the order in which logs were named first.
    entries: dict[str, Entry] = field(default_factory=dict)
    #: Number of logs that were not read again.
    unchanged: int = 0
    #: What was read of objects in a store, by address. A manifest does not keep it: the next run reads something else.
    _fetched: dict[str, tuple[str, ...]] = field(default_factory=dict)
    #: Addresses in the order of the manifest, and the names of demonstrations files by address. Both are chosen before
    #: the work, so that they do not depend on which log is done first.
    _order: list[str] = field(default_factory=list)
    _names: dict[str, str] = field(default_factory=dict)
    _taken: set[str] = field(default_factory=lambda: {MANIFEST})

    def extract(
        self,
        logs: Sequence[Path | str],
        *,
        labels: Labels | None = None,
        join: bool = False,
        force: bool = False,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> list[Entry]:
        """Extract logs.

        Args:
            logs: As in :func:`navirl_cli.logs.sources.sources_of`.
            labels: What the experimenter states of the trials.
            join: Whether all are pieces of one recording.
            force: Whether to replace demonstrations of other options.
            executor: Where to work on several logs; by default local processes.
            progress: Called as logs are done.

        Returns:
            All of these logs, unchanged ones too, and those that could not be named at all.

        Raises:
            ArtefactError: The folder holds demonstrations of other options, or cannot be written.
            NavirlError: No argument is a log, or labels do not fit.
        """
        sources, refused = sources_for(logs, executor, join=join)
        rows, notes = rows_of(labels, sources, self.settings)
        with new_folder(self.path):
            self._open(force=force)
            parts = [_parts(source) for source in sources]
            self._order = list(dict.fromkeys([*self.entries, *(own[0].address for own in parts)]))
            for source, own in zip(sources, parts, strict=True):
                self._name(source.name, own[0].address)
            open_ = [number for number in range(len(sources)) if not self._is_known(sources[number], parts[number])]
            self.unchanged = len(sources) - len(open_)
            jobs = [(sources[number], rows[number]) for number in open_]
            try:
                self._work(jobs, [parts[number] for number in open_], executor, progress)
            finally:
                self._leave_out_twins()
                self._save()
        found = [self.entries[own[0].address] for own in parts]
        failed = [Entry(str(error).partition(": ")[0], (), "", FAILED, str(error)) for error in refused]
        if notes and found:
            found[0] = replace(found[0], notes=(*notes, *found[0].notes))
        return [*found, *failed]

    @property
    def fetched(self) -> list[str]:
        """What was read of objects in a store."""
        return [line for address in self._order for line in self._fetched.get(address, ())]

    @property
    def _options_sha256(self) -> str:
        """Changes with everything besides the log that demonstrations depend on."""
        stated = [self.said, __version__, [vars(one) for one in self.files]]
        return hash_of(json.dumps(stated, sort_keys=True, default=str).encode())

    def _open(self, *, force: bool) -> None:
        """Take over the entries of an earlier extraction."""
        if not (self.path / MANIFEST).exists():
            return
        self.entries = {one.address: one for one in read_manifest(self.path)}
        self._names = {address: one.file for address, one in self.entries.items() if one.file is not None}
        self._taken.update(self._names.values())
        others = [one for one in self.entries.values() if one.options_sha256 != self._options_sha256]
        if others and not force:
            raise ArtefactError(
                f"{self.path}: expected an empty folder or one of the same options and version of navirl, found "
                f"demonstrations of other ones ({others[0].log}); choose another `output`, or replace them with `force`"
            )

    def _is_known(self, source: Source, parts: Sequence[Part]) -> bool:
        """Whether a log was extracted already; its entry is brought up to date."""
        known = self.entries.get(parts[0].address)
        if known is None or known.options_sha256 != self._options_sha256 or known.status == LOST:
            return False
        if len(known.files) != len(parts) or (known.file is not None and not (self.path / known.file).is_file()):
            return False
        stated = [(one.address, one.size_bytes) for one in known.files]
        if stated != [(one.address, one.size_bytes) for one in parts]:
            return False
        if [one.etag for one in known.files] != [one.etag for one in parts]:
            if any(isinstance(file, Remote) for file in source.files):
                return False
            if [one.sha256 for one in known.files] != [Input.of(file).sha256 for file in source.files]:
                return False
            files = tuple(replace(one, etag=new.etag) for one, new in zip(known.files, parts, strict=True))
            self.entries[known.address] = replace(known, files=files)
        return True

    def _work(
        self,
        jobs: Sequence[Job],
        parts: Sequence[Sequence[Part]],
        executor: Executor | None,
        progress: Progress | None,
    ) -> None:
        """Extract logs, and write each as it is done."""
        work = partial(_written, settings=self.settings, options=self.options, said=self.said, files=tuple(self.files))
        sizes = [sum(part.size_bytes for part in own) for own in parts]
        done, following = 0, time.monotonic() + _LEAST_S
        for count, (number, future) in enumerate(as_completed(work, jobs, executor), 1):
            result = future.exception() or future.result()
            if isinstance(result, LabelError) or not isinstance(result, NavirlError | Written):
                raise result
            self._keep(jobs[number][0], parts[number], result)
            done += sizes[number]
            if progress is not None:
                progress(
                    done,
                    sum(sizes),
                    f"{count} of {counted(len(jobs), 'log')}, {done / 1e6:.1f} of {sum(sizes) / 1e6:.1f} MB",
                )
            if time.monotonic() > following:
                following = time.monotonic() + max(_LEAST_S, _TIMES * self._save())

    def _keep(self, source: Source, parts: Sequence[Part], result: NavirlError | Written) -> None:
        """Write a log's demonstrations and add its entry."""
        entry = Entry(source.name, tuple(parts), self._options_sha256, DONE)
        if isinstance(result, WorkerLostError):
            entry = replace(entry, status=LOST, reason=f"{source.name}: {result}")
        elif isinstance(result, NavirlError):
            entry = replace(entry, status=FAILED, reason=str(result), files=_hashed(source, parts))
        else:
            hashes = [one.sha256 for one in result.inputs]
            files = tuple(replace(part, sha256=own) for part, own in zip(parts, hashes, strict=True))
            entry = self._stored(replace(entry, files=files), result)
            self._fetched[entry.address] = result.fetched
        self.entries[entry.address] = entry

    def _stored(self, entry: Entry, result: Written) -> Entry:
        """The entry of a log whose demonstrations are written now."""
        name = self._names[entry.address]
        with replacing(self.path / name, force=True) as temporary:
            temporary.write_bytes(result.content)
        return replace(
            entry,
            file=name,
            file_sha256=hash_of(result.content),
            trials=result.trials,
            demonstrations=result.demonstrations,
            lost=result.lost,
            notes=result.notes,
        )

    def _name(self, log: str, address: str) -> None:
        """Choose the name of a log's file: the log's, with a hash of its address where another log has it."""
        if address in self._names:
            return
        plain = log.partition(".mcap")[0] or "log"
        name = f"{plain}.json"
        if name in self._taken:
            name = f"{plain}-{hash_of(address.encode())[:16]}.json"
        self._names[address] = name
        self._taken.add(name)

    def _leave_out_twins(self) -> None:
        """Of logs of the same bytes only the first counts."""
        first: dict[tuple[str, ...], Entry] = {}
        for address in self._order:
            entry = self.entries.get(address)
            if entry is None or entry.file is None:
                continue
            twin = first.setdefault(_hashes(entry), entry)
            if twin is not entry:
                (self.path / entry.file).unlink(missing_ok=True)
                reason = f"{entry.log}: the same recording as {twin.address}"
                self.entries[address] = replace(
                    entry, status=FAILED, reason=reason, file=None, file_sha256=None, demonstrations=0
                )

    def _save(self) -> float:
        """Write the manifest; return how long that took, s."""
        begin = time.monotonic()
        write_manifest(self.path, self.said, [self.entries[one] for one in self._order if one in self.entries])
        return time.monotonic() - begin


def _hashes(entry: Entry) -> tuple[str, ...]:
    """What two logs of the same bytes share."""
    return tuple(sorted(str(one.sha256) for one in entry.files))


def _parts(source: Source) -> tuple[Part, ...]:
    """The files of a recording, without reading them."""
    found = []
    for file in source.files:
        if isinstance(file, Remote):
            size, etag = file.fetched.size, file.fetched.etag
        else:
            status = file.stat()
            size, etag = status.st_size, f"{status.st_ino:x}-{status.st_size:x}-{status.st_mtime_ns:x}"
        found.append(Part(str(file.absolute()), size, etag, None))
    return tuple(found)


def _hashed(source: Source, parts: Sequence[Part]) -> tuple[Part, ...]:
    """The files of a log that failed, with their hashes where they can be read."""
    try:
        return tuple(
            replace(part, sha256=Input.of(file).sha256) for file, part in zip(source.files, parts, strict=True)
        )
    except NavirlError:
        return tuple(parts)


def _written(
    job: tuple[Source, tuple[Label, ...]],
    settings: ExtractSettings,
    options: LoadOptions,
    said: Mapping[str, Any],
    files: tuple[Input, ...],
) -> Written | NavirlError:
    """One recording's demonstrations file, or the reason why it gave none."""
    result = extracted(job, settings, options, progress=None, alone=False)
    if isinstance(result, NavirlError):
        return result
    inputs, extraction = result
    demonstrations = numbered([extraction])
    document = demonstrations_document(demonstrations, [*inputs, *files], said)
    if settings.gain:
        document["gain"] = gain_document([(extraction.log, extraction.gain)])
    notes = (*extraction.notes, *(f"{one.id}: {note}" for one in demonstrations for note in one.notes))
    lost = (*extraction.damage, *extraction.skipped)
    content = as_bytes("demonstrations", document)
    return Written(content, inputs, extraction.trials, len(demonstrations), lost, notes, extraction.fetched)


def check_some(entries: Sequence[Entry]) -> None:
    """Refuse a result without any demonstrations.

    Raises:
        DemonstrationError: No log gave one.
    """
    if not any(one.status == DONE for one in entries):
        raise DemonstrationError(f"none of {counted(len(entries), 'log')} can be used: {entries[0].reason}")
