"""JSON files, versioned, checked against their schema, written whole."""

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
from navirl_cli.files import replacing

#: How JSON escapes one half of a surrogate pair.
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")


def write_json(path: Path, kind: str, content: Mapping[str, Any], *, force: bool) -> None:
    """Write an artefact.

    Args:
        path: The file.
        kind: "demonstrations", "reward", "metrics" or "study".
        content: Without the fields that name format and version.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    document = {"format": f"navirl/{kind}", "version": VERSION, "navirl": __version__, **content}
    with replacing(path, force=force) as temporary:
        temporary.write_text(json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: Path, kind: str) -> dict[str, Any]:
    """Read an artefact and check it against its schema.

    Args:
        path: The file.
        kind: As in :func:`write_json`.

    Returns:
        Its content in the present version, whichever version of navirl wrote it.

    Raises:
        ArtefactError: The file is missing, no JSON, of another kind, or breaks the schema.
    """
    try:
        document = _parsed(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        hint = "; logs become demonstrations by navirl extract" if path.suffix == ".mcap" else ""
        raise ArtefactError(f"{path}: expected a JSON file of navirl {kind}, found none ({error}){hint}") from error
    found = document.get("format") if isinstance(document, dict) else None
    if found != f"navirl/{kind}":
        what = f"a file of format {brief(found)}" if isinstance(found, str) else "other JSON"
        raise ArtefactError(f"{path}: expected navirl {kind} (format 'navirl/{kind}'), found {what}")
    if not is_known(document.get("version")):
        other = shown(document.get("version"))
        raise ArtefactError(f"{path}: version: expected 1 to {VERSION}, found {other}; later ones need a later navirl")
    problem = first_problem(upgraded(document, kind), _schema(kind))
    if problem is not None:
        raise ArtefactError(f"{path}: breaks the schema of navirl {kind} at {problem}")
    return dict(document)


def _parsed(text: str) -> Any:
    """JSON without NaN and Infinity, and without halves of surrogate pairs, which no text file can hold.

    Raises:
        ValueError: It is no such JSON.
    """
    document = json.loads(text, parse_constant=_refuse_constant)
    if _SURROGATE.search(text):
        json.dumps(document, ensure_ascii=False).encode("utf-8")
    return document


def _refuse_constant(name: str) -> float:
    """NaN and Infinity are no JSON."""
    raise ValueError(f"{name} is no JSON number")


@cache
def _schema(kind: str) -> Any:
    """The schema of a kind of artefact."""
    return json.loads(schema_path(kind).read_text(encoding="utf-8"))


def schema_path(kind: str) -> Path:
    """The JSON Schema of a kind of artefact: inside an installed package, or at the top of a source tree."""
    package = Path(__file__).parent.parent
    name = f"{kind}.schema.json"
    inside = package / "schemas" / name
    return inside if inside.exists() else package.parent / "schemas" / name


def number(value: float) -> float | None:
    """A number as JSON takes it, which knows no NaN and no infinity."""
    return float(value) if isfinite(value) else None


def row(values: list[float | None]) -> FloatArray:
    """(k,) numbers of a list as :func:`numbers` writes one."""
    return np.array(values, dtype=float)


def numbers(array: FloatArray) -> list[Any]:
    """Lists of numbers, nested as the array is."""
    return [numbers(one) if one.ndim else number(float(one)) for one in array]
