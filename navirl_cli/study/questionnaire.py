"""Answers to a questionnaire, one a line of a CSV file, and how they spread over the levels of its scale."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navirl_cli.arrays import ByContent, IntArray
from navirl_cli.documents.sheets import read_sheet
from navirl_cli.errors import ArtefactError, brief

#: Columns in any order; the modality's may be missing.
COLUMNS, OPTIONAL = ("participant", "question", "modality", "answer"), "modality"
#: Default number of levels of a scale.
LEVELS = 5


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
    """Read a CSV file with one answer a line, by :func:`navirl_cli.documents.sheets.read_sheet`.

    Args:
        path: A UTF-8 file whose first line names COLUMNS; empty lines are skipped.
        levels: Levels of the scale.

    Returns:
        The answers as they stand in the file.

    Raises:
        ArtefactError: The file cannot be read or is not as described, an answer is no level, or one person answers a
            question about a modality twice.
    """
    needed = [name for name in COLUMNS if name != OPTIONAL]
    _, rows = read_sheet(path, COLUMNS, needed, "answers")
    answers: list[Answer] = []
    lines: dict[tuple[str, str, str], int] = {}
    for row in rows:
        one = _answer(row.where, row.cells, levels)
        asked = one.participant, one.question, one.modality
        first = lines.setdefault(asked, row.number)
        if first != row.number:
            about = f" about {brief(one.modality)}" if one.modality else ""
            raise ArtefactError(
                f"{row.where}: expected one answer of {brief(one.participant)} to {brief(one.question)}{about}, found "
                f"a second after that of line {first}; remove one"
            )
        answers.append(one)
    return answers


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
    return Answer(cells["participant"], cells["question"], cells["modality"], int(text))
