"""Masks for Nav2's costmap filters, as map_server reads them: a YAML file with ``mode: raw`` beside an 8-bit picture.

Values are occupancies: 0 to 100, above that unknown (nav2_map_server/src/map_io.cpp). The default mode, trinary, would
make three values of all. KeepoutFilter turns an occupancy into a cost of 2.54 times as much, and 100 into an obstacle.
SpeedFilter of type 1 limits the speed to base + multiplier x value per cent; Nav2's own parameters are 100 and -1, and
0 is no limit. It refuses unknown cells.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.export.costs import percent_of
from navirl_cli.files import replacing

#: A pixel above 100 is unknown.
UNKNOWN: Final = 255


def occupancy_of(costs: FloatArray) -> NDArray[np.uint8]:
    """The mask's occupancy whose cost is nearest to each cost, capped below an obstacle.

    Args:
        costs: (...) 0 and more.

    Returns:
        (...) whole numbers 1 to 99, and UNKNOWN where there is no cost: there KeepoutFilter leaves the costmap alone,
        while a 0 would make unknown cells free.
    """
    occupancy = percent_of(costs).astype(np.uint8)
    return np.where(occupancy == 0, np.uint8(UNKNOWN), occupancy)


def slowing(away_m: FloatArray, near_m: float, far_m: float, least_percent: float) -> NDArray[np.uint8]:
    """By how much the robot slows down towards people.

    Args:
        away_m: (...) distance between the robot's centre and the nearest person's, m.
        near_m: From here on inward the speed is the least.
        far_m: From here on outward there is no limit.
        least_percent: Of the full speed, 1 to 100.

    Returns:
        (...) 100 - the limit in per cent, 0 to 99; 0 is no limit.
    """
    share = np.clip((far_m - away_m) / max(far_m - near_m, 1e-9), 0.0, 1.0)
    return np.round((100 - max(least_percent, 1.0)) * share).astype(np.uint8)


def write_mask(yaml: Path, occupancy: NDArray[np.uint8], grid: Grid, *, force: bool) -> None:
    """Write a mask as YAML and, beside it, a pgm of the same name.

    Args:
        yaml: The YAML file.
        occupancy: (rows, columns) uint8; row 0 has the lowest y.
        grid: Whose geometry it has.
        force: Whether to replace existing files.

    Raises:
        ArtefactError: A file cannot be written.
    """
    picture = yaml.with_suffix(".pgm")
    rows, columns = occupancy.shape
    x, y = grid.origin_m
    with replacing(picture, force=force) as temporary:
        # the picture's first row is the one with the highest y
        temporary.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + occupancy[::-1].tobytes())
    text = (
        f"image: {picture.name}\nmode: raw\nresolution: {grid.resolution_m:.6g}\norigin: [{x:.6f}, {y:.6f}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    with replacing(yaml, force=force) as temporary:
        temporary.write_text(text, encoding="utf-8")
