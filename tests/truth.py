"""The truth of a simulated log: read by mcap's own reader, not by navirl's."""

import base64
import json
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader


@dataclass(frozen=True)
class TrueTrial:
    """One pass, from its first motion to its arrival, every 10 ms."""

    condition: str
    cycle: int | None
    goal_t_ns: int
    t_ns: np.ndarray
    xy_m: np.ndarray
    force_n: np.ndarray


@dataclass(frozen=True)
class Truth:
    theta: tuple[float, ...]
    trials: list[TrueTrial]


def read_record(path: Path) -> dict[str, Any]:
    with path.open("rb") as stream:
        records = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
    content: dict[str, Any] = json.loads(records["navirl.truth"]["simulation"])
    return content


def read_truth(path: Path) -> Truth:
    content = read_record(path)
    step_ns = round(content["step_s"] * 1e9)
    trials = []
    for one in content["trials"]:
        xy = np.cumsum(_unpacked(one["xy_mm_zlib"]), axis=0) / 1000
        times = one["start_t_ns"] + step_ns * np.arange(len(xy))
        assert times[-1] == one["stop_t_ns"]
        force = _unpacked(one["force_cn_zlib"]) / 100
        trials.append(TrueTrial(one["condition"], one["cycle"], one["goal_t_ns"], times, xy, force))
    return Truth(tuple(content["theta"].values()), trials)


def _unpacked(text: str) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), "<i2").reshape(-1, 2).astype(float)
