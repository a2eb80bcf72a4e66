"""The blocks of a report, for every format.

All texts are plain, with the two marks of :mod:`navirl_cli.documents.inline`. All other characters are shown unchanged.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from navirl_cli.documents.inline import plain_of
from navirl_cli.documents.tables import Table
from navirl_cli.errors import ArtefactError

#: Screens that are narrower have their own pictures, px.
NARROW_PX = 600
#: The first bytes of a PNG file.
PNG_HEAD = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class Heading:
    """The title of a section. Titles of level 2 make the table of contents."""

    text: str
    #: 2 to 6. Level 1 is the title of the report.
    level: int = 2

    def __post_init__(self) -> None:
        """Check the level."""
        if not 2 <= self.level <= 6:
            raise ValueError(f"a heading's level must be 2 to 6, found {self.level}")


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """An unordered list with one text for each item."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Picture:
    """A figure with its caption."""

    #: An existing .png or .svg file.
    path: Path
    caption: str
    #: Text for readers who cannot see the picture; the caption where it is empty.
    alt: str = ""
    #: The same for a dark screen, for a screen narrower than NARROW_PX, and for both; only pages use them.
    dark: Path | None = None
    narrow: Path | None = None
    narrow_dark: Path | None = None

    @property
    def alternative(self) -> str:
        """The text for readers who cannot see the picture, without marks."""
        return plain_of(self.alt) or plain_of(self.caption) or plain_of(self.path.stem)

    def read(self) -> tuple[str, bytes]:
        """Media type and bytes of the file; raises as :func:`read_picture`."""
        return read_picture(self.path)

    @property
    def others(self) -> list[tuple[str, Path]]:
        """Files for some screens, each with the media query that chooses it; the first that fits counts."""
        dark, narrow = "(prefers-color-scheme: dark)", f"(max-width: {NARROW_PX - 1}px)"
        known = (
            (f"screen and {narrow} and {dark}", self.narrow_dark),
            (f"screen and {narrow}", self.narrow),
            (f"screen and {dark}", self.dark),
        )
        return [(query, path) for query, path in known if path is not None]


def read_picture(path: Path) -> tuple[str, bytes]:
    """Media type and bytes of a picture's file.

    Raises:
        ArtefactError: The file is missing, cannot be read, or is neither PNG nor SVG.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        problem = f"expected a picture for the report, cannot read it ({error.strerror}); draw it again"
        raise ArtefactError(f"{path}: {problem}") from error
    if path.suffix == ".png" and content.startswith(PNG_HEAD):
        return "image/png", content
    if path.suffix == ".svg" and b"<svg" in content:
        return "image/svg+xml", content
    raise ArtefactError(f"{path}: expected a PNG or SVG picture, found another file; draw it as one of these")


Block: TypeAlias = Heading | Paragraph | Bullets | Table | Picture


@dataclass(frozen=True)
class Report:
    """A document from its title to its footer."""

    title: str
    blocks: tuple[Block, ...]
    footer: str = ""
