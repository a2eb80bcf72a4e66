"""Tables as text, CSV, Markdown or LaTeX."""

import csv
import io
from collections.abc import Sequence
from enum import StrEnum

from navirl_cli.documents.document import Table
from navirl_cli.documents.markdown import table_text


class Format(StrEnum):
    """How a table is written."""

    TEXT = "text"
    JSON = "json"
    CSV = "csv"
    MARKDOWN = "markdown"
    LATEX = "latex"


#: By the ending of a file's name.
ENDINGS = {".json": Format.JSON, ".csv": Format.CSV, ".md": Format.MARKDOWN, ".tex": Format.LATEX}
_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "&": r"\&",
        "%": r"\%",
        "$": r"\$",
        "#": r"\#",
        "_": r"\_",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "±": r"$\pm$",
        "²": r"$^2$",
        "³": r"$^3$",
        "\N{MINUS SIGN}": r"$-$",
    }
)


def formatted(header: Sequence[str], rows: Sequence[Sequence[str]], how: Format) -> str:
    """A table of texts.

    Args:
        header: One text a column.
        rows: As many texts each.
        how: Any but JSON, which knows no tables.
    """
    if how is Format.CSV:
        stream = io.StringIO()
        csv.writer(stream, lineterminator="\n").writerows([header, *rows])
        return stream.getvalue().rstrip("\n")
    if how is Format.MARKDOWN:
        return table_text(Table(tuple(header), tuple(tuple(row) for row in rows)))
    if how is Format.LATEX:
        return _latex(header, rows)
    return text_table(header, rows)


def _latex(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A booktabs tabular: texts to the left, numbers to the right."""
    right = [all(row[i][:1] in "-+0123456789\N{MINUS SIGN}" for row in rows) for i in range(len(header))]
    lines = [" & ".join(cell.translate(_LATEX) for cell in row) + r" \\" for row in (header, *rows)]
    columns = "".join("r" if one else "l" for one in right)
    body = [r"\toprule", lines[0], r"\midrule", *lines[1:], r"\bottomrule"]
    return "\n".join([rf"\begin{{tabular}}{{{columns}}}", *body, r"\end{tabular}"])


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns aligned by their widest entry; those that begin with a digit or a sign to the right."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    right = [all(row[i][:1] in "-+0123456789n" for row in rows) for i in range(len(header))]
    lines = []
    for row in (header, *rows):
        cells = [cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(row, widths, right, strict=True)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
