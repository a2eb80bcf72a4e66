"""A check of JSON against a schema, for the part of JSON Schema (draft 2020-12) that the schemas of navirl use.

The package jsonschema takes longer to import than a small file to read. tests/test_json_schema.py compares the verdicts
of both. Numbers must be finite here, which JSON Schema does not require.
"""

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from navirl_cli.errors import brief

Schema: TypeAlias = Mapping[str, Any]
#: The path to a value from the top of the document: names of fields and numbers of items.
Place: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True)
class Problem:
    """A value that does not fit the schema."""

    place: Place
    #: What was expected and found.
    text: str

    def __str__(self) -> str:
        """Place and text on one line."""
        return f"{'/'.join(map(str, self.place)) or 'the whole file'}: {self.text}"


def shown(value: object) -> str:
    """A value as a message shows it. Lists and objects are shown by their size."""
    if isinstance(value, list):
        return f"a list of {len(value)} items"
    return f"an object of {len(value)} fields" if isinstance(value, dict) else brief(value)


def first_problem(document: object, schema: Schema) -> Problem | None:
    """The first value that does not fit a schema, or None.

    Args:
        document: As parsed from JSON.
        schema: With the keywords below and annotations; references must not be circular.

    Raises:
        ValueError: The schema has another keyword.
    """
    return next(_problems(document, schema, schema, ()), None)


def _problems(value: Any, schema: Schema, root: Schema, place: Place) -> Iterator[Problem]:
    """What does not fit, in the order of the schema."""
    for keyword, wanted in schema.items():
        if keyword in _ANNOTATIONS:
            continue
        if keyword in _PLAIN:
            applies, fits, expected = _PLAIN[keyword]
            if isinstance(value, applies) and not fits(value, wanted):
                yield Problem(place, f"expected {expected(wanted)}, found {shown(value)}")
        elif keyword in _NESTED:
            yield from _NESTED[keyword](value, schema, root, place)
        else:
            raise ValueError(f"a schema of navirl cannot use the keyword {keyword}")


_ANNOTATIONS = {"$schema", "$defs", "title", "description"}


def _is_number(value: object) -> bool:
    """Whether a value is a number that a double can hold."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


_TYPES: Mapping[str, Callable[[Any], bool]] = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
    "number": _is_number,
    "integer": lambda value: _is_number(value) and value == int(value),
}
_WORDS = {"object": "an object", "array": "a list", "string": "a text", "boolean": "true or false", "null": "null"}
_WORDS |= {"number": "a number", "integer": "a whole number"}


def _names(wanted: str | list[str]) -> list[str]:
    return [wanted] if isinstance(wanted, str) else wanted


def _is_one_of(value: object, wanted: list[object]) -> bool:
    """Whether a value is in a list; 1 is not true."""
    return any(value == one and isinstance(value, bool) == isinstance(one, bool) for one in wanted)


_NUMBER = (int, float)
#: By keyword: the type of values that it applies to, whether a value fits, and what is expected. True and false count
#: as numbers here, but no schema allows them beside a bound.
_PLAIN: Mapping[str, tuple[Any, Callable[[Any, Any], bool], Callable[[Any], str]]] = {
    "type": (
        object,
        lambda value, wanted: any(_TYPES[name](value) for name in _names(wanted)),
        lambda wanted: " or ".join(_WORDS[name] for name in _names(wanted)),
    ),
    "const": (object, lambda value, wanted: _is_one_of(value, [wanted]), repr),
    "enum": (object, _is_one_of, lambda wanted: f"one of {', '.join(map(repr, wanted))}"),
    "minimum": (_NUMBER, lambda value, wanted: value >= wanted, "{:g} or more".format),
    "maximum": (_NUMBER, lambda value, wanted: value <= wanted, "{:g} or less".format),
    "exclusiveMinimum": (_NUMBER, lambda value, wanted: value > wanted, "more than {:g}".format),
    "minLength": (str, lambda value, wanted: len(value) >= wanted, "a text of {} characters or more".format),
    "pattern": (str, lambda value, wanted: re.search(wanted, value) is not None, "a text that matches {}".format),
    "minItems": (list, lambda value, wanted: len(value) >= wanted, "a list of {} items or more".format),
    "maxItems": (list, lambda value, wanted: len(value) <= wanted, "a list of {} items or less".format),
    "minProperties": (dict, lambda value, wanted: len(value) >= wanted, "an object of {} fields or more".format),
}


def _reference(value: Any, schema: Schema, root: Schema, place: Place) -> Iterator[Problem]:
    """A schema elsewhere in the same file."""
    target: Any = root
    for name in schema["$ref"].removeprefix("#/").split("/"):
        target = target[name]
    yield from _problems(value, target, root, place)


def _required(value: Any, schema: Schema, _root: Schema, place: Place) -> Iterator[Problem]:
    if isinstance(value, dict):
        for name in schema["required"]:
            if name not in value:
                yield Problem(place, f"expected the field {name!r}, which is missing")


def _properties(value: Any, schema: Schema, root: Schema, place: Place) -> Iterator[Problem]:
    if isinstance(value, dict):
        for name, wanted in schema["properties"].items():
            if name in value:
                yield from _problems(value[name], wanted, root, (*place, name))


def _additional(value: Any, schema: Schema, root: Schema, place: Place) -> Iterator[Problem]:
    """Fields that "properties" does not name: forbidden, or all with one schema."""
    wanted = schema["additionalProperties"]
    if isinstance(value, dict):
        for name in value:
            if name in schema.get("properties", {}):
                continue
            if isinstance(wanted, bool):
                if not wanted:
                    yield Problem(place, f"expected no field {name!r}, which the format does not know")
            else:
                yield from _problems(value[name], wanted, root, (*place, name))


def _items(value: Any, schema: Schema, root: Schema, place: Place) -> Iterator[Problem]:
    if isinstance(value, list):
        for number, item in enumerate(value):
            yield from _problems(item, schema["items"], root, (*place, number))


def _one_of(value: Any, schema: Schema, root: Schema, place: Place) -> Iterator[Problem]:
    """Exactly one of several schemas. If none fits, the problem of the last one is reported."""
    found = [next(_problems(value, one, root, place), None) for one in schema["oneOf"]]
    if found.count(None) > 1:
        yield Problem(place, f"expected what only one of {len(found)} choices allows, found {shown(value)}")
    elif None not in found and found[-1] is not None:
        yield found[-1]


_NESTED: Mapping[str, Callable[[Any, Schema, Schema, Place], Iterator[Problem]]] = {
    "$ref": _reference,
    "required": _required,
    "properties": _properties,
    "additionalProperties": _additional,
    "items": _items,
    "oneOf": _one_of,
}
