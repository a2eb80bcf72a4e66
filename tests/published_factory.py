"""A small participant of a made-up study, in files as the published one has them: pickles of protocol 0."""

import io
import tarfile
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from navirl_cli.demos.grid import Grid
from navirl_cli.demos.rasterize import rasterize

#: A corridor of 5 x 2 m between walls of one cell, each with a ring of two cells.
COLUMNS, ROWS, RESOLUTION_M, ORIGIN_M = 50, 20, 0.1, (-3.0, -1.0)
SAID_M = 0.10000000149011612
DATA = np.zeros((ROWS, COLUMNS), dtype=int)
DATA[[1, 2, -2, -3]] = 99
DATA[[0, -1]] = 100
GRID = Grid(DATA >= 99, RESOLUTION_M, ORIGIN_M)
PERSON = (25, 9)


@dataclass
class Old:
    """An instance of an old-style class, as INST makes it."""

    name: str
    state: Any


@dataclass
class Message:
    """A message of genpy, whose state is a list of its fields."""

    name: str
    slots: list


@dataclass
class Coded:
    """A value that was dumped already."""

    data: bytes


def dumped(value: Any) -> bytes:
    """A value as a pickle of protocol 0; only the map is shared, as in the published files."""
    head, found, rest = (_code(value) + b".").partition(MAP.data)
    return head + found + b"p7\n" + rest.replace(MAP.data, b"g7\n") if found else head


def _code(value: Any) -> bytes:
    """A value's operations."""
    if isinstance(value, np.generic):
        return b"cnumpy.core.multiarray\nscalar\n(" + _dtype(value.dtype) + _code(_bytes_of(value)) + b"tR"
    if isinstance(value, np.ndarray):
        begun = b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR"
        return begun + b"(I1\n" + _code(value.shape) + _dtype(value.dtype) + b"I00\n" + _code(_bytes_of(value)) + b"tb"
    return _CODES[type(value)](value)


_CODES = {
    type(None): lambda _: b"N",
    bool: lambda value: b"I01\n" if value else b"I00\n",
    int: lambda value: f"I{value}\n".encode(),
    float: lambda value: f"F{value!r}\n".encode(),
    str: lambda value: b"S" + repr(value.encode("latin-1"))[1:].encode() + b"\n",
    list: lambda value: b"(l" + b"".join(_code(item) + b"a" for item in value),
    tuple: lambda value: b"(" + b"".join(map(_code, value)) + b"t",
    dict: lambda value: b"(d" + b"".join(_code(key) + _code(item) + b"s" for key, item in value.items()),
    Coded: lambda value: value.data,
    Old: lambda value: f"(i{module_line(value.name)}".encode() + _code(value.state) + b"b",
    Message: lambda value: (
        f"ccopy_reg\n_reconstructor\n(c{module_line(value.name)}c__builtin__\nobject\nNtR".encode()
        + _code(value.slots)
        + b"b"
    ),
}


def _bytes_of(value: np.generic | np.ndarray) -> str:
    return value.tobytes().decode("latin-1")


def module_line(name: str) -> str:
    """Module and name on a line each."""
    module, _, last = name.rpartition(".")
    return f"{module}\n{last}\n"


def _dtype(dtype: np.dtype) -> bytes:
    order = "|" if dtype.itemsize == 1 else ">" if dtype.byteorder == ">" else "<"
    name = f"S'{dtype.kind}{dtype.itemsize}'\n"
    return f"cnumpy\ndtype\n({name}I0\nI1\ntR(I3\nS'{order}'\nNNNI-1\nI-1\nI0\ntb".encode()


def nav_map(data: Any = None, **changed: Any) -> Old:
    """The study's map."""
    said = {"resolution": SAID_M, "width": COLUMNS, "height": ROWS, "origin": ORIGIN_M, "turned": 0.0} | changed
    time = Message("genpy.rostime.Time", [0, 0])
    point = Message("geometry_msgs.msg._Point.Point", [*said["origin"], 0.0])
    quaternion = Message("geometry_msgs.msg._Quaternion.Quaternion", [0.0, 0.0, said["turned"], 1.0])
    pose = Message("geometry_msgs.msg._Pose.Pose", [point, quaternion])
    info = [time, said["resolution"], said["width"], said["height"], pose]
    cells = tuple(DATA.ravel().tolist()) if data is None else data
    message = [
        Message("std_msgs.msg._Header.Header", [0, time, "map"]),
        Message("nav_msgs.msg._MapMetaData.MapMetaData", info),
        cells,
    ]
    return Old("nav_map.NavMap", {"ros_occupancy_map": Message("nav_msgs.msg._OccupancyGrid.OccupancyGrid", message)})


MAP = Coded(_code(nav_map()))


def positions(bow_m: float, steps: int = 24) -> np.ndarray:
    """(n, 2) a drive of 3.4 m to the left around the person, with a stop in its middle and a twitch at its end."""
    x = np.linspace(1.5, -1.9, steps)
    xy = np.stack([x, 0.05 + bow_m * np.cos(np.pi * (x + 0.2) / 3.4)], axis=1)
    return np.concatenate([xy[:10], xy[9:10], xy[9:10], xy[10:], xy[-1:] + 1e-15])


@cache
def _cells(bow_m: float) -> np.ndarray:
    return rasterize(positions(bow_m), GRID)


def demonstration(bow_m: float = 0.5, people: Any = None, **changed: Any) -> Old:
    """One demonstration; `changed` replaces attributes, None removes them."""
    xy = positions(bow_m)
    cells = _cells(bow_m)
    state = {
        "world_poses": [(float(x), float(y)) for x, y in xy],
        "people_pos": [list(PERSON)] if people is None else people,
        "grid_path": [*map(tuple, cells[:-3].tolist()), *map(tuple, cells[-3:])],  # some are numpy's scalars
        "nav_map": MAP,
    } | changed
    return Old("demonstration.Demonstration", {key: value for key, value in state.items() if value is not None})


def participant(**changed: Any) -> dict[str, bytes]:
    """All files of a participant, by name; `changed` replaces the values of lists, None removes them."""
    force = {
        "passing_1": [demonstration(0.3), demonstration(0.35)],
        "replay": demonstration(0.4),
        "passing_2": [demonstration(0.42), demonstration(0.44)],
        "obstacle_course": demonstration(-0.4, people=[]),
    } | changed
    joystick = {"replay": demonstration(0.5), "passing": [demonstration(0.52), demonstration(0.54)]}
    return {
        "force_demos.pkl": dumped({key: value for key, value in force.items() if value is not None}),
        "joystick_demos.pkl": dumped(joystick),
        "obs_avoidance_demos.pkl": dumped({"replay": demonstration(0.25)}),
        "nav_map.pkl": dumped(MAP),
        "force_parcours_times.txt": b"18.7999985218\n",
        "joystick_parcours_times.txt": b"16.9999983311\n",
    }


def archive(files: dict[str, bytes], mode: str = "w:gz", kinds: dict[str, bytes] | None = None) -> bytes:
    """A tar archive; `kinds` gives members another type."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode=mode) as tar:
        for name, data in files.items():
            member = tarfile.TarInfo(name)
            member.type = (kinds or {}).get(name, tarfile.REGTYPE)
            member.linkname = "/etc/hostname" if member.type in {tarfile.SYMTYPE, tarfile.LNKTYPE} else ""
            member.size = len(data) if member.isreg() else 0
            tar.addfile(member, io.BytesIO(data))
    return buffer.getvalue()
