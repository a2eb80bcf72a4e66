"""From the logs that a user names to demonstrations: one bad recording does not spoil the others."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from traceback import extract_tb

from navirl_cli.cluster import Cluster
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import Extraction, ExtractSettings, extract, numbered
from navirl_cli.demos.labelling import check_agreement
from navirl_cli.demos.labels import Label, Labels, labels_by_source
from navirl_cli.errors import (
    DemonstrationError,
    LabelError,
    LogError,
    NavirlError,
    TruncatedError,
    WorkerLostError,
    brief,
    counted,
    joined,
    refuse_beside,
)
from navirl_cli.files import Input
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.messages.reader import Progress
from navirl_cli.logs.roles.topics import HOLDS
from navirl_cli.logs.sources import Source, sources_of
from navirl_cli.parallel import as_completed
from navirl_cli.remote import Remote, path_of

#: The hashes of a recording's files, and its demonstrations.
_Result = tuple[tuple[Input, ...], Extraction]
#: A recording, and what is stated of its trials.
Job = tuple[Source, tuple[Label, ...]]


@dataclass(frozen=True)
class Recordings:
    """The demonstrations of several recordings."""

    #: Of the recordings that gave demonstrations, in the order of the arguments.
    extractions: tuple[Extraction, ...]
    #: The files of these recordings.
    inputs: tuple[Input, ...]
    #: The recordings that gave none, each with the reason.
    left_out: tuple[str, ...]
    #: What is unusual about the table of labels, as ``name: text``.
    label_notes: tuple[str, ...] = ()

    def demonstrations(self) -> list[Demonstration]:
        """All demonstrations, with unique ids."""
        return numbered(self.extractions)

    def notes(self, demonstrations: Iterable[Demonstration]) -> list[str]:
        """What is unusual about recordings and about their demonstrations, as ``name: text``."""
        notes = [*self.label_notes, *(note for one in self.extractions for note in (*one.notes, *one.fetched))]
        return [*notes, *(f"{one.id}: {note}" for one in demonstrations for note in one.notes)]

    @property
    def lost(self) -> list[str]:
        """What was left out, damaged or skipped."""
        return [*self.left_out, *(line for one in self.extractions for line in (*one.damage, *one.skipped))]


def check_no_wrench(
    *, gain: bool, wrench_frame: str | None, force_scale: float, topics: Mapping[str, Collection[str]]
) -> None:
    """Refuse what needs the wrench, beside the wish to leave it out; arguments as of the extraction.

    Raises:
        ArgumentError: Something does.
    """
    needing = {"gain": gain, "wrench_frame": wrench_frame, "force_scale": force_scale != 1}
    refuse_beside(
        "`no_wrench` leaves out the wrench, which these need",
        {**needing, "topic wrench": "wrench" in topics},
        "`no_wrench`",
    )


def extract_recordings(
    logs: Sequence[Path | str],
    settings: ExtractSettings,
    options: LoadOptions,
    *,
    join: bool = False,
    labels: Labels | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Recordings:
    """Extract every recording among the arguments.

    Args:
        logs: Files, folders and patterns, as in :func:`navirl_cli.logs.sources.sources_of`.
        settings: Of the extraction.
        options: The user's choices about the logs.
        join: Whether all are pieces of one recording.
        labels: What the experimenter states of the trials.
        executor: Where to work on several recordings; by default local processes.
        progress: Called with bytes done and bytes in all.

    Returns:
        Their demonstrations, and the recordings that gave none.

    Raises:
        NavirlError: No recording gave a demonstration, or labels do not fit the logs or the settings.
    """
    sources, refused = sources_for(logs, executor, join=join)
    rows, label_notes = rows_of(labels, sources, settings)
    # a lone recording is read here, so that the progress can follow its bytes
    alone = len(sources) + len(refused) == 1
    work = partial(extracted, settings=settings, options=options, progress=progress if alone else None, alone=alone)
    good: dict[tuple[str, ...], _Result] = {}
    failed: list[NavirlError] = [*refused]
    for source, result in zip(sources, _results(work, sources, rows, executor, progress), strict=True):
        if isinstance(result, LabelError):
            raise result
        if isinstance(result, NavirlError):
            failed.append(result)
        elif (key := tuple(sorted(file.sha256 for file in result[0]))) in good:
            failed.append(DemonstrationError(f"{source.name}: the same recording as {good[key][1].log}"))
        else:
            good[key] = result
    if len(failed) == 1 and not good:
        raise failed[0]
    if not good:
        kind = TruncatedError if all(isinstance(error, TruncatedError) for error in failed) else DemonstrationError
        raise kind(f"none of {counted(len(failed), 'log')} can be used: {joined(_counted_reasons(failed))}")
    return Recordings(
        tuple(extraction for _, extraction in good.values()),
        tuple(file for files, _ in good.values() for file in files),
        tuple(f"left out: {error}" for error in failed),
        tuple(label_notes),
    )


def sources_for(
    logs: Sequence[Path | str], executor: Executor | None, *, join: bool
) -> tuple[list[Source], list[LogError]]:
    """The recordings among the arguments, and why others are none; arguments as in :func:`extract_recordings`."""
    refused: list[LogError] = []
    if isinstance(executor, Cluster):  # whose workers have another working directory
        logs = [path_of(log).absolute() for log in logs]
    # where all are pieces of one recording none may be missing
    return sources_of(logs, join=join, refused=None if join else refused), refused


def rows_of(
    labels: Labels | None, sources: Sequence[Source], settings: ExtractSettings
) -> tuple[list[tuple[Label, ...]], list[str]]:
    """The rows of labels of each recording, and notes on the others."""
    if labels is None:
        return [()] * len(sources), []
    stated = {name: (name, getattr(settings, name)) for name in ("participant", "condition", "cycle", "set")}
    radius, people = ("robot_radius", settings.robot_radius_m), ("person", settings.people_m)
    check_agreement(labels, {**stated, "robot_radius_m": radius, "people_m": people})
    return labels_by_source(labels, sources)


def _fetched(source: Source) -> tuple[str, ...]:
    """What was read of the objects of a recording."""
    remote = [path.fetched for path in source.files if isinstance(path, Remote)]
    if not remote:
        return ()
    done, size = sum(one.size_read for one in remote) / 1e6, sum(one.size for one in remote) / 1e6
    return (
        f"{source.name}: {done:.1f} of {size:.1f} MB were fetched in {sum(one.requests for one in remote)} requests",
    )


def _counted_reasons(failed: Iterable[NavirlError]) -> list[str]:
    """Each reason once, with the log or the number of logs that it concerns; the commonest first."""
    logs: dict[str, list[str]] = {}
    for error in failed:
        log, colon, reason = str(error).partition(": ")
        # of the topics that a log holds, another log may hold others
        key = (reason if colon else log).partition(HOLDS)[0]
        logs.setdefault(key, []).append(log if colon else "")
    ordered = sorted(logs.items(), key=lambda item: -len(item[1]))
    return [f"{own[0] if len(own) == 1 else f'{len(own)} logs'}: {reason}" for reason, own in ordered]


def _results(
    work: Callable[[Job], _Result | NavirlError],
    sources: Sequence[Source],
    rows: Sequence[tuple[Label, ...]],
    executor: Executor | None,
    progress: Progress | None,
) -> list[_Result | NavirlError]:
    """The results of sources in their order, their bytes counted as they are done."""
    sizes = [sum(path.stat().st_size for path in source.files) for source in sources]
    found: dict[int, _Result | NavirlError] = {}
    done = 0
    for number, future in as_completed(work, list(zip(sources, rows, strict=True)), executor):
        error = future.exception()
        lost = isinstance(error, WorkerLostError)
        found[number] = WorkerLostError(f"{sources[number].name}: {error}") if lost else future.result()
        done += sizes[number]
        if progress is not None:
            progress(done, sum(sizes))
    return [found[number] for number in range(len(sources))]


def extracted(
    job: Job,
    settings: ExtractSettings,
    options: LoadOptions,
    progress: Progress | None,
    *,
    alone: bool,
) -> _Result | NavirlError:
    """One recording's files and demonstrations, or the reason why it gave none.

    Among others also an unexpected error is a reason: one log never spoils the others.
    """
    source, labels = job
    try:
        with ThreadPoolExecutor(1) as pool:
            local = [path for path in source.files if not isinstance(path, Remote)]
            hashes = pool.submit(lambda: {path: Input.of(path) for path in local})
            extraction = extract(load_recording(source, options, progress), settings, labels)
            hashed = hashes.result()
        # of an object in a store only what was read counts, which is known now
        inputs = tuple(hashed[path] if path in hashed else Input.of(path) for path in source.files)
        return inputs, replace(extraction, fetched=_fetched(source))
    except NavirlError as error:
        return error
    except Exception as error:
        if alone:
            raise
        last = extract_tb(error.__traceback__)[-1]
        return LogError(
            f"{source.name}: an unexpected error, {type(error).__name__}: {brief(str(error))} "
            f"({Path(last.filename).name}:{last.lineno}); extract this log alone to see the traceback, and report it"
        )
