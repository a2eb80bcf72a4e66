"""What ``navirl extract`` reports: trials, gains, and the comparison with published cells."""

from collections.abc import Iterable, Mapping, Sequence
from math import hypot, pi
from typing import Any

from navirl_cli.artefacts.manifest import Entry
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import Extraction
from navirl_cli.demos.lines import path_length_m
from navirl_cli.documents.tables import Cell, Column, Table
from navirl_cli.errors import counted

_TRIAL = (
    Column("trial"),
    Column("condition"),
    Column("cycle"),
    Column("set"),
    Column("duration_s", "duration s", decimals=1),
    Column("length_m", "length m", decimals=2),
    Column("cells"),
    Column("contacts"),
    Column("contact_share", "contact %", decimals=0, scale=100),
    Column("peak_force_n", "peak N", decimals=1),
    Column("impulse_n_s", "impulse N s", decimals=1),
    Column("direction_rad", "direction deg", decimals=0, scale=180 / pi),
)
_GAIN = (
    Column("log"),
    Column("gain_m_s_n", "gain m/s/N"),
    Column("standard_error_m_s_n", "standard error m/s/N", significant=2),
    Column("pushes"),
    Column("delay_s", "delay s", decimals=2),
)


#: Of more logs a table lists only those without demonstrations.
_MOST_LOGS = 100
_LOG = (Column("log"), Column("status"), Column("trials"), Column("demonstrations"), Column("file"))


def trial_table(demonstrations: Sequence[Demonstration]) -> Table:
    """One row for each trial. The direction is that of the contact with the largest impulse."""
    notes = []
    if not all(one.timed for one in demonstrations):
        notes.append("What rests on time is missing: positions came without times.")
    if any(one.contacts is None for one in demonstrations):
        notes.append("Contacts are unknown: forces were not read.")
    return Table(_TRIAL, tuple(map(_trial, demonstrations)), note=" ".join(notes))


def _trial(d: Demonstration) -> tuple[Cell, ...]:
    """A row of the table of trials."""
    contacts = d.contacts or ()
    # by the impulse, of which shares of time, sums over time and directions are not known without times
    known = contacts if d.timed else ()
    strongest = max(known, key=lambda contact: hypot(*contact.impulse_n_s), default=None)
    return (
        d.id,
        d.condition.value,
        d.cycle,
        d.set,
        d.duration_s if d.timed else None,
        path_length_m(d.xy_m),
        len(d.cells),
        None if d.contacts is None else len(d.contacts),
        d.contact_s / d.duration_s if d.timed and d.contact_s is not None else None,
        max((contact.peak_force_n for contact in contacts), default=None),
        sum(hypot(*contact.impulse_n_s) for contact in contacts) if d.timed and d.contacts is not None else None,
        None if strongest is None else strongest.direction_rad,
    )


def gain_table(gain: Mapping[str, Any]) -> Table:
    """The gain of each log, and of all together if there are several.

    Args:
        gain: As in a demonstrations file.
    """
    lines = [*gain["logs"], *([{"log": "all", **gain}] if len(gain["logs"]) > 1 else [])]
    return Table(_GAIN, tuple(tuple(line[column.name] for column in _GAIN) for line in lines))


def log_table(logs: Sequence[Entry], unchanged: int) -> Table:
    """One row for each log; of many logs only those without demonstrations."""
    shown = logs if len(logs) <= _MOST_LOGS else [one for one in logs if one.file is None]
    rows = tuple((one.log, one.status, one.trials, one.demonstrations, one.file) for one in shown)
    done = sum(one.demonstrations for one in logs)
    unread = f"{unchanged} of them unchanged and not read again"
    note = f"{counted(len(logs), 'log')}, {unread}; {counted(done, 'demonstration')}."
    return Table(_LOG, rows, note=note)


def published_notes(results: Iterable[Extraction]) -> list[str]:
    """The number of paths with the cells that were published with their log."""
    notes = []
    for result in results:
        different = [name for name, same in result.published.items() if not same]
        if result.published:
            listed = f"; different: {', '.join(different)}" if different else ""
            count = f"{len(result.published) - len(different)} of {counted(len(result.published), 'path')}"
            notes.append(f"{result.log}: cells equal to those published with it: {count}{listed}")
    return notes
