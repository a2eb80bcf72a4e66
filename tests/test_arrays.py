"""Types that hold arrays compare and hash without raising: values by content, machinery by identity."""

import importlib
import pickle
import pkgutil
import typing
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType

import factories as make
import numpy as np
import pytest

import navirl_cli
from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.demos.demonstration import Contact
from navirl_cli.irl.reward import PAPER_TERMS, Reward

MODULES = [
    importlib.import_module(found.name)
    for found in pkgutil.walk_packages(navirl_cli.__path__, "navirl_cli.")
    if not found.name.endswith("__main__")
]
CLASSES = {
    value: module
    for module in MODULES
    for value in vars(module).values()
    if isinstance(value, type) and is_dataclass(value) and value.__module__ == module.__name__
}
#: Types may be imported for checking alone, and then be missing from the module that names them.
NAMES = {name: value for module in MODULES for name, value in vars(module).items() if not name.startswith("__")}


def hints_of(cls: type) -> dict[str, object]:
    hints = typing.get_type_hints(cls, globalns={**NAMES, **vars(CLASSES[cls])})
    return {field.name: hints[field.name] for field in fields(cls)}


def parts_of(hint: object) -> list[object]:
    """A hint and all that stands in its brackets."""
    arguments = [] if typing.get_origin(hint) is Callable else typing.get_args(hint)
    return [typing.get_origin(hint) or hint, *(part for argument in arguments for part in parts_of(argument))]


def holders_of_arrays() -> list[type]:
    """Dataclasses with an array in a field, or in a field's own fields."""
    found: set[object] = {np.ndarray}
    while True:
        more = {
            cls for cls in CLASSES if any(part in found for hint in hints_of(cls).values() for part in parts_of(hint))
        }
        if more <= found:
            return sorted(more, key=lambda cls: f"{cls.__module__}.{cls.__qualname__}")
        found |= more


PLAIN = {float: 0.5, int: 3, str: "word", bool: True, bytes: b"word", Path: Path("word")}


def sample(hint: object) -> object:
    """Anything of a type; no array is shared between two calls."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is np.ndarray:
        number = typing.get_args(arguments[1])[0]
        return np.array([[0.0, np.nan]]) if number is np.float64 else np.zeros((1, 2), dtype=number)
    if origin in {typing.Union, UnionType}:
        return sample(next(argument for argument in arguments if argument is not NoneType))
    if origin in {tuple, list, dict, Sequence, Collection, Mapping}:
        inside = [sample(argument) for argument in arguments if argument is not Ellipsis]
        return dict([inside]) if origin in {dict, Mapping} else tuple(inside) if origin is tuple else inside
    if isinstance(hint, type) and issubclass(hint, Enum):
        return next(iter(hint))
    return hollow(hint) if hint in CLASSES else PLAIN.get(hint, len)


def hollow(cls: type) -> object:
    """An instance with a sample in every field, without the checks of its constructor."""
    instance = cls.__new__(cls)
    for name, hint in hints_of(cls).items():
        object.__setattr__(instance, name, sample(hint))
    return instance


HOLDERS = holders_of_arrays()


def name_of(cls: type) -> str:
    return f"{cls.__module__.removeprefix('navirl_cli.')}.{cls.__qualname__}"


@pytest.mark.parametrize("cls", HOLDERS, ids=name_of)
def test_types_that_hold_arrays_compare_by_content_or_by_identity(cls):
    one, other = hollow(cls), hollow(cls)
    assert one == one  # noqa: PLR0124
    assert isinstance(hash(one), int)
    if cls.__eq__ is object.__eq__:
        assert one != other
        return
    assert (one == other, hash(one) == hash(other)) == (True, True), "its fields compare by identity: add eq=False"
    copy = pickle.loads(pickle.dumps(one))
    assert (copy == one, hash(copy) == hash(one)) == (True, True)


def test_the_search_for_types_finds_them():
    names = {name_of(cls) for cls in HOLDERS}
    assert {"demos.demonstration.Demonstration", "irl.values.Policy", "irl.analyses.Analyses"} <= names
    assert "demos.demonstration.Contact" not in names
    assert sample(FloatArray).dtype == np.float64


def test_values_that_users_hold_compare_by_content():
    values = {cls.__name__ for cls in CLASSES if issubclass(cls, ByContent)}
    assert values >= {
        *("Bootstrap", "Demonstration", "Fit", "Grid", "GroupMetrics", "LearntReward", "PersonTrack", "Profile"),
        *("Prior", "Validation"),
    }
    grid = make.open_grid(6, 3)
    one = make.demonstration(grid, [[0, 0], [1, 1], [2, 1]], [[0.2, 0.1]])
    copy = pickle.loads(pickle.dumps(one))
    assert copy == one
    assert len({one, copy, replace(one, cells=one.cells[:2]), replace(one, t_s=one.t_s + 1e-12)}) == 3
    assert {grid: "map"}[make.open_grid(6, 3)] == "map"
    assert grid != make.open_grid(3, 6)


@pytest.mark.parametrize(
    "value",
    [
        Contact(0.0, 1.0, 20.0, (1.0, 2.0)),
        Reward.named({"a_p": -3.0}),
        *PAPER_TERMS,
        *(parameter for term in PAPER_TERMS for parameter in term.parameters),
    ],
    ids=lambda value: type(value).__name__,
)
def test_values_without_arrays_equal_their_copies(value):
    copy = pickle.loads(pickle.dumps(value))
    assert copy == value
    assert hash(copy) == hash(value)


def test_rewards_differ_by_parameters_and_by_terms():
    reward = Reward.named({})
    assert reward != Reward.named({"a_p": -3.0})
    assert PAPER_TERMS[0] != PAPER_TERMS[1]
    assert Reward((-50.0,), PAPER_TERMS[:1]) != Reward((-0.5,), PAPER_TERMS[1:2])


@dataclass(frozen=True, eq=False)
class Several(ByContent):
    array: FloatArray
    by_name: dict[str, float]
    nested: tuple[FloatArray, ...] = ()


def test_content_is_compared_value_by_value():
    one = Several(np.array([0.0, np.nan]), {"a": 1.0, "b": np.nan}, (np.zeros(2),))
    same = Several(np.array([-0.0, -np.nan]), {"b": float("nan"), "a": 1.0}, (np.zeros(2),))
    assert one == same
    assert hash(one) == hash(same)
    others = [
        replace(one, array=np.array([[0.0, np.nan]])),
        replace(one, array=np.array([0.0, 1.0])),
        replace(one, by_name={"a": 1.0}),
        replace(one, nested=(np.zeros(3),)),
        "something else",
    ]
    assert all(one != other for other in others)
    assert len({one, *others}) == 6
