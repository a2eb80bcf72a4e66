"""Numpy's numbers and arrays, as a pickle keeps them."""

from math import prod
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from navirl_cli.published.pickled import Kept

#: The plain numbers; anything else may hold objects.
NUMBERS: Final = frozenset({"f4", "f8", "i1", "i4", "i8", "u1"})

_SCALAR: Final = "numpy.core.multiarray.scalar"
_ARRAY: Final = "numpy.core.multiarray._reconstruct"


def unpacked(value: Any) -> Any:
    """A number or an array of numpy's as Python's number or a numpy array; anything else as it is.

    Args:
        value: What `read_pickle` gave.

    Raises:
        ValueError: It claims to be plain numbers and is not; in the words of a message.
    """
    if type(value) is not Kept or value.name not in {_SCALAR, _ARRAY}:
        return value
    if value.name == _SCALAR and len(value.args) == 2:
        dtype, data = value.args
        return _array((), dtype, data).item()
    if value.name == _ARRAY and type(value.state) is tuple and len(value.state) == 5:
        _, shape, dtype, fortran, data = value.state
        return _array(shape, dtype, data, order="F" if fortran is True or fortran == 1 else "C")
    raise ValueError("expected plain numbers of numpy's, found them incomplete")


def _array(shape: Any, dtype: Any, data: Any, order: Literal["C", "F"] = "C") -> NDArray[Any]:
    """An array over bytes that are there already, whatever the shape claims."""
    kind = dtype.args[0] if type(dtype) is Kept and dtype.args else None
    if not isinstance(kind, str) or kind not in NUMBERS:
        raise ValueError(f"expected plain numbers ({', '.join(sorted(NUMBERS))}), found {_brief(kind)}")
    byte_order = ">" if type(dtype.state) is tuple and ">" in dtype.state[1:2] else "<"
    if type(shape) is not tuple or len(shape) > 2 or type(data) is not str:
        raise ValueError("expected an array's shape, of at most two sides, and its bytes, found something else")
    sides_fit = all(type(side) is int and 0 <= side <= len(data) for side in shape)
    if not sides_fit or prod(shape) * int(kind[1:]) != len(data):
        raise ValueError(f"expected {len(data)} bytes to be an array of {kind}, found its shape to be {_brief(shape)}")
    return np.frombuffer(data.encode("latin-1"), byte_order + kind).reshape(shape, order=order)


def _brief(value: Any) -> str:
    """A value for a message; what holds others may be too long to write out."""
    if isinstance(value, tuple) and all(type(item) is int for item in value):
        return str(value)
    return repr(value)[:40] if isinstance(value, str | int | float | None) else f"a {type(value).__name__}"
