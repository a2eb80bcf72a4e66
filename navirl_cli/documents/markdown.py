"""A report as GitHub-flavoured Markdown."""

import os
import re
from pathlib import Path
from urllib.parse import quote

from navirl_cli.documents.cells import numeric_columns
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Picture, Report, Table
from navirl_cli.documents.inline import Mark, runs_of
from navirl_cli.documents.pictures import alt_of, read_picture

#: What has a meaning wherever it stands. Underscores inside of words have none, and an & only before a name.
_ANYWHERE = re.compile(r"[\\`*\[\]<~$]|(?<![^\W_])_|_(?![^\W_])|&(?=[#\w])|:(?=//)|(?<=www)\.|(?:(?<=\s)|^)#", re.I)
#: What has a meaning where a paragraph begins: quotes, items, rules.
_AT_START = re.compile(r"^(\d*)(>|[.)](?=\s|$)|[-+](?=[\s-]|$))")


def to_markdown(report: Report, folder: Path) -> str:
    """Write a report as Markdown.

    Args:
        report: What to write.
        folder: Where the text will lie; pictures are linked relative to it.

    Returns:
        The text, which ends with a line break.

    Raises:
        ArtefactError: A picture is missing, or neither .png nor .svg.
    """
    parts = [f"# {_inline(report.title)}", *(_block(block, folder) for block in report.blocks)]
    if report.footer:
        parts += ["---", _inline(report.footer)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _block(block: Block, folder: Path) -> str:
    """One block, without line breaks around it."""
    match block:
        case Heading(text, level):
            return f"{'#' * level} {_inline(text)}"
        case Paragraph(text):
            return _inline(text)
        case Bullets(items):
            return "\n".join(f"- {_inline(item)}" for item in items)
        case Table():
            return table_text(block)
        case Picture():
            return _picture(block, folder)


def _inline(text: str, *, cell: bool = False) -> str:
    """A text on one line, everything but its marks escaped.

    Args:
        text: With marks.
        cell: Whether it stands in a table, where bars part the cells, in code too.
    """
    pieces: list[str] = []
    runs = runs_of(text)
    for i, run in enumerate(runs):
        escaped = _escape(run.text, cell=cell)
        if run.mark is Mark.NONE:
            pieces.append(escaped)
        elif run.mark is Mark.CODE:
            pieces.append(f"<code>{escaped}</code>" if cell and "|" in run.text else f"`{run.text}`")
        else:
            rest = runs[i + 1 :]
            ends = not rest or (rest[0].mark is Mark.NONE and rest[0].text[0].isspace())
            pieces.append(_strong(escaped, begins=not pieces or pieces[-1][-1].isspace(), ends=ends))
    line = "".join(pieces)
    return line if cell else _AT_START.sub(r"\1\\\2", line)


def _strong(escaped: str, *, begins: bool, ends: bool) -> str:
    """Strong text; asterisks count only where its outermost characters are letters or digits, or blanks are around."""
    if (begins or escaped[0].isalnum()) and (ends or escaped[-1].isalnum()):
        return f"**{escaped}**"
    return f"<strong>{escaped}</strong>"


def _escape(text: str, *, cell: bool) -> str:
    """Plain text, wherever in a line it stands."""
    escaped = _ANYWHERE.sub(r"\\\g<0>", text)
    return escaped.replace("|", r"\|") if cell else escaped


def table_text(table: Table) -> str:
    """Header, rule and rows in columns of one width, below the caption."""
    grid = [[_inline(text, cell=True) for text in row] for row in (table.header, *table.rows)]
    widths = [max(3, *(len(row[i]) for row in grid)) for i in range(len(table.header))]
    right = numeric_columns(table)
    rule = ["-" * (w - r) + ":" * r for w, r in zip(widths, right, strict=True)]
    lines = []
    for row in (grid[0], rule, *grid[1:]):
        texts = [text.rjust(w) if r else text.ljust(w) for text, w, r in zip(row, widths, right, strict=True)]
        lines.append(f"| {' | '.join(texts)} |")
    caption = [_inline(table.caption), ""] if table.caption else []
    return "\n".join((*caption, *lines))


def _picture(picture: Picture, folder: Path) -> str:
    """A link to the picture above its caption."""
    read_picture(picture.path)
    path = picture.path.parent.resolve() / picture.path.name
    link = quote(os.fsencode(Path(os.path.relpath(path, folder.resolve())).as_posix()))
    image = f"![{_escape(alt_of(picture), cell=False)}]({link})"
    return "\n\n".join((image, _inline(picture.caption))) if picture.caption else image
