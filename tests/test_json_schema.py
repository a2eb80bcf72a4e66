"""The check of artefacts against their schemas gives the verdicts of the package jsonschema."""

import json
import random
from copy import deepcopy
from math import inf
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from navirl_cli.artefacts.schema import first_problem
from navirl_cli.artefacts.store import read_json, schema_path

KINDS = ("demonstrations", "reward", "metrics", "study")
OLD = Path(__file__).parent / "version1"
#: What a value is replaced by.
VALUES = (None, True, False, 0, 1, -1, 2, 0.5, -1e9, 1e9, "", "a", "force", [], [0, 0], [None], ["a"], {}, {"a": 1})


def schema_of(kind):
    return json.loads(schema_path(kind).read_text())


def places(value, place=()):
    """The ways to all values of a document but the numbers of long lists."""
    yield place
    items = value.items() if isinstance(value, dict) else enumerate(value[:3]) if isinstance(value, list) else ()
    for key, one in items:
        yield from places(one, (*place, key))


def mutated(document, place, rng):
    """The document with one thing changed at a place, or None where nothing can be."""
    changed = deepcopy(document)
    if not place:
        return rng.choice(VALUES)
    parent = changed
    for key in place[:-1]:
        parent = parent[key]
    what = rng.choice(("replace", "remove", "add"))
    if what == "replace":
        parent[place[-1]] = deepcopy(rng.choice(VALUES))
    elif what == "remove":
        del parent[place[-1]]
    elif isinstance(parent, dict):
        parent[rng.choice(("extra", "format", "values"))] = deepcopy(rng.choice(VALUES))
    else:
        parent.append(deepcopy(rng.choice(VALUES)))
    return changed


@pytest.mark.parametrize("kind", KINDS)
def test_verdicts_and_places_are_those_of_jsonschema(kind):
    schema, document = schema_of(kind), read_json(OLD / f"{kind}.json", kind)
    twin = Draft202012Validator(schema)
    assert first_problem(document, schema) is None
    assert twin.is_valid(document)
    rng = random.Random(7)  # noqa: S311
    everywhere = list(places(document))
    verdicts = []
    for place in rng.choices(everywhere, k=250):
        changed = mutated(document, place, rng)
        problem = first_problem(changed, schema)
        errors = [error for top in twin.iter_errors(changed) for error in (top, *(top.context or ()))]
        verdicts.append(bool(errors))
        assert (problem is not None) == bool(errors), (place, problem, errors)
        if problem is not None:
            assert problem.place in {tuple(error.absolute_path) for error in errors}, (place, problem)
    assert 50 < sum(verdicts) < 250, "both verdicts are tried"


@pytest.mark.parametrize("kind", KINDS)
def test_schemas_use_only_what_is_checked(kind):
    """Every keyword of the whole schema, also where no document leads."""
    schema = schema_of(kind)
    Draft202012Validator.check_schema(schema)

    def visit(part):
        first_problem({}, {"$defs": schema["$defs"], **{key: part[key] for key in part if key != "$defs"}})
        for key in ("properties", "$defs"):
            for one in part.get(key, {}).values():
                visit(one)
        for one in (part.get("items"), part.get("additionalProperties"), *part.get("oneOf", ())):
            if isinstance(one, dict):
                visit(one)

    visit(schema)


def test_a_keyword_that_is_not_checked_is_refused():
    with pytest.raises(ValueError, match="cannot use the keyword uniqueItems"):
        first_problem([1, 1], {"type": "array", "uniqueItems": True})


@pytest.mark.parametrize(
    ("value", "schema", "text"),
    [
        (10**400, {"type": "number"}, "the whole file: expected a number, found 1000"),
        (inf, {"type": ["number", "null"]}, "the whole file: expected a number or null, found inf"),
        (-inf, {"type": "integer"}, "the whole file: expected a whole number, found -inf"),
        (1.5, {"type": "integer"}, "expected a whole number, found 1.5"),
        (True, {"type": "number"}, "expected a number, found True"),
        (True, {"const": 1}, "expected 1, found True"),
        (1, {"enum": [True, "a"]}, "expected one of True, 'a', found 1"),
        ("x" * 500, {"type": "null"}, "expected null, found 'xxxxx"),
        ([[[1]]], {"type": "string"}, "expected a text, found a list of 1 items"),
        ({"a": {}}, {"type": "boolean"}, "expected true or false, found an object of 1 fields"),
        ([1], {"minItems": 2}, "expected a list of 2 items or more, found a list of 1 items"),
        ({}, {"minProperties": 1}, "expected an object of 1 fields or more, found an object of 0 fields"),
        (-1, {"minimum": 0}, "expected 0 or more, found -1"),
        (0, {"exclusiveMinimum": 0}, "expected more than 0, found 0"),
        (2e8, {"maximum": 1e8}, "expected 1e+08 or less, found 200000000.0"),
        ("a", {"pattern": "^[0-9]+$"}, "expected a text that matches ^[0-9]+$, found 'a'"),
        ({"a": [{"b": 1}]}, {"properties": {"a": {"items": {"properties": {"b": {"type": "string"}}}}}}, "a/0/b: exp"),
        ({"a": 1}, {"required": ["b"]}, "the whole file: expected the field 'b', which is missing"),
        (3, {"oneOf": [{"type": "null"}, {"type": "string"}]}, "expected a text, found 3"),
        (3, {"oneOf": [{"type": "number"}, {"minimum": 0}]}, "expected what only one of 2 choices allows, found 3"),
    ],
)
def test_problems_say_what_was_expected_and_found(value, schema, text):
    problem = first_problem(value, schema)
    assert text in str(problem)
    assert len(str(problem)) < 150
    assert (
        first_problem({"deep": value}, {"required": ["other"]}).text == "expected the field 'other', which is missing"
    )
