"""Reads the published study where it is at hand, and runs nothing of what its pickles name.

Unpickling runs code by design. Here every name that these files are known to use resolves to an inert stand-in that
only keeps what it is given, and any other name is refused.
"""

import json
import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from navirl_cli.demos.grid import INSCRIBED, Grid

ROOT = Path(os.environ.get("NAVIRL_STUDY_DIR") or Path(__file__).parents[2] / "shared" / "study")
REASON = f"the published study's data are not at hand in {ROOT} (see NAVIRL_STUDY_DIR)"
ORIGIN_M, RESOLUTION_M = (-6.65, -2.6), 0.1


class Kept:
    """Keeps arguments and state."""

    def __new__(cls, *args: Any) -> Self:
        kept = super().__new__(cls)
        kept.args = args
        return kept

    def __setstate__(self, state: Any) -> None:
        self.state = state


class KeptArray(Kept):
    """A numpy array's bytes, read as plain numbers."""

    def __setstate__(self, state: Any) -> None:
        _, shape, dtype, _, data = state
        self.array = np.frombuffer(data.encode("latin-1"), plain(dtype)).reshape(shape)


def plain(dtype: Kept) -> np.dtype[Any]:
    kind = dtype.args[0]
    if kind not in {"f4", "f8", "i1", "i4", "i8", "u1"}:
        raise pickle.UnpicklingError(f"no numbers: {kind}")
    return np.dtype("<" + kind)


def scalar(dtype: Kept, data: str) -> float:
    return np.frombuffer(data.encode("latin-1"), plain(dtype))[0]


STAND_INS: dict[tuple[str, str], Any] = {
    ("copy_reg", "_reconstructor"): lambda kind, *_: kind(),
    ("numpy.core.multiarray", "_reconstruct"): lambda *_: KeptArray(),
    ("numpy.core.multiarray", "scalar"): scalar,
    **dict.fromkeys(
        (
            ("__builtin__", "object"),
            ("demonstration", "Demonstration"),
            ("genpy.rostime", "Time"),
            ("geometry_msgs.msg._Point", "Point"),
            ("geometry_msgs.msg._Pose", "Pose"),
            ("geometry_msgs.msg._Quaternion", "Quaternion"),
            ("nav_map", "NavMap"),
            ("nav_msgs.msg._MapMetaData", "MapMetaData"),
            ("nav_msgs.msg._OccupancyGrid", "OccupancyGrid"),
            ("numpy", "dtype"),
            ("numpy", "ndarray"),
            ("std_msgs.msg._Header", "Header"),
        ),
        Kept,
    ),
}


class Reader(pickle.Unpickler):
    """Resolves the stand-ins and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        try:
            return STAND_INS[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"refused to resolve {module}.{name}") from None


def load(path: Path) -> Any:
    with path.open("rb") as file:
        return Reader(file, encoding="latin-1").load()


@dataclass(frozen=True)
class Published:
    """One demonstration as published."""

    xy_m: NDArray[np.float64]
    people_m: NDArray[np.float64]
    cells: NDArray[np.int64]
    grid: Grid


def expected() -> dict[str, Any]:
    return json.loads((ROOT / "expected.json").read_text())


def published(run: str) -> dict[str, list[Published]]:
    """Demonstrations of one participant by "file/list", as in expected.json."""
    # The inflated map: row-major with x fastest, lethal from 99 (README of the data).
    nav_map = load(ROOT / "runs" / run / "nav_map.pkl").state
    data = np.array(occupancy(nav_map["ros_occupancy_map"]), dtype=np.int64).reshape(52, 100)
    grid = Grid(data >= INSCRIBED, RESOLUTION_M, ORIGIN_M)
    found = {}
    for path in sorted((ROOT / "runs" / run).glob("*_demos.pkl")):
        for name, demos in load(path).items():
            several = demos if isinstance(demos, list) else [demos]
            found[f"{path.stem}/{name}"] = [one(demo.state, grid) for demo in several]
    return found


def occupancy(message: Kept) -> list[int]:
    """Cells of a nav_msgs/OccupancyGrid: its slots are header, info, data."""
    return list(message.state[2])


def one(state: dict[str, Any], grid: Grid) -> Published:
    return Published(
        np.array(state["world_poses"], dtype=float),
        grid.centres_of(np.array(state["people_pos"], dtype=np.int64).reshape(-1, 2)),
        np.array(state["grid_path"], dtype=np.int64),
        grid,
    )
