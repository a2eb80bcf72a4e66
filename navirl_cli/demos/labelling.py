"""Which label belongs to which trial, and what the session states of trials with them."""

from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from navirl_cli.demos.labels import STATED, Label, Labels, points_text
from navirl_cli.demos.trials import SAME_START_S, Trial, entries_by_trial
from navirl_cli.errors import LabelError, Number
from navirl_cli.logs.recording import Declared, Recording, Session

#: Trials that a message proposes in place of an unknown one.
_NEAR = 3


def labelled(recording: Recording, trials: Sequence[Trial], rows: Sequence[Label]) -> Session:
    """The session with what the rows state in place of what it holds; empty cells change nothing.

    Args:
        recording: The log.
        trials: Its trials.
        rows: Of this log.

    Raises:
        LabelError: A row fits no trial, two rows fit one, or rows contradict each other about the robot.
    """
    session = recording.session
    by_trial = _by_trial(recording, trials, rows)
    known = entries_by_trial(session.declared, recording, trials)
    replaced = {id(entry) for number, entry in known.items() if number in by_trial}
    declared = [entry for entry in session.declared if id(entry) not in replaced]
    for number, row in by_trial.items():
        entry = known.get(number, Declared(int(recording.t_ns[trials[number].first])))
        declared.append(replace(entry, **_stated(row, entry.participant or session.participant)))
    declared.sort(key=lambda entry: entry.t_ns)
    radius_m = session.robot_radius_m if (stated_m := _radius_m(rows)) is None else stated_m
    return replace(session, declared=tuple(declared), robot_radius_m=radius_m)


def _stated(row: Label, participant: str | None) -> dict[str, Any]:
    """What a row states of its trial, by field of :class:`Declared`; a participant only where it is another one."""
    values = {name: getattr(row, name) for name in STATED if name != "robot_radius_m"}
    if row.participant == participant:
        del values["participant"]
    return {name: value for name, value in values.items() if value is not None}


def _radius_m(rows: Sequence[Label]) -> float | None:
    """The robot's radius, which all rows of a log share, m."""
    stating = [row for row in rows if row.robot_radius_m is not None]
    for row in stating[1:]:
        if row.robot_radius_m != stating[0].robot_radius_m:
            raise LabelError(
                f"{row.where}, column robot_radius_m: expected {stating[0].robot_radius_m:g} as in "
                f"{stating[0].where.rpartition(': ')[2]}, found {row.robot_radius_m:g}; a log has one robot"
            )
    return stating[0].robot_radius_m if stating else None


def _by_trial(recording: Recording, trials: Sequence[Trial], rows: Sequence[Label]) -> dict[int, Label]:
    """The row of each trial, by its place among the trials."""
    starts_s = [start_s(recording, trial) for trial in trials]
    found: dict[int, Label] = {}
    for row in rows:
        after = bisect_left(starts_s, row.start_s)
        near = sorted(
            range(max(after - _NEAR, 0), min(after + _NEAR, len(trials))), key=lambda n: _away(starts_s[n], row)
        )
        if not near or _away(starts_s[near[0]], row) > SAME_START_S:
            listed = ", ".join(f"{n + 1} at {starts_s[n]:.1f} s" for n in sorted(near[:_NEAR]))
            raise LabelError(
                f"{row.where}, column start_s: expected the start of a trial of {recording.log}, found "
                f"{row.start_s:g} s; " + (f"near are the trials {listed}" if near else "the log has no trials")
            )
        first = found.setdefault(near[0], row)
        if first is not row:
            raise LabelError(
                f"{row.where}: expected one row for each trial, found a second for trial {near[0] + 1} of "
                f"{recording.log} after that of {first.where.rpartition(': ')[2]}; remove one"
            )
    return found


def _away(at_s: float, row: Label) -> float:
    return abs(at_s - row.start_s)


def start_s(recording: Recording, trial: Trial) -> float:
    """When a trial starts, s since the log's first pose."""
    return float(recording.t_ns[trial.first] - recording.t_ns[0]) / 1e9


