"""Blocks of a report as plain text for a terminal."""

from collections.abc import Iterable

from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Picture
from navirl_cli.documents.inline import text_of
from navirl_cli.documents.tables import Table, written


def to_text(blocks: Iterable[Block]) -> str:
    """Write blocks below each other. A picture is replaced by its caption.

    Returns:
        The text, without a line break at its end. An empty line follows each block other than headings.
    """
    text = ""
    for block in blocks:
        own = _block(block)
        text += own and own + ("\n" if isinstance(block, Heading) else "\n\n")
    return text.rstrip("\n")


def _block(block: Block) -> str:
    match block:
        case Heading(text) | Paragraph(text):
            return text_of(text)
        case Bullets(items):
            return "\n".join(f"- {text_of(item)}" for item in items)
        case Table():
            return written(block)
        case Picture():
            return text_of(block.caption)
