"""What a report consists of, whatever it is written as.

All texts are plain, with the two marks of :mod:`navirl_cli.documents.inline`; whatever else they hold is shown as it
stands.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from navirl_cli.documents.tables import Table


@dataclass(frozen=True)
class Heading:
    """A section's title; those of level 2 make the table of contents."""

    text: str
    #: 2 to 6; level 1 is the report's title.
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
    """An unordered list, one text an item."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Picture:
    """A figure with what is written below it."""

    #: An existing .png or .svg file.
    path: Path
    caption: str
    #: What who cannot see the picture is told; without it the caption.
    alt: str = ""


Block: TypeAlias = Heading | Paragraph | Bullets | Table | Picture


@dataclass(frozen=True)
class Report:
    """A document from its title to its footer."""

    title: str
    blocks: tuple[Block, ...]
    footer: str = ""