def check_agreement(labels: Labels, given: Mapping[str, Any]) -> None:
    """Refuse a table that contradicts what is stated for whole logs.

    Args:
        labels: The table.
        given: By column: the name of the argument and its value; None where it is not given.

    Raises:
        LabelError: A row states something else.
    """
    for row in labels.rows:
        for column, (argument, value) in given.items():
            stated = getattr(row, column)
            if value is not None and stated is not None and not np.array_equal(np.asarray(stated), np.asarray(value)):
                raise LabelError(
                    f"{row.where}, column {column}: expected {_shown(value)}, which `{argument}` states for all logs, "
                    f"found {_shown(stated)}; state it in one place"
                )


def _shown(value: Any) -> str:
    """A value as a message shows it."""
    return str(value) if isinstance(value, str | int | float) else points_text(value)


def stated_of(recording: Recording, trials: Sequence[Trial], given: Mapping[str, Any]) -> list[Declared]:
    """What is stated of each trial: by the user for all trials, else of the trial, else of the session.

    Args:
        recording: The log, with its labels.
        trials: Its trials.
        given: By field of :class:`Declared` what the user states of all trials; None where nothing.
    """
    given = {name: value for name, value in given.items() if value is not None}
    known = entries_by_trial(recording.session.declared, recording, trials)
    found = []
    for number, trial in enumerate(trials):
        own = known.get(number, Declared(int(recording.t_ns[trial.first])))
        own = replace(own, participant=own.participant or recording.session.participant)
        found.append(replace(own, **given))
    return found


def row_notes(
    recording: Recording, trials: Sequence[Trial], rows: Sequence[Label], numbers: Collection[int]
) -> list[str]:
    """A line on the demonstrations without a row, where there are rows at all.

    Args:
        recording: The log.
        trials: Its trials.
        rows: Of this log.
        numbers: Of the trials that became demonstrations.
    """
    named = {number + 1 for number in _by_trial(recording, trials, rows)}
    without = [str(number) for number in numbers if number not in named] if rows else []
    if not without:
        return []
    which = f"trial{'s' if len(without) > 1 else ''} {', '.join(without)}"
    return [f"{recording.log}: `trials` has no row for {which}: what the log states of it counts"]


def record_notes(recording: Recording, trials: Sequence[Trial]) -> list[str]:
    """A line on a session record whose entries fit no trial, for instance because they are on another clock."""
    entries = recording.session.declared
    if not entries or not trials or entries_by_trial(entries, recording, trials):
        return []
    start_ns = int(recording.t_ns[trials[0].first])
    away_s = min(abs(entry.t_ns - start_ns) for entry in entries) / 1e9
    found = (
        f"of its {len(entries)} {Number(len(entries)):entry|entries}, the nearest to the first trial is "
        f"{away_s:.1f} s away"
    )
    return [f"{recording.log}: its session record labels no trial: {found}; correct t_ns, or choose another `time`"]


def guess_notes(recording: Recording, stated: Collection[Declared]) -> list[str]:
    """What is guessed of demonstrations, because nobody stated it.

    Trials without a cycle beside others that have one are so on purpose.
    """
    by_force = "from joystick and contacts" if recording.wrench is not None else "from the joystick alone"
    guesses = {
        "participant": ("the log's name", any(one.participant is None for one in stated)),
        "condition": (by_force, any(one.condition is None for one in stated)),
        "cycle": ("none", all(one.cycle is None and one.set is None for one in stated)),
    }
    guessed = {name: how for name, (how, missing) in guesses.items() if missing}
    if not guessed:
        return []
    words = ", ".join(f"{name} ({how})" for name, how in guessed.items())
    remedy = f"state it with {', '.join(f'`{name}`' for name in guessed)}, or for each trial with `trials`"
    return [f"{recording.log}: guessed, because it is not stated: {words}; {remedy}"]
