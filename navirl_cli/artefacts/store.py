"""JSON files with a version. They are checked against their schema when they are read."""

import json
import re
from collections.abc import Mapping
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli import __version__
from navirl_cli.arrays import FloatArray
from navirl_cli.artefacts.schema import first_problem, shown
from navirl_cli.artefacts.versions import VERSION, is_known, upgraded
from navirl_cli.errors import ArtefactError, brief
from navirl_cli.files import read_regular, replacing

#: How JSON escapes one half of a surrogate pair.
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")


def write_json(path: Path, artefact: str, content: Mapping[str, Any], *, force: bool) -> None:
    """Write an artefact.

    Args:
        path: The file.
        artefact: "demonstrations", "reward", "metrics" or "study".
        content: Without the fields that name format and version.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    document = {"format": f"navirl/{artefact}", "version": VERSION, "navirl": __version__, **content}
    with replacing(path, force=force) as temporary:
        temporary.write_text(json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: Path, artefact: str) -> dict[str, Any]:
    """Read an artefact and check it against its schema.

    Args:
        path: The file.
        artefact: As in :func:`write_json`.

    Returns:
        Its content in the present version, whichever version of navirl wrote it.

    Raises:
        ArtefactError: The file is missing, is not JSON or another artefact, or does not fit the schema.
    """
    try:
        document = _parsed(read_regular(path).decode("utf-8"))
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        hint = "; logs become demonstrations by navirl extract" if path.suffix == ".mcap" else ""
        raise ArtefactError(f"{path}: expected a JSON file of navirl {artefact}, found none ({error}){hint}") from error
    found = document.get("format") if isinstance(document, dict) else None
    if found != f"navirl/{artefact}":
        what = f"a file of format {brief(found)}" if isinstance(found, str) else "other JSON"
        raise ArtefactError(f"{path}: expected navirl {artefact} (format 'navirl/{artefact}'), found {what}")
    if not is_known(document.get("version")):
        other = shown(document.get("version"))
        raise ArtefactError(f"{path}: version: expected 1 to {VERSION}, found {other}; later ones need a later navirl")
    problem = first_problem(upgraded(document, artefact), _schema(artefact))
    if problem is not None:
        raise ArtefactError(f"{path}: breaks the schema of navirl {artefact} at {problem}")
    return dict(document)


def _parsed(text: str) -> Any:
    """Parse JSON. NaN, Infinity and halves of surrogate pairs are refused.

    Raises:
        ValueError: The text is not JSON, or holds one of these.
    """
    document = json.loads(text, parse_constant=_refuse_constant)
    if _SURROGATE.search(text):
        json.dumps(document, ensure_ascii=False).encode("utf-8")
    return document


def _refuse_constant(name: str) -> float:
    """Refuse NaN and Infinity, which JSON does not have."""
    raise ValueError(f"{name} is no JSON number")


@cache
def _schema(artefact: str) -> Any:
    """The schema of an artefact."""
    return json.loads(schema_path(artefact).read_text(encoding="utf-8"))


def schema_path(artefact: str) -> Path:
    """The file of an artefact's JSON Schema: inside an installed package, or at the top of a source tree."""
    package = Path(__file__).parent.parent
    name = f"{artefact}.schema.json"
    inside = package / "schemas" / name
    return inside if inside.exists() else package.parent / "schemas" / name


def number(value: float) -> float | None:
    """A number for JSON: None for NaN and infinity."""
    return float(value) if isfinite(value) else None


def row(values: list[float | None]) -> FloatArray:
    """(k,) numbers of a list that :func:`numbers` wrote; null becomes NaN."""
    return np.array(values, dtype=float)


def numbers(array: FloatArray) -> list[Any]:
    """An array as nested lists for JSON."""
    return [numbers(one) if one.ndim else number(float(one)) for one in array]
