"""Demonstrations files made from others: some of the trials, those of several files, other labels."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import DemonstrationError
from navirl_cli.files import Input


def some_of(document: Mapping[str, Any], ids: Collection[str]) -> dict[str, Any]:
    """A demonstrations file's content with some of its trials; everything else of it stays.

    Args:
        document: As :func:`~navirl_cli.artefacts.demonstrations.demonstrations_document` makes it.
        ids: Of the trials.
    """
    kept = [one for one in document["demonstrations"] if one["id"] in ids]
    used = {one["map"] for one in kept}
    maps = {digest: content for digest, content in document["maps"].items() if digest in used}
    return {**plain(document), "maps": maps, "demonstrations": kept}


def merged(documents: Mapping[str, Mapping[str, Any]]) -> tuple[dict[str, Any], list[str]]:
    """The content of several demonstrations files in one, and what does not fit together.

    Args:
        documents: By the name of the file, in order.

    Returns:
        The content. A setting that differs is null in it, and the robot's gain is left out unless all files have the
        same; a line says so.

    Raises:
        DemonstrationError: Two trials have the same id.
    """
    refuse_twice({name: [one["id"] for one in document["demonstrations"]] for name, document in documents.items()})
    own = list(documents.values())
    inputs = {(one["file"], one["sha256"]): one for document in own for one in document["inputs"]}
    settings, notes = _common([document["settings"] for document in own])
    gains = [document.get("gain") for document in own]
    content = {
        "inputs": list(inputs.values()),
        "settings": settings,
        "maps": {digest: one for document in own for digest, one in document["maps"].items()},
        "demonstrations": [one for document in own for one in document["demonstrations"]],
    }
    if any(gains) and any(one != gains[0] for one in gains):
        notes.append("the robot's gain is left out, because it is not the same in all files; extract the logs together")
    elif gains[0] is not None:
        content["gain"] = gains[0]
    return content, notes


def refuse_twice(ids: Mapping[str, Sequence[str]]) -> None:
    """Refuse trials that are in two files.

    Args:
        ids: By the name of the file.

    Raises:
        DemonstrationError: Two trials have the same id.
    """
    owners: dict[str, str] = {}
    for name, own in ids.items():
        for one in own:
            if (other := owners.setdefault(one, name)) is not name:
                raise DemonstrationError(
                    f"{name}: expected other trials than {other}, found {one} in both; leave it out with select, give "
                    "its participant another name with relabel, or name a folder in place of the files in it"
                )


def _common(settings: Sequence[Mapping[str, Any]]) -> tuple[dict[str, Any], list[str]]:
    """Settings that files share, with null where they differ, and a line on these."""
    names = list(dict.fromkeys(name for one in settings for name in one))
    differing = [name for name in names if any(one.get(name) != settings[0].get(name) for one in settings)]
    found = {name: None if name in differing else settings[0][name] for name in names}
    notes = (
        [f"the files were extracted with different {', '.join(differing)}; all trials are kept"] if differing else []
    )
    return found, notes


def relabelled(document: Mapping[str, Any], demonstrations: Sequence[Demonstration], table: Input) -> dict[str, Any]:
    """A demonstrations file's content with the ids and labels of other demonstrations, which are in the same order.

    Args:
        document: As of :func:`some_of`.
        demonstrations: With the other labels.
        table: That states them, an input of the new file.
    """
    found = []
    for entry, one in zip(document["demonstrations"], demonstrations, strict=True):
        labels = {"id": one.id, "participant": one.participant, "condition": one.condition.value}
        found.append({**entry, **labels, "cycle": one.cycle, "set": one.set})
    inputs = [*document["inputs"], *([] if vars(table) in document["inputs"] else [vars(table)])]
    return {**plain(document), "inputs": inputs, "demonstrations": found}


def plain(document: Mapping[str, Any]) -> dict[str, Any]:
    """The content without format and version, which writing adds."""
    return {key: value for key, value in document.items() if key not in {"format", "version", "navirl"}}
