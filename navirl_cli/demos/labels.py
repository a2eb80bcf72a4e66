"""What an experimenter states of each trial in a table: participant, condition, cycle and the like."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path, PurePosixPath
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.demos.demonstration import Condition
from navirl_cli.documents.sheets import Line, read_sheet
from navirl_cli.errors import LabelError, brief, unknown
from navirl_cli.logs.roles.session import MOST_CORNERS, MOST_CYCLES, MOST_M, MOST_PEOPLE, MOST_RADIUS_M
from navirl_cli.logs.sources import Source

#: Columns that identify a trial, that help a reader to recognise it, and that state something of it.
WHERE, SHOWN = ("log", "trial", "start_s"), ("duration_s", "length_m", "contact_s")
STATED = ("participant", "condition", "cycle", "set", "robot_radius_m", "people_m", "nominal_m")
COLUMNS = (*WHERE, *SHOWN, *STATED)
#: The cell people_m of a trial without people.
NOBODY = "none"
#: Names that a message lists.
_NEAR = 3


@dataclass(frozen=True, eq=False)
class Label(ByContent):
    """One row: what is stated of a trial; None where the cell is empty."""

    #: File and line, for messages.
    where: str
    #: The log, or the end of its path; empty where the table has no such column.
    log: str
    #: When the trial starts, s since the log's first pose.
    start_s: float
    participant: str | None = None
    condition: str | None = None
    cycle: int | None = None
    set: str | None = None
    #: Of the robot of the whole log, m.
    robot_radius_m: float | None = None
    #: (p, 2) m, map frame; p = 0 where nobody was there.
    people_m: FloatArray | None = None
    #: (k, 2) m, map frame: the line that the robot's navigation followed.
    nominal_m: FloatArray | None = None

    @property
    def states(self) -> bool:
        """Whether any cell is filled in."""
        return any(getattr(self, name) is not None for name in STATED)


@dataclass(frozen=True, eq=False)
class Labels(ByContent):
    """A table of trials."""

    path: Path
    rows: tuple[Label, ...]


def read_labels(path: Path) -> Labels:
    """Read a table of trials, filled in by hand or in a spreadsheet.

    Args:
        path: A CSV file in UTF-8, separated by commas, semicolons or tabs. Only the column start_s is needed. In a
            table that is not separated by commas, numbers may have a decimal comma.

    Raises:
        ArtefactError: The file cannot be read, has other columns, or a cell holds something else than it should.
    """
    separator, lines = read_sheet(path, COLUMNS, ("start_s",), "trials")
    return Labels(path, tuple(_label(_Cells(line, separator)) for line in lines))


@dataclass(frozen=True)
class _Cells:
    """The cells of one row."""

    line: Line
    separator: str

    def text(self, column: str) -> str | None:
        """The text of a cell; None where it is empty. Spreadsheets and tables put ' before what is no formula."""
        text = self.line.cells[column]
        return (text[1:] if text[:1] == "'" and text[1:2] in set("=+-@") else text) or None

    def number(self, column: str, expected: str, least: float, most: float) -> float | None:
        """The number of a cell."""
        text = self.text(column)
        if text is None:
            return None
        plain = text.replace(",", ".") if self.separator != "," and text.count(",") == 1 else text
        try:
            value = float(plain)
        except ValueError:
            value = np.nan
        if not (isfinite(value) and least <= value <= most) or "_" in text:
            self.refuse(column, expected)
        return value

    def points(self, column: str, least: int, most: int) -> FloatArray | None:
        """(k, 2) points of a cell."""
        text = self.text(column)
        if text is None:
            return None
        several = f"{least} or more points" if least > 1 else "points"
        expected = f"{several} in m as x,y; x,y"
        try:
            found = np.array([[float(part) for part in point.split(",")] for point in text.strip("; ").split(";")])
        except ValueError:
            self.refuse(column, expected)
        if found.ndim != 2 or found.shape[1] != 2 or not (np.abs(found) <= MOST_M).all():
            self.refuse(column, expected)
        if not least <= len(found) <= most:
            self.refuse(column, f"{expected}, at most {most}")
        return found

    def refuse(self, column: str, expected: str) -> NoReturn:
        """Refuse the cell."""
        found = brief(self.line.cells[column]) if self.line.cells[column] else "nothing"
        raise LabelError(f"{self.line.where}, column {column}: expected {expected}, found {found}; correct it")


