"""Numbers that no sensor gave: not finite, or bent by a flipped bit."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray

#: Measurements judged at once, so that the memory holds no copies of a whole log.
_BLOCK: Final = 1 << 15
#: A number this small between two that are not comes from a flipped exponent.
_TINY, _ORDINARY = 1e-30, 1e-12
#: A rotation's quaternion is as long as 1, but for rounding.
_QUATERNION: Final = (0.9, 1.1)


@dataclass(frozen=True)
class Limits:
    """What values a quantity can have."""

    #: Larger ones are absurd.
    largest: float
    #: A single value this far from both its neighbours, which agree to a tenth of it, is absurd.
    spike: float
    unit: str


#: No robot carries such forces, nor does a hand jerk like that within one sample.
FORCES: Final = Limits(1e5, 500.0, "N")
#: Maps are smaller; no robot is elsewhere for one message and back.
PLACES: Final = Limits(1e6, 1.0, "m")


def sound(values: FloatArray, limits: Limits) -> BoolArray:
    """Say which measurements can be true.

    Args:
        values: (n, k) in order of time.
        limits: Of the quantity.

    Returns:
        (n,) False where one of the k is not finite, larger than possible, a lone spike, or the remains of a flipped
        exponent: nearly 0 between neighbours that are not.
    """
    good: BoolArray = np.array(~_wrong(values, limits).any(axis=1))
    return good


def _wrong(values: FloatArray, limits: Limits) -> BoolArray:
    """(n, k) which numbers cannot be true, block by block with a neighbour at both ends."""
    wrong: BoolArray = np.zeros(values.shape, dtype=np.bool_)
    for start in range(0, len(values), _BLOCK):
        first, stop = max(start - 1, 0), min(start + _BLOCK, len(values))
        wrong[start:stop] = _wrong_in(values[first : stop + 1], limits)[start - first : stop - first]
    return wrong


def _wrong_in(values: FloatArray, limits: Limits) -> BoolArray:
    """(n, k) which numbers cannot be true."""
    wrong: BoolArray = np.array(~(np.abs(values) <= limits.largest))
    kept = np.flatnonzero(~wrong.any(axis=1))
    if kept.size >= 3:
        before, here, after = values[kept[:-2]], values[kept[1:-1]], values[kept[2:]]
        apart = np.minimum(np.abs(here - before), np.abs(here - after))
        spike = (apart > limits.spike) & (np.abs(after - before) < limits.spike / 10)
        size = np.abs(here)
        tiny = (size > 0) & (size < _TINY) & (np.minimum(np.abs(before), np.abs(after)) > _ORDINARY)
        wrong[kept[1:-1]] = spike | tiny
    return wrong


def sound_rotations(quaternions: FloatArray) -> BoolArray:
    """(n,) whether quaternions (n, 4) are rotations."""
    # clipped, since the square of a damaged number may be too large for a float
    squares = np.square(np.clip(quaternions, -2.0, 2.0)).sum(axis=1)
    low, high = _QUATERNION
    good: BoolArray = (squares > low**2) & (squares < high**2)
    return good


def describe(topic: str, values: FloatArray, limits: Limits, turned: BoolArray | None = None) -> tuple[BoolArray, str]:
    """Say which messages of a topic can be true, and what is wrong with the others.

    Args:
        topic: Its name.
        values: (n, k) in order of time.
        limits: Of the quantity.
        turned: (n,) whether a message's rotation is one; None for messages without.

    Returns:
        (n,) good messages, and a sentence, empty where all are good.
    """
    wrong = _wrong(values, limits)
    good: BoolArray = np.array(~wrong.any(axis=1))
    finite = np.isfinite(values).all(axis=1)
    kinds = {"not finite": ~finite}
    if turned is not None:
        kinds["without a rotation"] = finite & ~turned
        good = good & turned
    absurd = finite & wrong.any(axis=1) & (turned if turned is not None else True)
    if absurd.any():
        numbers = values[absurd][wrong[absurd]]
        strangest = numbers[np.abs(np.log10(np.maximum(np.abs(numbers), 1e-300))).argmax()]
        kinds[f"absurd, such as {strangest:.3g} {limits.unit}"] = absurd
    counts = [f"{int(rows.sum())} {kind}" for kind, rows in kinds.items() if rows.any()]
    if good.all():
        return good, ""
    return (
        good,
        f"{int((~good).sum())} messages on {topic} hold numbers that cannot be true ({', '.join(counts)}); left out",
    )
