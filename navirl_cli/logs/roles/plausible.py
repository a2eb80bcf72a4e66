"""Which measurements are plausible: finite, possible for the quantity, and not changed by a flipped bit."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.tf.rotations import are_rotations, faults, rescaled

#: Measurements judged at once: memory never holds a copy of all of them.
_BLOCK: Final = 1 << 15
#: A number this small between two that are not comes from a flipped exponent.
_TINY, _ORDINARY = 1e-30, 1e-12


@dataclass(frozen=True)
class Limits:
    """The values that a quantity can have."""

    #: Larger ones are impossible.
    largest: float
    #: A single value this far from both its neighbours, which agree to a tenth of it, is impossible.
    spike: float
    unit: str


#: No robot carries larger forces, and no hand changes them by more within one sample.
FORCES: Final = Limits(1e5, 500.0, "N")
#: Maps are smaller; no robot is elsewhere for one message and back.
PLACES: Final = Limits(1e6, 1.0, "m")


def plausible_messages(
    topic: str, values: FloatArray, limits: Limits, quaternions: FloatArray | None = None
) -> tuple[BoolArray, Findings]:
    """Which messages of a topic are plausible, and what is wrong with the others.

    Args:
        topic: Its name.
        values: (n, k) in order of time.
        limits: Of the quantity.
        quaternions: (n, 4) x, y, z, w; None for messages without rotations.

    Returns:
        (n,) False where one of the k is not finite, larger than possible, a single spike, or the result of a flipped
        exponent (nearly 0 between neighbours that are not), or where the rotation is none; and a finding about those
        messages, if there are any.
    """
    impossible = _impossible(values, limits)
    good: BoolArray = np.array(~impossible.any(axis=1))
    left = finite = np.isfinite(values).all(axis=1)
    found = {"not finite": ~finite}
    if quaternions is not None:
        turned = are_rotations(quaternions)
        found |= {reason: left & rows for reason, rows in faults(quaternions).items()}
        left, good = left & turned, good & turned
    absurd = left & impossible.any(axis=1)
    if absurd.any():
        numbers = values[absurd][impossible[absurd]]
        example = numbers[np.abs(np.log10(np.maximum(np.abs(numbers), 1e-300))).argmax()]
        found[f"impossible, such as {example:.3g} {limits.unit}"] = absurd
    counts = [f"{int(rows.sum())} {what}" for what, rows in found.items() if rows.any()]
    scaled = "" if quaternions is None else rescaled(quaternions[good])
    findings = (Finding(Kind.RESCALED, topic, detail=scaled),) if scaled else ()
    if good.all():
        return good, findings
    return good, (
        *findings,
        Finding(Kind.IMPLAUSIBLE, topic, int((~good).sum()), detail=", ".join(counts)),
    )


def _impossible(values: FloatArray, limits: Limits) -> BoolArray:
    """(n, k) which numbers are not plausible, block by block with a neighbour at both ends."""
    impossible: BoolArray = np.zeros(values.shape, dtype=np.bool_)
    for start in range(0, len(values), _BLOCK):
        first, stop = max(start - 1, 0), min(start + _BLOCK, len(values))
        impossible[start:stop] = _impossible_in(values[first : stop + 1], limits)[start - first : stop - first]
    return impossible


def _impossible_in(values: FloatArray, limits: Limits) -> BoolArray:
    """(n, k) which numbers are not plausible."""
    impossible: BoolArray = np.array(~(np.abs(values) <= limits.largest))
    kept = np.flatnonzero(~impossible.any(axis=1))
    if kept.size >= 3:
        before, here, after = values[kept[:-2]], values[kept[1:-1]], values[kept[2:]]
        apart = np.minimum(np.abs(here - before), np.abs(here - after))
        spike = (apart > limits.spike) & (np.abs(after - before) < limits.spike / 10)
        size = np.abs(here)
        tiny = (size > 0) & (size < _TINY) & (np.minimum(np.abs(before), np.abs(after)) > _ORDINARY)
        impossible[kept[1:-1]] = spike | tiny
    return impossible
