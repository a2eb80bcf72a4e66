"""The options of a call as words of the command line, by which an artefact says how it was made."""

from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any

from navirl_cli.irl.terms.registry import word_of

#: Options that do not change a result and are not kept, with the reason.
NOT_KEPT: Mapping[str, str] = {
    "output": "the report names the file by its present name",
    "force": "whether a file was replaced",
    "json": "the form of what is printed",
    "workers": "where it was computed: results are the same",
    "cluster": "where it was computed: results are the same",
    "executor": "where it was computed: results are the same",
}


def option_words(given: Mapping[str, Any], defaults: Mapping[str, Any]) -> list[str]:
    """Options with their values, in the order of their names; those that have their default are left out.

    Args:
        given: Values by the name of the option, with underscores: flags, texts, numbers, files, several of these,
            terms, or values by name. Of a file the name without its folders is kept, as in the inputs; an object in
            place of a file is named as the option.
        defaults: By the same names.
    """
    words: list[str] = []
    for name in sorted(given):
        value, option = given[name], f"--{name.replace('_', '-')}"
        if name in NOT_KEPT or value is None or value is False or value == defaults.get(name):
            continue
        words += [option] if value is True else [word for one in _values(name, value) for word in (option, one)]
    return words


def _values(name: str, value: Any) -> Iterator[str]:
    """The words of an option's value, one for each time that it is repeated."""
    if name == "terms":
        parts = value.split(",") if isinstance(value, str) else value
        yield ",".join(Path(part.strip()).name if isinstance(part, str) else word_of(part) for part in parts)
    elif isinstance(value, Mapping):
        yield ",".join(f"{key}={_word(one)}" for key, one in value.items())
    elif isinstance(value, list | tuple | set | frozenset):
        yield from map(_word, value)
    elif name in {"init", "prior"} and not (isinstance(value, str) and "=" in value):
        yield Path(value).name if isinstance(value, str | Path) else f"{name}.json"
    else:
        yield _word(value)


def _word(value: object) -> str:
    """One value."""
    if isinstance(value, float | int):
        return f"{value:.15g}"
    return value.value if isinstance(value, Enum) else value.name if isinstance(value, Path) else str(value)
