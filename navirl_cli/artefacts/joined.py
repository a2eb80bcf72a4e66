"""Several files and folders of demonstrations as one."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from navirl_cli import __version__
from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.editing import merged, refuse_twice
from navirl_cli.artefacts.manifest import inputs_of, manifest_path, numbered, read_manifest
from navirl_cli.artefacts.store import read_json
from navirl_cli.artefacts.versions import VERSION
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import ArgumentError, ArtefactError
from navirl_cli.files import MANIFEST

_FORMAT = {"format": "navirl/demonstrations", "version": VERSION, "navirl": __version__}


def read_joined(paths: Sequence[Path]) -> list[Demonstration]:
    """Demonstrations of files and of folders with a manifest, in their order.

    Raises:
        ArgumentError: A path is named twice.
        ArtefactError: As in :func:`read_demonstrations`.
        DemonstrationError: Two trials have the same id.
    """
    _refuse_same(paths)
    found = {str(path): read_demonstrations(path) for path in paths}
    refuse_twice({name: [one.id for one in own] for name, own in found.items()})
    return [one for own in found.values() for one in own]


def read_content(paths: Sequence[Path]) -> tuple[dict[str, Any], list[str]]:
    """The content of demonstrations files, and of folders with a manifest, as that of one file.

    Args:
        paths: At least one.

    Returns:
        The content, and what of several files does not fit together (:func:`~navirl_cli.artefacts.editing.merged`).

    Raises:
        NavirlError: As :func:`read_contents`, and two trials have the same id.
    """
    return as_one(read_contents(paths))


def as_one(contents: Mapping[Path, Mapping[str, Any]]) -> tuple[dict[str, Any], list[str]]:
    """The contents of several files as that of one, and what does not fit together.

    Raises:
        DemonstrationError: Two trials have the same id.
    """
    if len(contents) == 1:
        return dict(next(iter(contents.values()))), []
    content, notes = merged({str(path): one for path, one in contents.items()})
    return _FORMAT | content, notes


def read_contents(paths: Sequence[Path]) -> dict[Path, dict[str, Any]]:
    """The contents of demonstrations files, and of folders with a manifest, in their order.

    Args:
        paths: At least one.

    Raises:
        ArgumentError: A path is named twice.
        ArtefactError: As in :func:`~navirl_cli.artefacts.store.read_json`.
        DemonstrationError: Two trials have the same id.
    """
    _refuse_same(paths)
    return {path: _content(path) for path in paths}


def _content(path: Path) -> dict[str, Any]:
    """The content of a demonstrations file, or of all files that a manifest lists."""
    listing = manifest_path(path)
    if listing.name != MANIFEST:
        return read_json(path, "demonstrations")
    contents: dict[str, dict[str, Any]] = {}
    entries, before = read_manifest(listing), Counter[str]()
    for entry in entries:
        if entry.file is not None:
            content = read_json(listing.parent / entry.file, "demonstrations", entry.file_sha256)
            ids = numbered(entry, [(one["participant"], one["id"]) for one in content["demonstrations"]], before)
            for one, name in zip(content["demonstrations"], ids, strict=True):
                one["id"] = name
            contents[entry.file] = content
    if not contents:
        raise ArtefactError(f"{path}: expected logs with demonstrations, found none among {len(entries)}")
    return _FORMAT | merged(contents)[0] | {"inputs": [vars(one) for one in inputs_of(entries)]}


def _refuse_same(paths: Sequence[Path]) -> None:
    """Refuse a file that is named twice, by whatever name."""
    places = [path.resolve() for path in paths]
    for path, place in zip(paths, places, strict=True):
        if places.count(place) > 1:
            raise ArgumentError(f"{path}: expected different files of demonstrations, found this one twice")
