"""Known trouble, as one tree of exceptions.

Every message names the file, topic or field, what was expected, what was found and the remedy, in one line; the
command line prints it and exits with 1. Anything else that is raised is a bug and keeps its traceback.
"""


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
