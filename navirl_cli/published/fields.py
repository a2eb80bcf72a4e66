"""The fields of the study's classes and arrays, from pickles read as data, checked one by one."""

from collections.abc import Mapping
from itertools import chain
from math import prod
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from navirl_cli.demos.grid import MAX_RESOLUTION_M, MIN_RESOLUTION_M
from navirl_cli.logs.recording import Occupancy
from navirl_cli.published.pickled import Kept

#: Limits of what can be driven in a hallway: pairs in one list, cells of one map, cells from its origin.
MOST_ROWS: Final = 100_000
MOST_CELLS: Final = 1_000_000
FARTHEST_CELL: Final = 100_000

#: The plain numbers; anything else may hold objects.
NUMBERS: Final = frozenset({"f4", "f8", "i1", "i4", "i8", "u1"})

_SCALAR: Final = "numpy.core.multiarray.scalar"
_ARRAY: Final = "numpy.core.multiarray._reconstruct"


def state_of(value: Any, name: str) -> Mapping[Any, Any]:
    """The attributes of an object of one of the study's classes.

    Args:
        value: A result of `read_pickle`.
        name: The class's name without its module.

    Raises:
        ValueError: It is something else; the text is part of a message.
    """
    if type(value) is not Kept or value.name.rpartition(".")[2] != name or type(value.state) is not dict:
        raise ValueError(f"expected {name} with its attributes, found {_called(value)}")
    return value.state


def pairs_in(state: Mapping[Any, Any], name: str, number: type[Any], expected: str, *, least: int = 0) -> NDArray[Any]:
    """(n, 2) float64 or int64: a list of pairs of numbers.

    Args:
        state: Attributes of an object.
        name: Of the attribute.
        number: `float`, which takes integers too, or `int`.
        expected: The expected value, for messages.
        least: Fewest pairs.

    Raises:
        ValueError: It is something else; the text is part of a message.
    """
    if name not in state:
        raise ValueError(f"{name}: expected {expected}, found none")
    try:
        pairs = _pairs(state[name], {int, number}, expected)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    if len(pairs) < least:
        raise ValueError(f"{name}: expected {expected}, found {len(pairs)}")
    if number is int and any(abs(one) > FARTHEST_CELL for one in chain.from_iterable(pairs)):
        raise ValueError(f"{name}: expected {expected}, found a number beyond {FARTHEST_CELL}")
    return np.array(pairs, dtype=number).reshape(-1, 2)


def _pairs(value: Any, types: set[type[Any]], expected: str) -> list[list[Any]]:
    """A list of pairs of numbers of some types."""
    rows = _items(value)
    if rows is None or len(rows) > MOST_ROWS:
        raise ValueError(f"expected {expected}, found {_called(value) if rows is None else f'{len(rows)} of them'}")
    pairs = []
    for place, row in enumerate(rows):
        pair = [unpacked(number) for number in _items(row) or ()]
        if len(pair) != 2 or not {type(number) for number in pair} <= types:
            raise ValueError(f"expected {expected}, found something else at place {place}")
        pairs.append(pair)
    return pairs


def occupancy_in(nav_map: Any) -> Occupancy:
    """The map that the study's class keeps, a nav_msgs/OccupancyGrid.

    Raises:
        ValueError: It is something else; the text is part of a message.
    """
    message = state_of(nav_map, "NavMap").get("ros_occupancy_map")
    try:
        _, info, data = _slots(message, "OccupancyGrid", 3)
        _, side, width, height, origin = _slots(info, "MapMetaData", 5)
        position, rotation = _slots(origin, "Pose", 2)
        resolution, *place = (_number(value) for value in (side, *_slots(position, "Point", 3)))
        quaternion = [_number(value) for value in _slots(rotation, "Quaternion", 4)]
        cells = _cells(data, width, height)
    except ValueError as error:
        raise ValueError(f"ros_occupancy_map: {error}") from error
    if not MIN_RESOLUTION_M <= resolution <= MAX_RESOLUTION_M or not np.isfinite(place).all():
        raise ValueError(
            f"ros_occupancy_map: expected cells of {MIN_RESOLUTION_M} to {MAX_RESOLUTION_M} m and a finite origin, "
            f"found {resolution:g} m and {place}"
        )
    if any(quaternion[:3]):
        raise ValueError("ros_occupancy_map: expected cells along the axes of the map's frame, found them rotated")
    # a float32 of 0.1 is 0.10000000149 as a double: the shortest decimal was meant
    return Occupancy(cells, float(str(np.float32(resolution))), (place[0], place[1]))


