"""YAML files that other programs write."""

from pathlib import Path
from typing import Any

from navirl_cli.errors import LogError, brief


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
        document = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise LogError(f"{path}: expected a YAML file, found: {error.strerror}; {remedy}") from error
    # ruamel also raises the errors of int(), datetime() and deep nesting
    except (YAMLError, ValueError, LookupError, RecursionError) as error:
        raise LogError(f"{expected} {_problem(error)}; {remedy}") from error
    if document is None:
        raise LogError(f"{expected} an empty file; {remedy}")
    if not isinstance(document, dict):
        raise LogError(f"{expected} {brief(document)}; {remedy}")
    return document


def _problem(error: Exception) -> str:
    """The problem that a parser reports, on one line, with the line of the file where it is known."""
    mark = getattr(error, "problem_mark", None)
    where = f"line {mark.line + 1}: " if mark is not None else ""
    words = str(getattr(error, "problem", None) or error)
    return f"{where}{' '.join(words.split())[:100]}"
