"""Expected errors, as one tree of exceptions.

Every message names the file, topic or field, what was expected, what was found and the remedy, in one line. The command
line prints it and exits with 1, or with 3 where all trials were left out as cut off. Any other exception is a bug and
keeps its traceback.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import ClassVar, Final, cast

#: Largest number of names that a message lists.
MOST_NAMES = 20
#: Letters of a value that a message shows, and letters that are written at most before it is cut.
_LINE: Final = 60
_MOST_WRITTEN: Final = 4 * _LINE
#: Python refuses to write integers that are much longer.
_MOST_BITS: Final = 10_000
_BRACKETS: Final[dict[type, tuple[str, str]]] = {list: ("[", "]"), tuple: ("(", ")"), dict: ("{", "}"), set: ("{", "}")}
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


class WorkerLostError(NavirlError):
    """The process that worked on an item ended, again and again."""


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


def refuse_beside(why: str, given: Mapping[str, object], instead: str) -> None:
    """Refuse arguments that exclude another one, naming those that were given and what to do.

    Args:
        why: The other argument, and why it excludes them.
        given: The arguments by name, which words may follow, with their values; those that are false or empty were not
            given.
        instead: What else to do than to leave them out.

    Raises:
        ArgumentError: One was given.
    """
    words = [name.partition(" ") for name, value in given.items() if value]
    names = [f"`{name}`{space}{rest}" for name, space, rest in words]
    if names:
        listed = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
        raise ArgumentError(f"{why}: leave out {listed}, or {instead}")


def counted(number: int, what: str) -> str:
    """A number with its noun, as in "1 trial" and "2 trials".

    Args:
        number: Of things.
        what: The noun for one of them, whose plural ends with s.
    """
    return f"{number} {what}{'' if number == 1 else 's'}"


class Number(int):
    """A number of things that chooses words by itself: ``f"{n} message{n:|s} {n:is|are} lost"``.

    As a format, two words with a bar between them give the first for 1 and the second otherwise; an empty format gives
    the digits.
    """

    def __format__(self, words: str) -> str:
        """The digits, or one of two words."""
        if "|" not in words:
            return super().__format__(words)
        one, _, several = words.partition("|")
        return one if self == 1 else several


def brief(value: object) -> str:
    """A value as a message shows it: on one line, cut to the length of a line; what is cut is never written out."""
    text, cut = "", False
    for piece in _written(value):
        text += piece
        if cut := len(text) > _MOST_WRITTEN:
            break
    text = " ".join(text.split())
    return text if not cut and len(text) <= _LINE else f"{text[: _LINE - 3]}..."


def _written(value: object) -> Iterator[str]:
    """What `repr` makes of a value, piece by piece, so that one that is nested or shared need not be written whole."""
    if type(value) in _BRACKETS and value:
        opening, closing = _BRACKETS[type(value)]
        yield opening
        for number, one in enumerate(cast("Iterable[object]", value)):
            yield ", " if number else ""
            yield from _written(one)
            if isinstance(value, dict):
                yield ": "
                yield from _written(value[one])
        yield ",)" if type(value) is tuple and len(value) == 1 else closing
    elif isinstance(value, str | bytes):
        yield repr(value[: _MOST_WRITTEN + 1])
    elif isinstance(value, int) and value.bit_length() > _MOST_BITS:
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
