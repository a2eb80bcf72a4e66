"""Pictures as bytes, with what they say of themselves."""

from pathlib import Path
from struct import unpack

from navirl_cli.documents.document import Picture
from navirl_cli.documents.inline import plain_of
from navirl_cli.errors import ArtefactError

_PNG_HEAD = b"\x89PNG\r\n\x1a\n"


def read_picture(path: Path) -> tuple[str, bytes]:
    """Read a picture.

    Args:
        path: A .png or .svg file.

    Returns:
        Its media type and its bytes.

    Raises:
        ArtefactError: It is missing, cannot be read, or is neither PNG nor SVG.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        problem = f"expected a picture for the report, cannot read it ({error.strerror}); draw it again"
        raise ArtefactError(f"{path}: {problem}") from error
    if path.suffix == ".png" and content.startswith(_PNG_HEAD):
        return "image/png", content
    if path.suffix == ".svg" and b"<svg" in content:
        return "image/svg+xml", content
    raise ArtefactError(f"{path}: expected a picture in a .png or .svg file, found another; draw it as one of these")


def shown_size(content: bytes) -> tuple[int, int] | None:
    """How large a page shows a PNG, in pixels of the page: half its own, for figures are drawn for print.

    Args:
        content: The file's bytes.

    Returns:
        Width and height; None for what is no PNG.
    """
    if not content.startswith(_PNG_HEAD) or len(content) < 24:
        return None
    width, height = unpack(">II", content[16:24])  # IHDR is the first chunk
    return (width + 1) // 2, (height + 1) // 2


def alt_of(picture: Picture) -> str:
    """What stands for the picture where it cannot be seen."""
    return plain_of(picture.alt) or plain_of(picture.caption) or plain_of(picture.path.stem)
