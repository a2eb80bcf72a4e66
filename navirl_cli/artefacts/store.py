"""JSON files with a version. They are checked against their schema when they are read."""

import gc
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
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

#: The kinds of artefacts.
KINDS = ("demonstrations", "reward", "metrics", "plan", "study")
#: How JSON escapes one half of a surrogate pair.
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")

#: The first bytes of a log.
_MCAP = b"\x89MCAP"


@contextmanager
def no_garbage() -> Iterator[None]:
    """No search for garbage in the block: large contents hold none, and each search would walk through all of them."""
    searching = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if searching:
            gc.enable()


def write_json(path: Path, artefact: str, content: Mapping[str, Any], *, force: bool) -> None:
    """Write an artefact.

    Args:
        path: The file.
        artefact: "demonstrations", "reward", "metrics", "study" or "manifest".
        content: Without the fields that name format and version.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    with replacing(path, force=force) as temporary:
        temporary.write_bytes(as_bytes(artefact, content))


@no_garbage()
def as_bytes(artefact: str, content: Mapping[str, Any]) -> bytes:
    """The bytes of an artefact's file; arguments as of :func:`write_json`."""
    document = {"format": f"navirl/{artefact}", "version": VERSION, "navirl": __version__, **content}
    return (json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n").encode()


def read_json(path: Path, artefact: str, sha256: str | None = None) -> dict[str, Any]:
    """Read an artefact and check it against its schema.

    Args:
        path: The file.
        artefact: As in :func:`write_json`.
        sha256: What its bytes must hash to; None for any.

    Returns:
        Its content in the present version, whichever version of navirl wrote it.

    Raises:
        ArtefactError: The file is missing, is not JSON or another artefact, or does not fit the schema.
    """
    return _checked(_content(path, artefact, sha256), path, artefact)


def read_any(path: Path) -> tuple[str, dict[str, Any]]:
    """Read an artefact of any kind.

    Args:
        path: The file.

    Returns:
        Its kind, as in :func:`write_json`, and its content as of :func:`read_json`.

    Raises:
        ArtefactError: As in :func:`read_json`.
    """
    document = _content(path, " or ".join(KINDS))
    found = document.get("format") if isinstance(document, dict) else None
    kind = next((kind for kind in KINDS if found == f"navirl/{kind}"), None)
    if kind is None:
        what = f"format {brief(found)}" if isinstance(found, str) else "other JSON"
        raise ArtefactError(f"{path}: expected a file of navirl {' or '.join(KINDS)}, found {what}")
    return kind, _checked(document, path, kind)


@no_garbage()
def _content(path: Path, artefact: str, sha256: str | None = None) -> Any:
    """The content of a JSON file; arguments as of :func:`read_json`.

    Raises:
        ArtefactError: It cannot be read.
    """
    try:
        data = read_regular(path)
        if sha256 is not None and hashlib.sha256(data).hexdigest() != sha256:
            raise ArtefactError(f"{path}: expected the bytes that the manifest names, found others; extract again")
        return _parsed(data.decode("utf-8"))
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        found = "an MCAP log; navirl extract makes demonstrations of it" if data.startswith(_MCAP) else "no text"
        raise ArtefactError(f"{path}: expected a JSON file of navirl {artefact}, found {found}") from error
    except (ValueError, RecursionError) as error:
        raise ArtefactError(f"{path}: expected a JSON file of navirl {artefact}, found none ({error})") from error


def _checked(document: Any, path: Path, artefact: str) -> dict[str, Any]:
    """A file's content in the present version, checked.

    Raises:
        ArtefactError: It is another artefact, or does not fit the schema.
    """
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
        try:
            json.dumps(document, ensure_ascii=False).encode("utf-8")
        except UnicodeEncodeError as error:
            half = ascii(error.object[error.start])[1:-1]
            raise ValueError(f"{half}, half of a surrogate pair, which no text has; write the file again") from error
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