def _cells(data: Any, width: Any, height: Any) -> NDArray[np.int8]:
    """(height, width) occupancy."""
    values, sides = _items(data), (width, height)
    if values is None or not all(type(side) is int and side > 0 for side in sides) or width * height != len(values):
        found = _called(data) if values is None else f"{len(values)} cells"
        raise ValueError(f"expected a map of {_called(width)} x {_called(height)} cells, found {found}")
    if not {type(value) for value in values} <= {int} or not all(-1 <= value <= 100 for value in values):
        raise ValueError("expected occupancy from -1 to 100, found something else")
    return np.array(values, dtype=np.int8).reshape(height, width)


def _slots(value: Any, name: str, count: int) -> list[Any] | tuple[Any, ...]:
    """The fields of a message, which genpy stores as a list in the order of the definition."""
    state = value.state if type(value) is Kept and value.name.rpartition(".")[2] == name else None
    if not isinstance(state, list | tuple) or len(state) != count:
        raise ValueError(f"expected {name} of {count} fields, found {_called(value)}")
    return state


def _items(value: Any) -> list[Any] | tuple[Any, ...] | None:
    """The items of a list, a tuple or an array; None for anything else."""
    found = unpacked(value)
    if isinstance(found, np.ndarray):
        return list(found.tolist()) if found.ndim and found.size <= MOST_CELLS else None
    return found if isinstance(found, list | tuple) else None


def _number(value: Any) -> float:
    """A number, as a float."""
    number = unpacked(value)
    if type(number) not in {int, float}:
        raise ValueError(f"expected a number, found {_called(number)}")
    return float(number)


def unpacked(value: Any) -> Any:
    """A pickled number or array of numpy as a number or an array; anything else unchanged.

    Args:
        value: A result of `read_pickle`.

    Raises:
        ValueError: It claims to be plain numbers and is not; the text is part of a message.
    """
    if type(value) is not Kept or value.name not in {_SCALAR, _ARRAY}:
        return value
    if value.name == _SCALAR and len(value.args) == 2:
        dtype, data = value.args
        return _array((), dtype, data).item()
    if value.name == _ARRAY and type(value.state) is tuple and len(value.state) == 5:
        _, shape, dtype, fortran, data = value.state
        return _array(shape, dtype, data, order="F" if fortran is True or fortran == 1 else "C")
    raise ValueError("expected plain numbers of numpy, found them incomplete")


def _array(shape: Any, dtype: Any, data: Any, order: Literal["C", "F"] = "C") -> NDArray[Any]:
    """An array over existing bytes: memory is never allocated by the size that a shape claims."""
    code = dtype.args[0] if type(dtype) is Kept and dtype.args else None
    if not isinstance(code, str) or code not in NUMBERS:
        raise ValueError(f"expected plain numbers ({', '.join(sorted(NUMBERS))}), found {_called(code)}")
    byte_order = ">" if type(dtype.state) is tuple and ">" in dtype.state[1:2] else "<"
    if type(shape) is not tuple or len(shape) > 2 or type(data) is not str:
        raise ValueError("expected an array's shape, of at most two sides, and its bytes, found something else")
    sides_fit = all(type(side) is int and 0 <= side <= len(data) for side in shape)
    if not sides_fit or prod(shape) * int(code[1:]) != len(data):
        raise ValueError(f"expected {len(data)} bytes to be an array of {code}, found its shape to be {_called(shape)}")
    return np.frombuffer(data.encode("latin-1"), byte_order + code).reshape(shape, order=order)


def _called(value: Any) -> str:
    """A value as a message shows it; containers by their type only, because they may be long."""
    if type(value) is Kept:
        return value.name
    if type(value) is tuple and all(type(item) is int for item in value):
        return str(value)[:40]
    return repr(value)[:40] if isinstance(value, str | int | float | None) else f"a {type(value).__name__}"
