"""A report as one HTML file that needs no network and no other file."""

import re
from base64 import b64encode
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from html import escape
from importlib.resources import files
from struct import unpack

from navirl_cli.documents.document import PNG_HEAD, Block, Bullets, Heading, Paragraph, Picture, Report, read_picture
from navirl_cli.documents.inline import html_of, plain_of
from navirl_cli.documents.tables import MINUS, Cell, Table, is_missing, sort_key

#: The class of a cell, by whether its column is numeric.
_CLASS = {False: "", True: ' class="number"'}


def to_html(report: Report) -> str:
    """Write a report as a page.

    Args:
        report: What to write.

    Returns:
        The page. The same report and pictures give the same text.

    Raises:
        ArtefactError: A picture is missing, or neither .png nor .svg.
    """
    names = _names(report)
    parts = [f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{_head(report.title)}\n</head>\n<body>']
    parts.append(f"<header><h1>{html_of(report.title)}</h1></header>")
    parts.append(_contents(report, names))
    parts += ["<main>", *(_block(block, name) for block, name in zip(report.blocks, names, strict=True)), "</main>"]
    if report.footer:
        parts.append(f"<footer><p>{html_of(report.footer)}</p></footer>")
    parts.append(f"<script>{_resource('page.js')}</script>\n</body>\n</html>\n")
    return "\n".join(part for part in parts if part)


def _head(title: str) -> str:
    """Title, style, and a policy that allows the page its own content and the one script below."""
    style = _resource("page.css")
    policy = (
        "default-src 'none'; img-src data:; base-uri 'none'; form-action 'none'; "
        f"style-src '{_hash(style)}'; script-src '{_hash(_resource('page.js'))}'"
    )
    return "\n".join(
        (
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            f"<title>{escape(plain_of(title))}</title>",
            '<link rel="icon" href="data:,">',  # without it a browser requests one from the server
            f"<style>{style}</style>",
        )
    )


@cache
def _resource(name: str) -> str:
    """A file beside this one."""
    return (files("navirl_cli.documents") / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """The name of an inline style or script in a Content-Security-Policy."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def _names(report: Report) -> list[str]:
    """For each block: the id of a heading (its words, numbered where they repeat), "" for all others."""
    names: list[str] = []
    for block in report.blocks:
        if not isinstance(block, Heading):
            names.append("")
            continue
        words = re.sub(r"\W+", "-", plain_of(block.text).casefold()).strip("-") or "section"
        name, count = words, 1
        while name in names:
            count += 1
            name = f"{words}-{count}"
        names.append(name)
    return names


def _contents(report: Report, names: list[str]) -> str:
    """Links to the headings of level 2; empty without such headings."""
    items = [
        f'<li><a href="#{name}">{html_of(block.text)}</a></li>'
        for block, name in zip(report.blocks, names, strict=True)
        if isinstance(block, Heading) and block.level == 2
    ]
    return f'<nav aria-label="Contents">\n<ul>\n{_lines(items)}\n</ul>\n</nav>' if items else ""


def _block(block: Block, name: str) -> str:
    """One block. `name` is the id of a heading."""
    match block:
        case Heading(text, level):
            return f'<h{level} id="{name}">{html_of(text)}</h{level}>'
        case Paragraph(text):
            return f"<p>{html_of(text)}</p>"
        case Bullets(items):
            return f"<ul>\n{_lines(f'<li>{html_of(item)}</li>' for item in items)}\n</ul>" if items else ""
        case Table():
            return _table(block)
        case Picture():
            return _picture(block)


def _table(table: Table) -> str:
    """A table that scrolls by itself. Its cells carry the values by which they are sorted."""
    head = [
        _cell(column.title, "th", f' scope="col"{_CLASS[right]}')
        for column, right in zip(table.columns, table.numeric, strict=True)
    ]
    caption = f"<figcaption>{html_of(table.caption)}</figcaption>\n" if table.caption else ""
    note = f'\n<p class="note">{html_of(table.note)}</p>' if table.note else ""
    label = escape(plain_of(table.caption) or "Table")
    rows = [_row(_cells(*row, table.numeric)) for row in zip(table.rows, table.shown(MINUS), strict=True)]
    return (
        f'<figure class="table">\n{caption}<div class="scroll" role="region" tabindex="0" aria-label="{label}">\n'
        f"<table>\n<thead>\n{_row(head)}\n</thead>\n<tbody>\n"
        f"{_lines(rows)}\n</tbody>\n</table>\n</div>{note}\n</figure>"
    )


def _row(cells: Iterable[str]) -> str:
    """A row of a table."""
    return f"<tr>\n{_lines(cells)}\n</tr>"


def _cells(row: tuple[Cell, ...], texts: tuple[str, ...], numeric: tuple[bool, ...]) -> list[str]:
    """The cells of a row. The first one is the header of the row, unless its column is numeric."""
    keys = [_sort_key(cell) for cell in row]
    cells = [_cell(text, "td", _CLASS[n] + key) for text, n, key in zip(texts, numeric, keys, strict=True)]
    if not numeric[0]:
        cells[0] = _cell(texts[0], "th", f' scope="row"{keys[0]}')
    return cells


def _cell(text: str, tag: str, attributes: str) -> str:
    """One cell."""
    return f"<{tag}{attributes}>{html_of(text)}</{tag}>"


def _sort_key(cell: Cell) -> str:
    """The attribute by which the script sorts a cell."""
    if is_missing(cell):
        return " data-missing"
    number = sort_key(cell)
    return "" if number is None else f' data-number="{str(number).replace("inf", "Infinity")}"'


def _picture(picture: Picture) -> str:
    """A picture, embedded, with its caption; with others for dark and for narrow screens if there are any."""
    image = f'<img src="{{}}" alt="{escape(picture.alternative)}"{{}}>'.format(*_embedded(*picture.read()))
    sources = [
        '<source media="{}" srcset="{}"{}>'.format(query, *_embedded(*read_picture(path)))
        for query, path in picture.others
    ]
    if sources:
        image = f"<picture>\n{_lines([*sources, image])}\n</picture>"
    caption = f"\n<figcaption>{html_of(picture.caption)}</figcaption>" if picture.caption else ""
    return f"<figure>\n{image}{caption}\n</figure>"


def _embedded(media_type: str, content: bytes) -> tuple[str, str]:
    """A picture as an address, and the attributes of its size."""
    size = _shown_size(content)
    attributes = f' width="{size[0]}" height="{size[1]}"' if size else ""
    return f"data:{media_type};base64,{b64encode(content).decode()}", attributes


def _shown_size(content: bytes) -> tuple[int, int] | None:
    """Width and height of a PNG on the page, in its pixels: half its own, because figures are drawn for print."""
    if not content.startswith(PNG_HEAD) or len(content) < 24:
        return None
    width, height = unpack(">II", content[16:24])  # IHDR is the first chunk
    return (width + 1) // 2, (height + 1) // 2


def _lines(parts: Iterable[str]) -> str:
    """Parts on lines of their own."""
    return "\n".join(parts)
