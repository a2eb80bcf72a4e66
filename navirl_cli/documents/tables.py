"""Tables of values, written as text, CSV, Markdown, LaTeX or JSON. :mod:`navirl_cli.documents.page` writes HTML.

A cell is a value. The column defines how its numbers are shown. All formats show the same words and the same digits.
"""

import csv
import io
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import floor, inf, isfinite, isinf, isnan, log10
from numbers import Integral, Real
from typing import TypeAlias

from navirl_cli.documents.inline import latex_of, markdown_of, text_of

#: The minus sign of typeset text; plain text, CSV and Markdown use the ASCII hyphen.
MINUS = "\N{MINUS SIGN}"
#: A missing value in the formats for readers. In CSV its cell is empty.
MISSING = "-"
#: Numbers that need more decimals, or more digits before the point, are written with an exponent.
_MOST_DECIMALS, _MOST_DIGITS = 9, 15


@dataclass(frozen=True)
class Spread:
    """A value with its uncertainty or scatter: mean ± standard deviation, estimate ± standard error."""

    #: In the unit of the column; NaN for a missing value.
    mean: float
    #: In the same unit; NaN where it is unknown.
    std: float


@dataclass(frozen=True)
class Interval:
    """An interval between two values."""

    #: In the unit of the column; NaN for a missing interval, -inf for an open end.
    lower: float
    #: In the same unit; inf for an open end.
    upper: float


#: None, NaN, the empty text, and composites that begin with NaN are missing values.
Cell: TypeAlias = str | bool | int | float | Spread | Interval | None
#: A value as CSV and JSON hold it.
Plain: TypeAlias = str | bool | int | float | None
#: Names of the parts of a composite.
_PARTS: Mapping[type, tuple[str, str]] = {Spread: ("mean", "std"), Interval: ("lower", "upper")}


@dataclass(frozen=True)
class Column:
    """The name of a column and the format of its numbers."""

    #: Name in CSV and JSON, in lower case with the unit of the values: length_m.
    name: str
    #: Title for readers, with the unit that is shown. The name where it is empty.
    heading: str = ""
    #: Digits after the point. None: so many that the largest number has ``significant`` digits; integers have none.
    decimals: int | None = None
    significant: int = 4
    #: Whether positive numbers have a plus sign, as in differences.
    sign: bool = False
    #: Factor from the unit of the values to the unit that is shown, for instance 100 for percent.
    scale: float = 1.0

    @property
    def title(self) -> str:
        """The title above the column."""
        return self.heading or self.name


