"""JSON files, versioned, checked against their schema, written whole."""

import json
from collections.abc import Mapping
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli import __version__
from navirl_cli.arrays import FloatArray
from navirl_cli.errors import ArtefactError
from navirl_cli.files import replacing


def write_json(path: Path, kind: str, content: Mapping[str, Any], *, force: bool) -> None:
    """Write an artefact.

    Args:
        path: The file.
        kind: "demonstrations", "reward" or "metrics".
        content: Without the fields that name format and version.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    document = {"format": f"navirl/{kind}", "version": 1, "navirl": __version__, **content}
    with replacing(path, force=force) as temporary:
        temporary.write_text(json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: Path, kind: str) -> dict[str, Any]:
    """Read an artefact and check it against its schema.

    Raises:
        ArtefactError: The file is missing, no JSON, of another kind, or breaks the schema.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        hint = "; logs become demonstrations by navirl extract" if path.suffix == ".mcap" else ""
        raise ArtefactError(f"{path}: expected a JSON file of navirl {kind}, found none ({error}){hint}") from error
    found = document.get("format") if isinstance(document, dict) else None
    if found != f"navirl/{kind}":
        what = f"a file of format {found!r}" if found else "other JSON"
        raise ArtefactError(f"{path}: expected navirl {kind} (format 'navirl/{kind}'), found {what}")
    problem = next(iter(_validator(kind).iter_errors(document)), None)
    if problem is not None:
        place = "/".join(str(part) for part in problem.absolute_path) or "the whole file"
        message = problem.message if len(problem.message) < 200 else problem.message[:200] + " ..."
        raise ArtefactError(f"{path}: breaks the schema of navirl {kind} at {place}: {message}")
    return dict(document)


def _refuse_constant(name: str) -> float:
    """NaN and Infinity are no JSON."""
    raise ValueError(f"{name} is no JSON number")


@cache
def _validator(kind: str) -> Any:
    """The compiled schema of a kind of artefact."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(json.loads(schema_path(kind).read_text(encoding="utf-8")))


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
