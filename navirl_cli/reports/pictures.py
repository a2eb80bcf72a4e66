"""The figures of a page, as files by name, with those for other screens."""

from collections.abc import Mapping
from pathlib import Path

from navirl_cli.documents.document import Block, Picture


def pictures(files: Mapping[str, Path], captions: Mapping[str, str], *names: str) -> list[Block]:
    """The figures of these names that there are, in this order.

    Args:
        files: By name. NAME_dark, NAME_narrow and NAME_narrow_dark are the same figure for dark and narrow screens.
        captions: By name.
        names: Those wanted.
    """
    return [
        Picture(
            files[name],
            captions[name],
            dark=files.get(f"{name}_dark"),
            narrow=files.get(f"{name}_narrow"),
            narrow_dark=files.get(f"{name}_narrow_dark"),
        )
        for name in names
        if name in files
    ]
