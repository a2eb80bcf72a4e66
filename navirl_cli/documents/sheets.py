"""CSV files that people write, by hand or in a spreadsheet: any usual separator, with the line of every fault."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from navirl_cli.documents.tables import FORMULA
from navirl_cli.errors import ArtefactError, brief, nearest
from navirl_cli.files import read_regular

#: Spreadsheets choose the separator by the language.
SEPARATORS = ",;\t"
_REMEDY = 'save it as "CSV UTF-8"'


@dataclass(frozen=True)
class Line:
    """One row of a sheet."""

    #: File and line, for messages: "trials.csv: line 3". Of a text over several lines the last.
    where: str
    #: Texts by column, with single spaces; empty where the cell is empty or the sheet lacks the column.
    cells: dict[str, str]
    number: int


def read_sheet(path: Path, columns: Sequence[str], needed: Sequence[str], rows: str) -> tuple[str, list[Line]]:
    """Read a CSV file with a header; a byte order mark and empty lines are skipped.

    Args:
        path: A UTF-8 file, separated by commas, semicolons or tabs.
        columns: The known columns, which may stand in any order.
        needed: The columns that may not be missing.
        rows: What the rows are, for messages: "answers".

    Returns:
        The separator, and the rows.

    Raises:
        ArtefactError: The file cannot be read or is not as described.
    """
    text = _text(path)
    separator = _separator(text)
    found = _rows(path, text, separator)
    number, header = next(found, (1, []))
    _check_header(f"{path}: line {number}", header, columns, needed, rows)
    lines = []
    for number, row in found:
        where = f"{path}: line {number}"
        if len(row) != len(header):
            raise ArtefactError(
                f"{where}: expected {len(header)} columns as in the header, found {len(row)}; put a text with the "
                "separator in it in double quotes"
            )
        lines.append(Line(where, dict.fromkeys(columns, "") | dict(zip(header, row, strict=True)), number))
    if not lines:
        raise ArtefactError(f"{path}: expected {rows} below the header, found none; add one line per {rows[:-1]}")
    return separator, lines


def _text(path: Path) -> str:
    """The text of a UTF-8 file."""
    try:
        data = read_regular(path)
    except OSError as error:
        raise ArtefactError(f"{path}: expected a CSV file, cannot be read: {error.strerror}; check the path") from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ArtefactError(
            f"{path}: line {line}: expected UTF-8, found the byte 0x{data[error.start]:02x}; {_REMEDY}"
        ) from error


def _separator(text: str) -> str:
    """The separator that occurs most often in the header."""
    header = text.lstrip().split("\n", maxsplit=1)[0]
    return max(SEPARATORS, key=header.count)


def _rows(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Line and cells of every row that is not empty."""
    reader = csv.reader(StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        for row in reader:
            cells = [" ".join(_unquoted(cell).split()) for cell in row]
            if any(cells):
                yield reader.line_num, cells
    except csv.Error as error:
        raise ArtefactError(f"{path}: line {reader.line_num}: expected CSV, found: {error}; {_REMEDY}") from error


def _unquoted(cell: str) -> str:
    """A cell without the quote that keeps a spreadsheet from running it as a formula."""
    return cell[1:] if cell[:1] == "'" and cell.lstrip("'")[:1] in FORMULA else cell


def _check_header(where: str, header: list[str], columns: Sequence[str], needed: Sequence[str], rows: str) -> None:
    """Refuse columns that are missing, unknown or there twice."""
    expected = f"a header of {','.join(columns)}"
    if not header:
        raise ArtefactError(f"{where}: expected {expected}, found nothing; give the file with the {rows}")
    for name in needed:
        if name not in header:
            raise ArtefactError(
                f"{where}: expected {expected}, found no column {name} but {brief(','.join(header))}; name them so"
            )
    for name in header:
        if name not in columns or header.count(name) > 1:
            what = "an unknown" if name not in columns else "a second"
            near = [one for one in nearest(name, columns) if one not in header] if name not in columns else []
            remedy = f"name it {near[0]}, or remove it" if near else "remove it"
            raise ArtefactError(f"{where}: expected {expected}, found {what} column {brief(name)}; {remedy}")
