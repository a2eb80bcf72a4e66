"""Masks for Nav2's costmap filters, as map_server reads them: a YAML file with ``mode: raw`` beside an 8-bit picture.

Values are occupancies: 0 to 100, above that unknown (nav2_map_server/src/map_io.cpp). The default mode, trinary, would
make three values of all. KeepoutFilter turns an occupancy into a cost of 2.54 times as much, and 100 into an obstacle.
SpeedFilter of type 1 reads a percentage of the speed limit; 0 is no limit.
"""

from pathlib import Path
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.files import replacing
from navirl_cli.irl.scene import Scene

#: A pixel above 100 is unknown.
UNKNOWN: Final = 255
#: Cost of an occupancy of one per cent, and the most that is no obstacle.
COST_PER_PERCENT, MOST_PERCENT = 2.54, 99


def occupancy_of(costs: FloatArray) -> np.ndarray:
    """The mask's occupancy whose cost is nearest to each cost, capped below an obstacle.

    Args:
        costs: (...) 0 and more.

    Returns:
        (...) whole numbers 0 to 99, uint8.
    """
    return np.clip(np.round(costs / COST_PER_PERCENT), 0, MOST_PERCENT).astype(np.uint8)


def over_map(scene: Scene, by_state: np.ndarray, elsewhere: int = 0) -> np.ndarray:
    """Values by state over the map, (rows, columns) uint8; row 0 has the lowest y."""
    over = np.full(scene.lattice.grid.shape, elsewhere, dtype=np.uint8)
    columns, rows = scene.lattice.cells.T
    over[rows, columns] = by_state
    return over


def speed_percent(away_m: FloatArray, near_m: float, far_m: float, least_percent: float) -> np.ndarray:
    """A speed limit that falls towards people.

    Args:
        away_m: (...) distance between the robot's shell and the nearest person's centre, m.
        near_m: From here on inward the limit is the least.
        far_m: From here on outward there is no limit (0).
        least_percent: Per cent of the full speed.

    Returns:
        (...) per cent, uint8.
    """
    share = np.clip((away_m - near_m) / max(far_m - near_m, 1e-9), 0.0, 1.0)
    percent = np.round(least_percent + (100 - least_percent) * share)
    return np.where(share >= 1.0, 0, percent).astype(np.uint8)


def write_mask(yaml: Path, occupancy: np.ndarray, grid: Grid, *, force: bool) -> None:
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
