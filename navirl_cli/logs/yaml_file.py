"""YAML files that other programs write."""

from pathlib import Path
from typing import Any, Final

from navirl_cli.errors import LogError, brief
from navirl_cli.files import open_regular
from navirl_cli.limits import in_mb, lifted

#: Size of a file, levels of nesting, and anchors, beyond what rosbag2 and Nav2 write.
_MOST_BYTES: Final = 8 << 20
_DEEPEST, _MOST_ANCHORS = 40, 100


def read_mapping(path: Path, remedy: str) -> dict[Any, Any]:
    """Read a YAML file whose top level is keys and values.

    Args:
        path: The file.
        remedy: What to do where the file is something else, for the message.

    Returns:
        Plain dicts, lists, texts and numbers.

    Raises:
        LogError: The file cannot be read, does not parse or holds something else.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    expected = f"{path}: expected YAML with keys and values, found"
    try:
        text = _text(path)
        if not lifted():
            _check_structure(text)
        document = YAML(typ="safe", pure=True).load(text)
    except OSError as error:
        raise LogError(f"{path}: expected a YAML file, found: {error.strerror}; {remedy}") from error
    # ruamel also raises the errors of int(), datetime() and deep nesting
    except (YAMLError, ValueError, LookupError, RecursionError, OverflowError) as error:
        raise LogError(f"{expected} {_problem(error)}; {remedy}") from error
    if document is None:
        raise LogError(f"{expected} an empty file; {remedy}")
    if not isinstance(document, dict):
        raise LogError(f"{expected} {brief(document)}; {remedy}")
    return document


def _text(path: Path) -> str:
    """The text of a file that is not larger than such files are.

    Raises:
        OSError, ValueError: It cannot be read, is too large, or is not UTF-8.
    """
    with open_regular(path) as file:
        data = file.read(-1 if lifted() else _MOST_BYTES + 1)
    if len(data) > _MOST_BYTES and not lifted():
        raise ValueError(f"more than {in_mb(_MOST_BYTES)}")
    return data.decode("utf-8")


def _check_structure(text: str) -> None:
    """Refuse what takes more time or memory than its size, before a document is built.

    Raises:
        YAMLError, ValueError: It does not parse, has aliases, whose copies can grow without end, or is nested deeply.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, NodeEvent

    depth = anchors = 0
    for event in YAML(typ="safe", pure=True).parse(text):
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        anchors += isinstance(event, NodeEvent) and event.anchor is not None
        if isinstance(event, AliasEvent):
            raise ValueError(f"line {event.start_mark.line + 1}: an alias (*{str(event.anchor)[:20]}); write it out")  # noqa: TRY004
        if depth > _DEEPEST:
            raise ValueError(f"line {event.start_mark.line + 1}: more than {_DEEPEST} levels of nesting")
        if anchors > _MOST_ANCHORS:
            raise ValueError(f"line {event.start_mark.line + 1}: more than {_MOST_ANCHORS} anchors")


def _problem(error: Exception) -> str:
    """The problem that a parser reports, on one line, with the line of the file where it is known."""
    mark = getattr(error, "problem_mark", None)
    where = f"line {mark.line + 1}: " if mark is not None else ""
    words = str(getattr(error, "problem", None) or error)
    return f"{where}{' '.join(words.split())[:100]}"