def _label(cells: _Cells) -> Label:
    """One row, checked."""
    start_s = cells.number("start_s", "the trial's start in s, as inspect writes it", -1e12, 1e12)
    if start_s is None:
        cells.refuse("start_s", "the trial's start in s, as inspect writes it")
    condition = cells.text("condition")
    conditions = [one.value for one in Condition]
    if condition is not None and condition.lower() not in conditions:
        raise LabelError(f"{cells.line.where}, {unknown('column condition', condition, conditions)}; correct it")
    cycle = cells.number("cycle", "a whole number from 1 on", 1, MOST_CYCLES)
    if cycle is not None and cycle != int(cycle):
        cells.refuse("cycle", "a whole number from 1 on")
    radius_m = cells.number("robot_radius_m", f"a radius above 0 m, at most {MOST_RADIUS_M:g} m", 0, MOST_RADIUS_M)
    if radius_m == 0:
        cells.refuse("robot_radius_m", f"a radius above 0 m, at most {MOST_RADIUS_M:g} m")
    nobody = (cells.text("people_m") or "").lower() == NOBODY
    return Label(
        where=cells.line.where,
        log=cells.text("log") or "",
        start_s=start_s,
        participant=cells.text("participant"),
        condition=None if condition is None else condition.lower(),
        cycle=None if cycle is None else int(cycle),
        set=cells.text("set"),
        robot_radius_m=radius_m,
        people_m=np.zeros((0, 2)) if nobody else cells.points("people_m", 1, MOST_PEOPLE),
        nominal_m=cells.points("nominal_m", 2, MOST_CORNERS),
    )


def log_names(sources: Sequence[Source]) -> list[str]:
    """Names of recordings by which each is known: the file's or folder's, with as many folders as tell it apart."""
    paths = [_parts(source) for source in sources]
    names = []
    for own in paths:
        others = [path for path in paths if path != own]
        count = next((n for n in range(1, len(own)) if all(path[-n:] != own[-n:] for path in others)), len(own))
        names.append("/".join(own[-count:]))
    return names


def _parts(source: Source) -> tuple[str, ...]:
    """The parts of a recording's path."""
    path = Path(os.path.abspath(source.files[0]))  # noqa: PTH100 - links keep their names, and .. goes
    return (path if path.name == source.name else path.parent).parts


def labels_by_source(labels: Labels, sources: Sequence[Source]) -> tuple[list[tuple[Label, ...]], list[str]]:
    """The rows of each recording, and what to say about the others.

    Args:
        labels: The table.
        sources: The recordings.

    Raises:
        LabelError: A row fits several recordings, or no row fits any.
    """
    paths = [_parts(source) for source in sources]
    rows: list[list[Label]] = [[] for _ in sources]
    others: dict[str, int] = {}
    for row in labels.rows:
        named = PurePosixPath(row.log.replace("\\", "/")).parts
        fitting = [number for number, path in enumerate(paths) if not named or path[-len(named) :] == named]
        if len(fitting) > 1:
            listed = ", ".join(log_names([sources[number] for number in fitting][:_NEAR]))
            given = brief(row.log) if named else "nothing"
            raise LabelError(
                f"{row.where}, column log: expected the name of one log, found {given}, which fits "
                f"{len(fitting)} of the logs; name one of {listed}"
            )
        if fitting:
            rows[fitting[0]].append(row)
        else:
            others[row.log] = others.get(row.log, 0) + 1
    listed = ", ".join([*others][:_NEAR]) + (f" and {len(others) - _NEAR} more" if len(others) > _NEAR else "")
    if not any(rows):
        names = ", ".join(log_names(sources)[:_NEAR])
        raise LabelError(f"{labels.path}: expected rows of {names}, found rows of {listed}; correct the column log")
    notes = [f"{labels.path.name}: rows of logs that were not read: {sum(others.values())} ({listed})"]
    return [tuple(own) for own in rows], notes if others else []


def points_text(points: ArrayLike) -> str:
    """(k, 2) points as a cell holds them."""
    several = np.asarray(points, dtype=float).tolist()
    return "; ".join(",".join(repr(value).removesuffix(".0") for value in point) for point in several) or NOBODY
