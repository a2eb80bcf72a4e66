"""Numbers that stand together, with the same digits."""

from collections.abc import Sequence
from math import floor, isfinite, log10

#: More decimals, or more digits before the point, are written as powers of ten.
_MOST_DECIMALS, _MOST_DIGITS = 6, 6


def evenly(values: Sequence[float], significant: int = 3) -> list[str]:
    """Write numbers of one quantity with the same number of decimals, such as a value and its interval.

    Args:
        values: The numbers; those that are not finite stay as they are.
        significant: Digits of the first that is not 0.

    Returns:
        Their texts; those rounded to zero have no sign.
    """
    sizes = [abs(value) for value in values if isfinite(value) and value]
    if not sizes:
        return [f"{value:zg}" for value in values]
    first = floor(log10(float(f"{sizes[0]:.{significant - 1}e}")))
    decimals = max(0, significant - 1 - first)
    if decimals > _MOST_DECIMALS or max(sizes) >= 10.0**_MOST_DIGITS:
        return [f"{value:.{significant}g}" for value in values]
    return [f"{value:z.{decimals}f}" for value in values]
