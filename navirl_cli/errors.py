"""Known trouble, as one tree of exceptions.

Every message names the file, topic or field, what was expected, what was found and the remedy, in one line; the
command line prints it and exits with 1. Anything else that is raised is a bug and keeps its traceback.
"""

from collections.abc import Iterable

#: Names that a message lists at most.
MOST_NAMES = 20


class NavirlError(Exception):
    """Base of all trouble that navirl expects and can explain."""


class ArgumentError(NavirlError):
    """An argument of a call cannot be right, whatever the data hold."""


class LogError(NavirlError):
    """A log cannot be read, or does not hold what is needed."""


class FrameError(LogError):
    """A transform between two frames is missing."""


class DemonstrationError(NavirlError):
    """A trial cannot become a demonstration, or a demonstration contradicts itself."""


class GridError(NavirlError):
    """A map or a cell does not fit."""


class SceneError(NavirlError):
    """A scene has no path from start to goal, or a person where none can stand."""


class RewardError(NavirlError):
    """A reward, a parameter or a fit cannot be used."""


class ArtefactError(NavirlError):
    """A file that navirl reads or writes is missing, exists already or breaks its schema."""


class MissingPackageError(NavirlError):
    """An optional package is not installed."""


class NavirlWarning(UserWarning):
    """Results stand, but something was lost, skipped or not reached; only the Python interface uses it."""


def brief(value: object) -> str:
    """A value as a message shows it: on one line, and not longer than a line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """What a message says of a name that does not exist: the names that do, and those that are near.

    Args:
        what: The field or the type of thing, such as "trial"; empty where the context names it.
        name: What was found.
        known: What there is.
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
    """Up to three names that are spelled much like a name or contain it, the nearest first."""
    from difflib import get_close_matches

    by_lower = {one.lower(): one for one in known}
    close = get_close_matches(name.lower(), by_lower, n=3)
    holding = [one for one in by_lower if name and name.lower() in one]
    return [by_lower[one] for one in dict.fromkeys([*close, *holding])][:3]
