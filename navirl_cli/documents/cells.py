"""What stands in a table's cell: a number, a text or nothing."""

import re

from navirl_cli.documents.document import Table
from navirl_cli.documents.inline import plain_of

#: What says that there is no value.
MISSING = frozenset({"", "-", "\N{EN DASH}", "\N{EM DASH}", "\N{MINUS SIGN}", "n/a", "nan"})
_NUMBER = re.compile(
    r"[(\[<>≤≥≈~ ]*"  # an interval or a bound
    r"(?P<number>[-+\N{MINUS SIGN}]?(?:inf\b|∞|(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[-+\N{MINUS SIGN}]?\d+)?))"
    r"(?:[%‰°]|(?<=\d)[^\W\d_]{1,3})?"  # a unit may touch its number
    r"(?=$|[\s±;)\]]|,\s.*[)\]]$)",  # dates, versions, hashes and lists of names go on otherwise
    re.IGNORECASE,
)


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return plain_of(cell).casefold() in MISSING


def number_of(cell: str) -> float | None:
    """The number by which a cell is sorted.

    Args:
        cell: As in a table: a number with or without thousands' commas, unit, "± spread" or what else follows after a
            space; or an interval, whose first number counts.

    Returns:
        The number; None where the cell does not begin with one.
    """
    match = _NUMBER.match(plain_of(cell))
    if match is None:
        return None
    return float(match["number"].replace(",", "").replace("\N{MINUS SIGN}", "-").replace("∞", "inf"))


def numeric_columns(table: Table) -> tuple[bool, ...]:
    """Which columns hold more numbers than other values, by column."""
    columns = (tuple(row[i] for row in table.rows) for i in range(len(table.header)))
    return tuple(_is_numeric(column) for column in columns)


def _is_numeric(column: tuple[str, ...]) -> bool:
    """Whether the values of a column are numbers for the most part."""
    values = [number_of(cell) for cell in column if not is_missing(cell)]
    return sum(value is not None for value in values) > len(values) / 2
