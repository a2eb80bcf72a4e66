"""Answers to a questionnaire, one a line of a CSV file, and how they spread over the levels of its scale."""

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from navirl_cli.arrays import ByContent, IntArray
from navirl_cli.errors import ArtefactError, brief

#: Columns in any order; the modality's may be missing.
COLUMNS, OPTIONAL = ("participant", "question", "modality", "answer"), "modality"
#: Default number of levels of a scale.
LEVELS = 5
_HEADER = "a header of participant,question,modality,answer"
_REMEDY = 'save it as "CSV UTF-8"'


@dataclass(frozen=True)
class Answer:
    """What one participant answered to one question."""

    participant: str
    question: str
    #: What the question was about: "force" or "joystick"; empty where about no modality.
    modality: str
    #: From 1 (strongly disagree) to the number of levels (strongly agree).
    answer: int


@dataclass(frozen=True, eq=False)
class Shares(ByContent):
    """How the answers to one question about one modality spread over the levels."""

    question: str
    modality: str
    #: (levels,) answers of each level, the first of "strongly disagree".
    counts: IntArray

    @property
    def count(self) -> int:
        """Number of answers."""
        return int(self.counts.sum())

    @property
    def median(self) -> float:
        """Median level; between two levels where half of the answers lie on either side."""
        return float(np.median(np.repeat(np.arange(1, len(self.counts) + 1), self.counts)))


def shares(answers: Iterable[Answer], levels: int = LEVELS) -> list[Shares]:
    """Count answers by question and modality.

    Args:
        answers: Answers from 1 to levels.
        levels: Levels of the scale.

    Returns:
        By question and, within it, by modality, both in the order in which they first occur.
    """
    counts: dict[str, dict[str, IntArray]] = {}
    for one in answers:
        by_modality = counts.setdefault(one.question, {})
        by_modality.setdefault(one.modality, np.zeros(levels, dtype=np.int64))[one.answer - 1] += 1
    modalities = dict.fromkeys(modality for by_modality in counts.values() for modality in by_modality)
    return [
        Shares(question, modality, by_modality[modality])
        for question, by_modality in counts.items()
        for modality in modalities
        if modality in by_modality
    ]


def read_answers(path: Path, levels: int = LEVELS) -> list[Answer]:
    """Read a CSV file with one answer a line, separated by commas or, as Excel writes it in some languages, semicolons.

    Args:
        path: A UTF-8 file whose first line names COLUMNS; empty lines are skipped.
        levels: Levels of the scale.

    Returns:
        The answers as they stand in the file.

    Raises:
        ArtefactError: The file cannot be read or is not as described, an answer is no level, or one person answers a
            question about a modality twice.
    """
    rows = _rows(path, _text(path))
    line, header = next(rows, (1, []))
    _check_header(f"{path}: line {line}", header)
    answers: list[Answer] = []
    lines: dict[tuple[str, str, str], int] = {}
    for line, row in rows:
        where = f"{path}: line {line}"
        if len(row) != len(header):
            raise ArtefactError(
                f"{where}: expected {len(header)} columns as in the header, found {len(row)}; put a text with the "
                "separator in it in double quotes"
            )
        one = _answer(where, dict(zip(header, row, strict=True)), levels)
        asked = one.participant, one.question, one.modality
        first = lines.setdefault(asked, line)
        if first != line:
            about = f" about {brief(one.modality)}" if one.modality else ""
            raise ArtefactError(
                f"{where}: expected one answer of {brief(one.participant)} to {brief(one.question)}{about}, found a "
                f"second after that of line {first}; remove one"
            )
        answers.append(one)
    if not answers:
        raise ArtefactError(f"{path}: expected answers below the header, found none; add one line per answer")
    return answers


def _text(path: Path) -> str:
    """The whole file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ArtefactError(f"{path}: expected a CSV file, cannot be read: {error.strerror}; check the path") from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ArtefactError(
            f"{path}: line {line}: expected UTF-8, found the byte 0x{data[error.start]:02x}; {_REMEDY}"
        ) from error


def _rows(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """Line (of a text over several its last) and cells of every row that is not empty."""
    header = text.lstrip().split("\n", maxsplit=1)[0]
    reader = csv.reader(StringIO(text, newline=""), delimiter=";" if ";" in header else ",", strict=True)
    try:
        for row in reader:
            cells = [" ".join(cell.split()) for cell in row]
            if any(cells):
                yield reader.line_num, cells
    except csv.Error as error:
        raise ArtefactError(f"{path}: line {reader.line_num}: expected CSV, found: {error}; {_REMEDY}") from error


def _check_header(where: str, header: list[str]) -> None:
    """Refuse columns that are missing, unknown or there twice."""
    if not header:
        raise ArtefactError(f"{where}: expected {_HEADER}, found nothing; give the file with the answers")
    for name in COLUMNS:
        if name not in header and name != OPTIONAL:
            raise ArtefactError(
                f"{where}: expected {_HEADER}, found no column {name} but {brief(','.join(header))}; name them so"
            )
    for name in header:
        if name not in COLUMNS or header.count(name) > 1:
            what = "an unknown" if name not in COLUMNS else "a second"
            raise ArtefactError(f"{where}: expected {_HEADER}, found {what} column {brief(name)}; remove it")


def _answer(where: str, cells: dict[str, str], levels: int) -> Answer:
    """One row, checked."""
    for name in ("participant", "question"):
        if not cells[name]:
            raise ArtefactError(f"{where}, column {name}: expected a text, found nothing; fill it in")
    text, expected = cells["answer"], f"expected a whole number from 1 to {levels}"
    if not text:
        raise ArtefactError(f"{where}, column answer: {expected}, found nothing; remove the line")
    if not (text.isascii() and text.isdecimal() and len(text) < 10 and 1 <= int(text) <= levels):
        raise ArtefactError(f"{where}, column answer: {expected}, found {brief(text)}; correct the answer")
    return Answer(cells["participant"], cells["question"], cells.get("modality", ""), int(text))
