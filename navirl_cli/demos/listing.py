"""The trials of recordings, to be labelled before or without an extraction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from navirl_cli.demos.checks import check_travel
from navirl_cli.demos.contact import PushSettings, contacts_within, pushes_of
from navirl_cli.demos.labelling import start_s
from navirl_cli.demos.lines import path_length_m
from navirl_cli.demos.trials import Split, Trial, entries_by_trial, trials_of, with_goal
from navirl_cli.errors import DemonstrationError
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.load import Forces, LoadOptions, load_recording
from navirl_cli.logs.messages.reader import Progress, scan
from navirl_cli.logs.recording import Declared, Occupancy, Recording
from navirl_cli.logs.roles.topics import choose, topics_of
from navirl_cli.logs.sources import Source


@dataclass(frozen=True)
class TrialSettings:
    """The user's choices about trials: those of the extraction that decide where trials start."""

    split: Split = Split.GOAL
    #: (x, y) m, map frame, in place of the log's goals.
    goal_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class FoundTrial:
    """A trial, and what the log states of it."""

    #: The log's name.
    log: str
    number: int
    #: Since the log's first pose, s.
    start_s: float
    duration_s: float
    length_m: float
    #: Time in contact, s; None where it is unknown.
    contact_s: float | None
    declared: Declared
    robot_radius_m: float | None


@dataclass(frozen=True)
class Listing:
    """The trials of one recording."""

    trials: tuple[FoundTrial, ...]
    #: What is unusual, and what is lost, in words.
    notes: tuple[str, ...]
    damage: tuple[str, ...]


def recording_of(source: Source, options: LoadOptions, progress: Progress | None = None) -> Recording:
    """A recording in which trials are found: map and wrench may be missing, as trials do not need them.

    Raises:
        LogError: As :func:`navirl_cli.logs.load.load_recording`.
    """
    contents = []
    for path in source.files:
        with open_log(path) as file:
            contents.append(scan(file))
    choices = choose(source.name, topics_of(contents), options.topics)
    if options.occupancy is None and not (choices["map"].topics or choices["map"].ambiguous):
        options = replace(options, occupancy=Occupancy(np.zeros((1, 1), dtype=np.int8), 1.0, (0.0, 0.0)))
    forces = Forces.OPTIONAL if options.forces is Forces.NEEDED else options.forces
    return load_recording(source, replace(options, forces=forces), progress)


def trials_in(recording: Recording, settings: TrialSettings) -> tuple[Recording, list[Trial]]:
    """The recording with the user's goal in place of its own, and its trials."""
    recording = with_goal(recording, settings.goal_m)
    return recording, trials_of(recording, settings.split)


def list_trials(
    source: Source, name: str, settings: TrialSettings, options: LoadOptions, progress: Progress | None = None
) -> Listing:
    """The trials that an extraction would find in a recording.

    Args:
        source: Its files.
        name: Of the log, by which a table of trials names it.
        settings: Where trials start.
        options: The user's choices about the log.
        progress: Called with bytes done and bytes in all.

    Returns:
        The trials in which the robot moves, with notes on the others.

    Raises:
        LogError: The log cannot be read.
        DemonstrationError: It has no goals at which trials could start.
    """
    recording, trials = trials_in(recording_of(source, options, progress), settings)
    if not trials:
        raise DemonstrationError(f"{recording.log}: no trial: no goal is announced while poses are recorded")
    pushes = None if recording.wrench is None else pushes_of(recording, PushSettings())
    known = entries_by_trial(recording.session.declared, recording, trials)
    found, empty = [], []
    for number, trial in enumerate(trials):
        xy, t_ns = recording.xy_m[trial.first : trial.stop], recording.t_ns[trial.first : trial.stop]
        try:
            check_travel(xy)
        except DemonstrationError:
            empty.append(number + 1)
            continue
        span = int(t_ns[0]), int(t_ns[-1])
        contacts = None if pushes is None else contacts_within(pushes, *span)
        declared = known.get(number, Declared(span[0]))
        found.append(
            FoundTrial(
                log=name,
                number=number + 1,
                start_s=start_s(recording, trial),
                duration_s=(span[1] - span[0]) / 1e9,
                length_m=path_length_m(xy),
                contact_s=None if contacts is None else sum(one.duration_s for one in contacts),
                declared=replace(declared, participant=declared.participant or recording.session.participant),
                robot_radius_m=recording.session.robot_radius_m,
            )
        )
    return Listing(tuple(found), (*recording.notes, *_empty_notes(recording, empty)), recording.damage)


def _empty_notes(recording: Recording, numbers: Sequence[int]) -> list[str]:
    """A line about trials that are no demonstrations."""
    if not numbers:
        return []
    which = f"trial{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"
    return [f"{recording.log}: {which} left out, because the robot hardly moves; extract leaves it out too"]
