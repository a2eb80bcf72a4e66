"""Conversion and checks of Python arguments, as for the options of the command line."""

from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from math import isfinite
from typing import TypeAlias, TypeVar

import numpy as np

from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import ArgumentError, unknown
from navirl_cli.irl.terms.registry import terms_named
from navirl_cli.irl.terms.term import Term

Point: TypeAlias = tuple[float, float]
Choice = TypeVar("Choice", bound=StrEnum)


def texts(values: str | Collection[str]) -> tuple[str, ...]:
    """One text or several, as a tuple."""
    return (values,) if isinstance(values, str) else tuple(values)


def one_of(names: Sequence[str], value: str, argument: str) -> str:
    """One of the known names.

    Raises:
        ArgumentError: The name is unknown.
    """
    if value not in names:
        raise ArgumentError(unknown(f"`{argument}`", value, names))
    return value


def chosen(kind: type[Choice], value: str, argument: str) -> Choice:
    """A choice by its value."""
    return kind(one_of([one.value for one in kind], value, argument))


def within(argument: str, value: float, low: float, high: float, *, above: bool = False) -> float:
    """A finite number within bounds.

    Raises:
        ArgumentError: It is not finite or not within the bounds.
    """
    if not (isfinite(value) and low <= value <= high and not (above and value == low)):
        least = "above" if above else "from"
        raise ArgumentError(f"`{argument}`: expected a number {least} {low:g} to {high:g}, found {value:g}")
    return value


def points_in(given: Point | Sequence[Point]) -> tuple[Point, ...]:
    """One point or several.

    Raises:
        ArgumentError: A point is not two finite numbers.
    """
    several = np.asarray(given, dtype=float).reshape(-1, 2) if np.size(given) % 2 == 0 else np.full((1, 2), np.nan)
    if not np.isfinite(several).all():
        raise ArgumentError(f"expected points as (x, y) in m, found {given!r}")
    return tuple((float(x), float(y)) for x, y in several)


def topics_in(topic: Mapping[str, str | Sequence[str]] | None) -> dict[str, tuple[str, ...]]:
    """Topics by role."""
    return {role: texts(names) for role, names in (topic or {}).items()}


def pairs_in(pair: tuple[str, str] | Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Pairs of names, of one pair or of several.

    Raises:
        ArgumentError: The argument has another form.
    """
    several = [pair] if len(pair) == 2 and all(isinstance(one, str) for one in pair) else pair
    found = []
    for one in several:
        if isinstance(one, str) or len(one) != 2:
            raise ArgumentError(f"`pair`: expected two names of groups, found {one!r}")
        if one[0] == one[1]:
            raise ArgumentError(f"`pair`: expected two groups, found {one[0]!r} twice")
        found.append((str(one[0]), str(one[1])))
    return found


def terms_in(given: str | Sequence[str | Term]) -> tuple[Term, ...]:
    """Terms of a reward: names in one text, separated by commas, or a list of names and terms; none by default.

    Raises:
        NavirlError: A term is unknown or cannot be loaded.
    """
    words = [word.strip() for word in given.split(",")] if isinstance(given, str) else list(given)
    return terms_named(words) if words else ()


def subset_in(
    condition: str | Collection[str],
    cycle: int | Collection[int],
    set: str | Collection[str],  # noqa: A002 the option's name
    participant: str | Collection[str],
    trial: str | Collection[str],
) -> Subset:
    """The demonstrations that are meant: one name of each field or several; none for all.

    Raises:
        ArgumentError: A condition does not exist.
    """
    conditions = tuple(chosen(Condition, one, "condition").value for one in texts(condition))
    cycles = (cycle,) if isinstance(cycle, int) else tuple(cycle)
    return Subset(conditions, cycles, texts(set), texts(participant), texts(trial))
