"""A report as GitHub-flavoured Markdown."""

import os
from pathlib import Path
from urllib.parse import quote

from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Picture, Report
from navirl_cli.documents.inline import markdown_escaped, markdown_of
from navirl_cli.documents.tables import Format, Table, written


def to_markdown(report: Report, folder: Path) -> str:
    """Write a report as Markdown.

    Args:
        report: What to write.
        folder: Folder of the file that is written. Pictures are linked relative to it.

    Returns:
        The text, with a line break at its end.

    Raises:
        ArtefactError: A picture is missing, or neither .png nor .svg.
    """
    parts = [f"# {markdown_of(report.title)}", *(_block(block, folder) for block in report.blocks)]
    if report.footer:
        parts += ["---", markdown_of(report.footer)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _block(block: Block, folder: Path) -> str:
    """One block, without line breaks around it."""
    match block:
        case Heading(text, level):
            return f"{'#' * level} {markdown_of(text)}"
        case Paragraph(text):
            return markdown_of(text)
        case Bullets(items):
            return "\n".join(f"- {markdown_of(item)}" for item in items)
        case Table():
            return written(block, Format.MARKDOWN)
        case Picture():
            return _picture(block, folder)


def _picture(picture: Picture, folder: Path) -> str:
    """A link to the picture above its caption."""
    picture.read()
    path = picture.path.parent.resolve() / picture.path.name
    link = quote(os.fsencode(Path(os.path.relpath(path, folder.resolve())).as_posix()))
    image = f"![{markdown_escaped(picture.alternative)}]({link})"
    return "\n\n".join((image, markdown_of(picture.caption))) if picture.caption else image
