"""Sequences of numbers that are kept compressed, message by message: many large ones of which few are needed."""

import zlib
from dataclasses import dataclass, field, replace
from hashlib import blake2b

import numpy as np

from navirl_cli.logs.messages.decode import DecodedBatch

#: Fast, and good enough for maps: runs of few values.
_LEVEL = 1


@dataclass(eq=False)
class Packer:
    """Compresses the sequences of one topic, equal ones once; in any number of threads."""

    #: Compressed sequences by the hash of their bytes.
    known: dict[bytes, bytes] = field(default_factory=dict)

    def packed(self, decoded: DecodedBatch) -> DecodedBatch:
        """A batch whose sequences of int8 are one object of bytes a message, shape (m,)."""
        columns = dict(decoded.columns)
        for path, counts in decoded.counts.items():
            ends = np.cumsum(counts)
            values = np.empty(len(ends), dtype=object)
            cells = columns[path].astype(np.int8, copy=False)
            for row, (start, stop) in enumerate(zip((ends - counts).tolist(), ends.tolist(), strict=True)):
                values[row] = self._compressed(cells[start:stop].tobytes())
            columns[path] = values
        return replace(decoded, columns=columns)

    def _compressed(self, data: bytes) -> bytes:
        digest = blake2b(data, digest_size=16).digest()
        if digest not in self.known:
            self.known[digest] = zlib.compress(data, _LEVEL)
        return self.known[digest]