@dataclass(frozen=True)
class Table:
    """Rows of values in columns.

    Raises:
        ValueError: There is no column, or a row does not have one cell for each column.
        TypeError: A cell is not a value.
    """

    #: One or more.
    columns: tuple[Column, ...]
    #: One cell for each column.
    rows: tuple[tuple[Cell, ...], ...]
    #: Text above the table.
    caption: str = ""
    #: Text below the table, for instance why values are missing.
    note: str = ""
    #: By column: whether all its values are numbers, missing values aside. A column without values is not numeric.
    numeric: tuple[bool, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the rows."""
        if not self.columns:
            raise ValueError("a table needs at least one column")
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"a table of {len(self.columns)} columns cannot take the row {row}")
            for cell in row:
                if not (cell is None or isinstance(cell, str | Real | Spread | Interval)):
                    raise TypeError(f"expected a text, a number, a composite or None in a cell, found {cell!r}")
        columns = (self.column(j) for j in range(len(self.columns)))
        object.__setattr__(self, "numeric", tuple(map(_is_numeric, columns)))

    @staticmethod
    def of_texts(header: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> "Table":
        """A table whose cells are all texts; "-" and the empty text are missing."""
        cells = tuple(tuple(None if text in {"", MISSING} else text for text in row) for row in rows)
        return Table(tuple(map(Column, header)), cells, caption)

    def column(self, j: int) -> tuple[Cell, ...]:
        """The cells of a column."""
        return tuple(row[j] for row in self.rows)

    def without_empty(self) -> "Table":
        """The table without the columns in which all values are missing."""
        kept = [j for j in range(len(self.columns)) if not all(map(is_missing, self.column(j)))]
        rows = tuple(tuple(row[j] for j in kept) for row in self.rows)
        return replace(self, columns=tuple(self.columns[j] for j in kept), rows=rows)

    def shown(self, minus: str = "-") -> list[tuple[str, ...]]:
        """The rows as texts for readers.

        Args:
            minus: The minus sign of numbers.
        """
        columns = (_shown(column, self.column(j), minus) for j, column in enumerate(self.columns))
        return list(zip(*columns, strict=True))

    def records(self) -> list[dict[str, Plain]]:
        """The rows for programs, by the names of the columns. Composites become two numbers with suffixes."""
        names, rows = _plain(self)
        return [dict(zip(names, row, strict=True)) for row in rows]


def sort_key(cell: Cell) -> float | None:
    """The number by which a cell is sorted: value, mean or lower end. None for texts and missing values."""
    first = _known(_parts(cell)[0])
    return float(first) if isinstance(first, Real) and not isinstance(first, bool) else None


def is_missing(cell: Cell) -> bool:
    """Whether a cell has no value."""
    return _known(_parts(cell)[0]) is None


def _plain(table: Table) -> tuple[list[str], list[list[Plain]]]:
    """Names of plain columns, and rows with one plain value for each."""
    names: list[str] = []
    columns: list[list[Plain]] = []
    for j, column in enumerate(table.columns):
        cells = table.column(j)
        parts = next((_PARTS[type(cell)] for cell in cells if type(cell) in _PARTS), None)
        names += [column.name] if parts is None else [f"{column.name}_{part}" for part in parts]
        values = [_parts(cell) for cell in cells]
        columns += [[_closed(own[k]) if k < len(own) else None for own in values] for k in range(len(parts or [""]))]
    return names, [list(row) for row in zip(*columns, strict=True)]


def _parts(cell: Cell) -> tuple[Plain, ...]:
    """The plain values of a cell."""
    match cell:
        case Spread(mean, std):
            return mean, std
        case Interval(lower, upper):
            return lower, upper
    return (cell,)


def _known(value: Plain) -> Plain:
    """A value as one of Python's own types. None for NaN and the empty text."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return value or None
    if isinstance(value, Integral):
        return int(value)
    return None if isnan(value) else float(value)


def _closed(value: Plain) -> Plain:
    """A value for programs: None for an open end too."""
    known = _known(value)
    return None if isinstance(known, float) and isinf(known) else known


def _is_numeric(cells: Sequence[Cell]) -> bool:
    """Whether a column has values and all of them are numbers."""
    values = [cell for cell in cells if not is_missing(cell)]
    return bool(values) and all(sort_key(cell) is not None for cell in values)


def _shown(column: Column, cells: Sequence[Cell], minus: str) -> list[str]:
    """The cells of a column as texts. All numbers have the same digits."""
    numbers = [_scaled(cell, column.scale) for cell in cells]
    style = _style(column, [value for parts in numbers for value in parts])
    texts = [[_number(value, style, minus) for value in parts] for parts in numbers]
    return [_joined(cell, parts) for cell, parts in zip(cells, texts, strict=True)]


def _scaled(cell: Cell, scale: float) -> list[float]:
    """The numbers of a cell in the unit that is shown. Empty for texts and missing values."""
    if sort_key(cell) is None:
        return []
    known = [_known(part) for part in _parts(cell)]
    return [value if scale == 1 else value * scale for value in known if isinstance(value, int | float)]


def _style(column: Column, values: Sequence[float]) -> str:
    """The format of a column's numbers."""
    sign = "+" if column.sign else ""
    if column.decimals is not None:
        return f"{sign}.{column.decimals}f"
    if all(isinstance(value, int) for value in values):
        return f"{sign}d"
    largest = max((abs(value) for value in values if isfinite(value)), default=0.0)
    digits = 1 if largest == 0 else floor(log10(largest)) + 1
    decimals = max(0, column.significant - digits)
    if decimals > _MOST_DECIMALS or digits > _MOST_DIGITS:
        return f"{sign}.{column.significant - 1}e"
    return f"{sign}.{decimals}f"


def _number(value: float, style: str, minus: str) -> str:
    """A number as text. A number that is rounded to zero has no sign."""
    text = format(value, style)
    return text.lstrip("+-") if not text.strip("+-0.") else text.replace("-", minus)


def _joined(cell: Cell, numbers: Sequence[str]) -> str:
    """A cell as text, from its numbers as texts."""
    if is_missing(cell):
        return MISSING
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Interval):
        return _interval(cell, numbers)
    return " ± ".join(numbers)


