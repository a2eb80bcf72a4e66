"""Expected errors, as one tree of exceptions.

Every message names the file, topic or field, what was expected, what was found and the remedy, in one line. The command
line prints it and exits with 1, or with 3 where all trials were left out as cut off. Any other exception is a bug and
keeps its traceback.
"""

from collections.abc import Iterable, Iterator
from typing import ClassVar

#: Largest number of names that a message lists.
MOST_NAMES = 20
#: Largest number of reasons that a message lists, and of letters of each.
MOST_REASONS, MOST_LETTERS = 5, 700


class NavirlError(Exception):
    """Base of all errors that navirl expects and explains."""

    #: Of the command line.
    exit_code: ClassVar[int] = 1


class ArgumentError(NavirlError):
    """An argument is invalid, whatever the data hold."""


class LogError(NavirlError):
    """A log cannot be read, or lacks required data."""


class FrameError(LogError):
    """A transform between two frames is missing."""


class DemonstrationError(NavirlError):
    """A trial cannot become a demonstration, or a demonstration contradicts itself."""


class TruncatedError(DemonstrationError):
    """Poses are missing at the beginning or end of trials, so that nothing of a recording is left."""

    exit_code = 3


class GridError(NavirlError):
    """A map or a cell is invalid."""


class SceneError(NavirlError):
    """A scene has no path from start to goal, or a person stands at an impossible place."""


class RewardError(NavirlError):
    """A reward, a parameter or a fit cannot be used."""


class ArtefactError(NavirlError):
    """A file that navirl reads or writes is missing, exists already or breaks its schema."""


class LabelError(ArtefactError):
    """A table of trials does not fit the logs."""


class MissingPackageError(NavirlError):
    """An optional package is not installed."""


class NavirlWarning(UserWarning):
    """A warning: the results are valid, but data was lost or skipped, or a fit did not converge.

    Only the Python interface gives it.
    """


def joined(reasons: Iterable[str], prefix: str = "") -> str:
    """Reasons in one line: each once and not longer than a paragraph, of many the first ones.

    Args:
        reasons: The most specific first.
        prefix: What each begins with and the line need not repeat.
    """
    own = list(dict.fromkeys(reason.removeprefix(prefix) for reason in reasons))
    shown = [one if len(one) <= MOST_LETTERS else f"{one[: MOST_LETTERS - 3]}..." for one in own[:MOST_REASONS]]
    if len(own) > MOST_REASONS:
        shown.append(f"and {len(own) - MOST_REASONS} more")
    return "; ".join(shown)


def brief(value: object) -> str:
    """A value as a message shows it: on one line, cut to the length of a line."""
    text = ""
    for piece in _pieces(value):
        text += piece
        if len(text) > 400:  # what follows is cut
            break
    text = " ".join(text.split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _pieces(value: object) -> Iterator[str]:
    """The `repr` of a value piece by piece, so that what is large or shared is never written out as a whole."""
    if type(value) is list:
        yield "["
        for number, one in enumerate(value):
            yield ", " if number else ""
            yield from _pieces(one)
        yield "]"
    elif type(value) is dict:
        yield "{"
        for number, (key, one) in enumerate(value.items()):
            yield f"{', ' if number else ''}"
            yield from _pieces(key)
            yield ": "
            yield from _pieces(one)
        yield "}"
    elif isinstance(value, str | bytes) and len(value) > 400:
        yield repr(value[:400])
    elif isinstance(value, int) and value.bit_length() > 14_000:  # Python does not write more digits
        yield f"an integer of {value.bit_length()} bits"
    else:
        yield repr(value)


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """The message for an unknown name: the existing names, and those of similar spelling.

    Args:
        what: The field or the type of thing, such as "trial"; empty where the context names it.
        name: What was found.
        known: The existing names.
    """
    names = list(known)
    shown = [repr(one) for one in names[:MOST_NAMES]]
    if len(names) > MOST_NAMES:
        shown.append(f"{len(names) - MOST_NAMES} more")
    expected = f"one of {', '.join(shown)}" if len(names) > 1 else "".join(shown) or "nothing"
    near = " or ".join(map(repr, nearest(str(name), names)))
    prefix = f"{what}: " if what else ""
    return f"{prefix}expected {expected}, found {brief(name)}" + (f"; did you mean {near}?" if near else "")


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Up to three names that contain a name or have a similar spelling, the most similar first."""
    from difflib import get_close_matches

    by_lower = {one.lower(): one for one in known}
    close = get_close_matches(name.lower(), by_lower, n=3)
    holding = [one for one in by_lower if name and name.lower() in one]
    return [by_lower[one] for one in dict.fromkeys([*close, *holding])][:3]
