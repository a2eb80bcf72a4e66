"""Texts of a report: plain text with two marks, `code` and **strong**, in every format.

Code is enclosed in single backticks. Strong text is enclosed in double asterisks that touch it. Marks do not nest. All
other characters are shown unchanged, lone asterisks and backticks included.
"""

import re
from dataclasses import dataclass
from enum import StrEnum
from html import escape

_MARKED = re.compile(
    r"(?<!`)`(?P<code>[^`]+)`(?!`)"
    r"|(?<!\*)\*\*(?=[^\s*])(?P<strong>.*?[^\s*])\*\*(?!\*)"
)
#: Line breaks and blanks, without non-breaking spaces.
_BLANK = re.compile(r"[ \t-\r\x1c-\x1f\x85\u2028\u2029]+")
#: Characters that are not allowed in HTML or in any file. Names of files can contain them.
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]")
#: Characters with a meaning anywhere in Markdown. Underscores inside words have none; & has one before a name only.
_ANYWHERE = re.compile(r"[\\`*\[\]<~$]|(?<![^\W_])_|_(?![^\W_])|&(?=[#\w])|:(?=//)|(?<=www)\.|(?:(?<=\s)|^)#", re.I)
#: Characters with a meaning at the start of a paragraph: quotes, items, rules.
_AT_START = re.compile(r"^(\d*)(>|[.)](?=\s|$)|[-+](?=[\s-]|$))")
#: Pieces between which a long word, such as a hash, may be broken.
_PIECES = re.compile(r".*?\S{16}(?=\S{16})|.+")
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


class Mark(StrEnum):
    """How a piece of a text is marked."""

    NONE = "none"
    CODE = "code"
    STRONG = "strong"


@dataclass(frozen=True)
class Run:
    """A piece of a text with one mark."""

    text: str
    mark: Mark


def runs_of(text: str) -> tuple[Run, ...]:
    """Split a text at its marks.

    Args:
        text: Any text. Several blanks or line breaks become one space. Control characters and halves of surrogate pairs
            become U+FFFD.

    Returns:
        Its pieces in order, without the marks. No piece is empty.
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


def printable(text: str) -> str:
    """A text for a terminal, with its line breaks: characters that steer terminals become U+FFFD."""
    return "\n".join(_UNPRINTABLE.sub("\ufffd", line.replace("\t", " ")) for line in text.split("\n"))


def text_of(text: str) -> str:
    """A text for a terminal: code keeps its backticks, strong text is plain."""
    return "".join(f"`{run.text}`" if run.mark is Mark.CODE else run.text for run in runs_of(text))


def plain_of(text: str) -> str:
    """A text without its marks, for instance for the title of a window."""
    return "".join(run.text for run in runs_of(text))


def markdown_of(text: str, *, cell: bool = False) -> str:
    """A text on one line of Markdown. All characters but the marks are escaped.

    Args:
        text: With marks.
        cell: Whether it is in a table, where a bar separates cells, in code too.
    """
    pieces: list[str] = []
    runs = runs_of(text)
    for i, run in enumerate(runs):
        escaped = markdown_escaped(run.text, cell=cell)
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


def markdown_escaped(text: str, *, cell: bool = False) -> str:
    """Plain text, wherever in a line it stands."""
    escaped = _ANYWHERE.sub(r"\\\g<0>", text)
    return escaped.replace("|", r"\|") if cell else escaped


def latex_of(text: str) -> str:
    """A text in LaTeX. All characters but the marks are escaped."""
    commands = {Mark.CODE: r"\texttt{%s}", Mark.STRONG: r"\textbf{%s}", Mark.NONE: "%s"}
    return "".join(commands[run.mark].replace("%s", run.text.translate(_LATEX)) for run in runs_of(text))


def html_of(text: str) -> str:
    """A text in HTML. Marks become elements, all other characters are escaped, long words may be broken."""
    tags = {Mark.CODE: "code", Mark.STRONG: "strong"}
    pieces = []
    for run in runs_of(text):
        escaped = "<wbr>".join(escape(piece) for piece in _PIECES.findall(run.text))
        tag = tags.get(run.mark)
        pieces.append(f"<{tag}>{escaped}</{tag}>" if tag else escaped)
    return "".join(pieces)
