"""Texts of a report: plain, with `code` and **strong** as the only marks.

Code stands between single backticks, strong text between double asterisks that touch it; neither holds the other. What
does not fit this, as a lone asterisk or backtick, is shown as it stands.
"""

import re
from dataclasses import dataclass
from enum import StrEnum

_MARKED = re.compile(
    r"(?<!`)`(?P<code>[^`]+)`(?!`)"
    r"|(?<!\*)\*\*(?=[^\s*])(?P<strong>.*?[^\s*])\*\*(?!\*)"
)
#: Whatever breaks a line or is blank, other than spaces that are not to break.
_BLANK = re.compile(r"[ \t-\r\x1c-\x1f\x85\u2028\u2029]+")
#: Characters that no HTML file may hold, or no file at all: names of files bring them along.
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]")


class Mark(StrEnum):
    """How a piece of a text is set off."""

    NONE = "none"
    CODE = "code"
    STRONG = "strong"


@dataclass(frozen=True)
class Run:
    """A piece of a text with one mark."""

    text: str
    mark: Mark


def runs_of(text: str) -> tuple[Run, ...]:
    """Take a text apart at its marks.

    Args:
        text: Any text. Runs of blanks and line breaks become one space; control characters and halves of surrogate
            pairs, which no file can hold, become U+FFFD.

    Returns:
        Its pieces in order, without the marks; none of them empty.
    """
    text = _UNPRINTABLE.sub("\ufffd", _BLANK.sub(" ", text)).strip()
    runs: list[Run] = []
    end = 0
    for match in _MARKED.finditer(text):
        runs.append(Run(text[end : match.start()], Mark.NONE))
        mark = Mark(match.lastgroup or Mark.NONE)
        runs.append(Run(match[mark], mark))
        end = match.end()
    runs.append(Run(text[end:], Mark.NONE))
    return tuple(run for run in runs if run.text)


def plain_of(text: str) -> str:
    """A text without its marks, as for a window's title."""
    return "".join(run.text for run in runs_of(text))
