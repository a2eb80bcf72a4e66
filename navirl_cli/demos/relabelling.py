"""Other labels for demonstrations, from a table of trials."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.labels import Label, Labels
from navirl_cli.demos.trials import SAME_START_S
from navirl_cli.errors import LabelError, counted

#: Columns that change a path or its map, so that only an extraction can apply them.
_OF_EXTRACTION = ("robot_radius_m", "people_m", "nominal_m")


def relabelled(demonstrations: Sequence[Demonstration], labels: Labels) -> tuple[list[Demonstration], list[str]]:
    """Demonstrations with the labels of a table; empty cells change nothing.

    A row belongs to a demonstration by log and start. The table counts from the log's first pose, which demonstrations
    do not hold: the offset is the one at which most rows of a log meet one of its demonstrations.

    Args:
        demonstrations: To relabel.
        labels: The table.

    Returns:
        The demonstrations in their order, and what to say: renamed trials, and rows without a demonstration.

    Raises:
        LabelError: A row states what only an extraction can apply, no row meets a demonstration, or several offsets fit
            a log equally well.
    """
    found = list(demonstrations)
    unused = {row.where for row in labels.rows}
    for log in dict.fromkeys(one.log for one in demonstrations):
        rows = [row for row in labels.rows if _is_of(row, log)]
        numbers = [number for number, one in enumerate(demonstrations) if one.log == log]
        for number, row in _matched([demonstrations[n] for n in numbers], rows, log).items():
            found[numbers[number]] = _with(demonstrations[numbers[number]], row)
            unused.discard(row.where)
    if len(unused) == len(labels.rows):
        logs = ", ".join(sorted({one.log for one in demonstrations})[:5])
        raise LabelError(f"{labels.path}: expected rows of trials of {logs}, found none; correct the column log")
    notes = [f"{row.where}: no demonstration of this trial" for row in labels.rows if row.where in unused]
    found = _unique(demonstrations, found)
    renamed = [(old.id, new.id) for old, new in zip(demonstrations, found, strict=True) if old.id != new.id]
    return found, [*(f"{old} is now {new}" for old, new in renamed), *notes]


def _is_of(row: Label, log: str) -> bool:
    """Whether a row is of a log, which it may name with folders."""
    named = PurePosixPath(row.log.replace("\\", "/")).parts
    return not named or named[-1:] == PurePosixPath(log.replace("\\", "/")).parts[-1:]


def _matched(own: Sequence[Demonstration], rows: Sequence[Label], log: str) -> dict[int, Label]:
    """The row of each demonstration of a log, by its place; the log's first pose is where most rows meet one."""
    if not rows:
        return {}
    starts_s = np.array([one.start_ns - own[0].start_ns for one in own]) / 1e9
    told_s = np.array([row.start_s for row in rows])
    offsets_s = np.unique((told_s[:, None] - starts_s).ravel())
    near = np.abs(starts_s[None, :, None] + offsets_s[:, None, None] - told_s) <= SAME_START_S  # offset, trial, row
    counts = near.any(axis=2).sum(axis=1)
    best = offsets_s[counts == counts.max()]
    if np.ptp(best) > SAME_START_S:
        raise LabelError(
            f"{rows[0].where}: expected the starts of the trials of {log} as inspect writes them, found several ways "
            f"to place the table's {counted(len(rows), 'row')} on its {counted(len(own), 'demonstration')}; "
            "keep the rows of all its trials, and relabel before trials are selected"
        )
    offset_s = float(np.median(best))
    found = {}
    for number, start_s in enumerate(starts_s + offset_s):
        row = int(np.argmin(np.abs(told_s - start_s)))
        if abs(told_s[row] - start_s) <= SAME_START_S:
            found[number] = rows[row]
    return found


def _with(one: Demonstration, row: Label) -> Demonstration:
    """A demonstration with the labels of its row."""
    held: dict[str, Any] = {"robot_radius_m": one.robot_radius_m, "people_m": one.people_m, "nominal_m": one.nominal_m}
    for column in _OF_EXTRACTION:
        stated = getattr(row, column)
        if stated is None:
            continue
        known = held[column]
        if known is None or np.shape(known) != np.shape(stated) or not np.allclose(known, stated, atol=1e-3):
            raise LabelError(
                f"{row.where}, column {column}: expected what {one.id} holds, found another; extract the log again "
                "with this table as `trials`, because it changes map or path"
            )
    participant = row.participant or one.participant
    renamed = one.id.startswith(f"{one.participant}/")
    return replace(
        one,
        id=f"{participant}/{one.id.rpartition('/')[2]}" if renamed else one.id,
        participant=participant,
        condition=one.condition if row.condition is None else Condition(row.condition),
        cycle=one.cycle if row.cycle is None else row.cycle,
        set=one.set if row.set is None else row.set,
    )


def _unique(before: Sequence[Demonstration], after: Sequence[Demonstration]) -> list[Demonstration]:
    """With unique ids: trials that join a participant and would have another's number are counted on."""
    taken = {new.id for old, new in zip(before, after, strict=True) if old.id == new.id}
    found = []
    for old, new in zip(before, after, strict=True):
        name, number = new.id, 0
        if old.id != new.id:
            while name in taken:
                number += 1
                name = f"{new.participant}/{number}"
            taken.add(name)
        found.append(replace(new, id=name))
    return found
