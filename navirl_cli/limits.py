"""How much a file may unpack to: in proportion to its own size, so that a small file cannot fill memory or disk."""

import os
from typing import Final

#: Bytes that each byte of a file may become: what lz4 can reach at most, and more than logs and maps reach.
RATIO: Final = 256
#: Bytes that a file may become beyond that proportion, all its parts together: a large map of one colour.
FREE_BYTES: Final = 64 << 20
#: The environment variable that lifts the limits if it is not empty; worker processes inherit it.
VARIABLE: Final = "NAVIRL_NO_LIMITS"
#: What a message says to do about a file that is beyond them.
REMEDY: Final = "if the file can be trusted, lift the limit with `no_limits`"


def lifted() -> bool:
    """Whether the user has lifted the limits."""
    return bool(os.environ.get(VARIABLE))


class Allowance:
    """What one file may still unpack to."""

    def __init__(self) -> None:
        self._left = FREE_BYTES

    def most(self, packed: int) -> int:
        """Most bytes that a part of some bytes may become now."""
        return (1 << 62) if lifted() else self._left + RATIO * packed

    def take(self, packed: int, unpacked: int) -> bool:
        """Count a part; False, and nothing is counted, if it is beyond what is left."""
        beyond = max(0, unpacked - RATIO * packed)
        if lifted():
            return True
        if beyond > self._left:
            return False
        self._left -= beyond
        return True


def in_mb(size: int) -> str:
    """A number of bytes as a message shows it."""
    return f"{size / 1e6:.3g} MB"