def _interval(cell: Interval, numbers: Sequence[str]) -> str:
    """An interval as text; open ends have no number."""
    if cell.lower == -inf:
        return "open" if cell.upper == inf else f"below {numbers[1]}"
    return f"above {numbers[0]}" if cell.upper == inf else " to ".join(numbers)


#: First characters of formulas in spreadsheets, and texts that begin so without being one: coordinates.
FORMULA = ("=", "+", "-", "@", "\t", "\r")
_COORDINATES = re.compile(r"[-+0-9., ;e]*")


class Format(StrEnum):
    """The format of a table."""

    TEXT = "text"
    JSON = "json"
    CSV = "csv"
    MARKDOWN = "markdown"
    LATEX = "latex"


#: By the ending of a file's name.
ENDINGS = {".json": Format.JSON, ".csv": Format.CSV, ".md": Format.MARKDOWN, ".tex": Format.LATEX}


def written(table: Table, how: Format = Format.TEXT) -> str:
    """A table in one format, without a line break at its end.

    Args:
        table: The table.
        how: The format. CSV and JSON hold plain numbers in the units of the values, without caption and note.
    """
    match how:
        case Format.JSON:
            return json.dumps(table.records(), indent=2, allow_nan=False)
        case Format.CSV:
            return _csv(table)
        case Format.MARKDOWN:
            return _markdown(table)
        case Format.LATEX:
            return _latex(table)
        case Format.TEXT:
            return _plain_text(table)


def _csv(table: Table) -> str:
    names, rows = _plain(table)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(_no_formula, names))
    for row in rows:
        writer.writerow([_no_formula(cell) if isinstance(cell, str) else cell for cell in row])
    return stream.getvalue().removesuffix("\n")


def _no_formula(text: str) -> str:
    """A text that a spreadsheet does not run: a quote stands before what begins like a formula."""
    return f"'{text}" if text.lstrip("'")[:1] in FORMULA and not _COORDINATES.fullmatch(text) else text


def _plain_text(table: Table) -> str:
    """Columns of the width of their widest entry: numbers right-aligned, texts left-aligned."""
    header = [column.title for column in table.columns]
    rows = [[text_of(text) for text in row] for row in (header, *table.shown())]
    lines = ["  ".join(row).rstrip() for row in _aligned(rows, table.numeric)]
    return "\n".join(filter(None, (text_of(table.caption), *lines, text_of(table.note))))


def _markdown(table: Table) -> str:
    """Header, rule and rows in aligned columns, between caption and note."""
    header = [column.title for column in table.columns]
    grid = [[markdown_of(text, cell=True) for text in row] for row in (header, *table.shown())]
    widths = [max(3, *(len(row[j]) for row in grid)) for j in range(len(header))]
    rule = ["-" * (width - n) + ":" * n for width, n in zip(widths, table.numeric, strict=True)]
    lines = [f"| {' | '.join(row)} |" for row in _aligned([grid[0], rule, *grid[1:]], table.numeric)]
    caption = [markdown_of(table.caption), ""] if table.caption else []
    note = ["", markdown_of(table.note)] if table.note else []
    return "\n".join((*caption, *lines, *note))


def _latex(table: Table) -> str:
    """A booktabs tabular. Caption and note are paragraphs above and below it."""
    header = [latex_of(column.title) for column in table.columns]
    rows = [[latex_of(text) for text in row] for row in table.shown(MINUS)]
    lines = [" & ".join(row) + r" \\" for row in (header, *rows)]
    columns = "".join("r" if number else "l" for number in table.numeric)
    body = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", lines[0], r"\midrule", *lines[1:]]
    caption = [latex_of(table.caption), ""] if table.caption else []
    note = ["", latex_of(table.note)] if table.note else []
    return "\n".join((*caption, *body, r"\bottomrule", r"\end{tabular}", *note))


def _aligned(rows: Sequence[Sequence[str]], right: Sequence[bool]) -> list[list[str]]:
    """Texts padded to the width of their column."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        [text.rjust(w) if r else text.ljust(w) for text, w, r in zip(row, widths, right, strict=True)] for row in rows
    ]
