"""Types of arrays, and the equality of types that hold them."""

from collections.abc import Mapping
from dataclasses import fields
from math import isnan, nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Numbers of states in what is kept of thousands of scenes, in half of the memory.
IndexArray = NDArray[np.int32]


class ByContent:
    """Base of dataclasses that hold arrays and compare by content.

    Two instances are equal, and have the same hash, where their types and all their fields are equal: arrays by type,
    shape and values. Two NaN are equal, so that a copy equals its original. Such a class is declared with
    ``@dataclass(frozen=True, eq=False)``: the comparison that dataclass itself writes raises on arrays.

    Types that do work rather than hold results (a scene, a policy) compare and hash by identity: ``eq=False`` alone.
    """

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or _fields(self) == _fields(other)

    def __hash__(self) -> int:
        return hash((type(self), _fields(self)))


def _fields(instance: Any) -> tuple[object, ...]:
    """The fields of a dataclass as values that compare and hash."""
    return tuple(_comparable(getattr(instance, field.name)) for field in fields(instance))


def _comparable(value: object) -> object:
    """A value that compares and hashes as the content of the given one."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f":  # equal numbers have equal bytes, except for the two zeros and the many NaN
            value = np.where(np.isnan(value), np.nan, value + 0.0)
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, float) and isnan(value):
        return nan  # one object, which equals itself within a tuple
    if isinstance(value, Mapping):
        return frozenset((key, _comparable(one)) for key, one in value.items())
    if isinstance(value, list | tuple):
        return tuple(_comparable(one) for one in value)
    return value
