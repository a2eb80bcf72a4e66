"""Messages that were compressed one by one: rosbag2's compression_mode "message".

The recorder compresses each payload to a zstd frame and marks that only in the bag's metadata.yaml. A frame begins with
four bytes with which no CDR message and no JSON text begins, so that the file alone suffices.

Source: RFC 8878, chapter 3.1.1 (the magic number, and the size in a frame's header).
"""

from dataclasses import replace
from typing import Final

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.limits import RATIO, Allowance
from navirl_cli.logs.container.batches import Batch, gathered

_MAGIC: Final = 0xFD2FB528
#: Most bytes that the messages of a batch may take, and that a single one may take.
_MOST_BYTES: Final = 1 << 28
_UNSTATED_BYTES: Final = 1 << 20


def without_compression(batch: Batch) -> Batch:
    """A batch with its compressed payloads decompressed; what is no valid frame stays, and then does not decode."""
    long = np.flatnonzero(batch.sizes >= 4)
    heads = gathered(batch.raw, batch.starts[long], np.dtype([("magic", "<u4")]))["magic"]
    rows = long[heads == _MAGIC]
    return _decompressed(batch, rows) if rows.size else batch


def _decompressed(batch: Batch, rows: IntArray) -> Batch:
    """The batch with the payloads of some rows decompressed."""
    from zstandard import ZstdDecompressor, ZstdError, frame_content_size

    decompressor, left = ZstdDecompressor(), _MOST_BYTES
    allowance = Allowance()
    parts = [batch.payload(row) for row in range(len(batch.starts))]
    for row in rows.tolist():
        try:
            size = frame_content_size(parts[row])
            packed = len(parts[row])
            # a frame need not state its size
            most = size if size >= 0 else min(left, max(_UNSTATED_BYTES, RATIO * packed))
            if most > left or (size > 0 and not allowance.take(packed, size)):
                continue
            unpacked = decompressor.decompress(parts[row], max_output_size=most)
            if size >= 0 or allowance.take(packed, len(unpacked)):
                parts[row] = unpacked
                left -= len(parts[row])
        except (ZstdError, MemoryError):
            continue
    sizes = np.array([len(part) for part in parts], dtype=np.int64)
    return replace(batch, raw=b"".join(parts), starts=np.cumsum(sizes) - sizes, sizes=sizes)
