"""A scene under a reward in Rerun, https://rerun.io. The package rerun-sdk is optional."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.errors import MissingPackageError
from navirl_cli.export.scene_log import M_PER_N
from navirl_cli.export.scene_view import SceneView
from navirl_cli.files import replacing

TIMELINE: Final = "log_time"
#: Heights that keep flat things apart, m.
_MAP_Z, _FIELD_Z, _MORE_Z, _LINE_Z, _FORCE_Z = 0.0, 0.01, 0.01, 0.03, 0.3
_GREY, _RED, _BLUE = (120, 120, 120), (200, 40, 30), (20, 80, 200)
_LINES: Final = {"nominal": (90, 90, 90), "demonstrated": (230, 130, 0)}


def show_scene(view: SceneView, output: Path | None = None, *, force: bool = False) -> None:
    """Show a scene in Rerun's viewer, or write it for later.

    Args:
        view: The scene.
        output: An .rrd file; None to open the viewer.
        force: Whether to replace an existing file.

    Raises:
        MissingPackageError: rerun-sdk is not installed.
        ArtefactError: The file cannot be written.
    """
    try:
        rerun = import_module("rerun")
    except ImportError:
        raise MissingPackageError(
            "rerun: expected the package rerun-sdk, found none; install it with pip install 'navirl[view]'"
        ) from None
    if output is None:
        recording = rerun.RecordingStream("navirl")
        recording.spawn()
        _log(rerun, recording, view)
        recording.disconnect()
        return
    with replacing(output, force=force) as temporary:
        recording = rerun.RecordingStream("navirl")
        recording.save(str(temporary))
        _log(rerun, recording, view)
        recording.disconnect()  # writes what is left


def _log(rerun: Any, recording: Any, view: SceneView) -> None:
    """Everything: what stays as static data, what happened on the timeline of the log."""
    grid = view.problem.scene.lattice.grid
    keep = {"static": True}
    recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, **keep)
    recording.log("world/map", _mesh(rerun, view, grid.occupied, lambda _: _GREY, _MAP_Z), **keep)
    for name, field, colour in (("reward", -view.reward, _RED), ("visits", view.visits, _BLUE)):
        z = _FIELD_Z + (name == "visits") * _MORE_Z
        low, high = np.nanmin(field), np.nanmax(field)
        share = (field - low) / (high - low) if high > low else field * 0
        # a cell without visits or cost would hide the other field
        shown = np.nan_to_num(share) > 0.01
        recording.log(f"world/{name}", _mesh(rerun, view, shown, _ramp(share, colour), z), **keep)
    for name, line in view.lines.items():
        strip = rerun.LineStrips3D([_raised(line, _LINE_Z)], colors=[_LINES.get(name, _BLUE)], radii=[0.015])
        recording.log(f"world/{name}", strip, **keep)
    people = _raised(view.problem.scene.people_m, 0.25)
    recording.log(
        "world/people", rerun.Points3D(people, radii=[0.25] * len(people), colors=[_BLUE] * len(people)), **keep
    )
    _log_motion(rerun, recording, view)


def _log_motion(rerun: Any, recording: Any, view: SceneView) -> None:
    """The robot and the force on it over time; an arrow for each push stays from its beginning."""
    trial = view.demonstration
    if trial is None:
        return
    radius = view.problem.robot_radius_m
    for t_ns, place, _ in zip(*view.poses(), strict=True):
        recording.set_time(TIMELINE, timestamp=np.datetime64(int(t_ns), "ns"))
        recording.log("world/robot", rerun.Points3D(_raised(place[None], radius), radii=[radius], colors=[_GREY]))
        if trial.force_n is not None:
            row = min(int(np.searchsorted(trial.t_s, (t_ns - trial.start_ns) / 1e9)), len(trial.t_s) - 1)
            force = trial.force_n[row]
            recording.log("world/robot/force", _arrow(rerun, place, force))
            recording.log("force_n", rerun.Scalars(float(np.hypot(*force))))
    for number, push in enumerate(view.pushes, 1):
        recording.set_time(TIMELINE, timestamp=np.datetime64(push.t_ns, "ns"))
        recording.log(f"world/pushes/{number}", _arrow(rerun, push.place_m, push.force_n))


def _arrow(rerun: Any, place_m: FloatArray, force_n: FloatArray) -> Any:
    """A force at a place."""
    vector = _raised(force_n[None] * M_PER_N, 0.0)
    return rerun.Arrows3D(origins=_raised(place_m[None], _FORCE_Z), vectors=vector, colors=[_RED])


def _raised(points: FloatArray, z: float) -> NDArray[np.float32]:
    """(k, 3) points of the plane at a height."""
    plane = np.asarray(points, dtype=np.float32).reshape(-1, 2)
    return np.column_stack([plane, np.full(len(plane), z, dtype=np.float32)])


def _ramp(share: FloatArray, colour: tuple[int, int, int]) -> Callable[[BoolArray], NDArray[np.uint8]]:
    """Colours of chosen cells, from white for 0 to a colour for 1."""

    def colours(chosen: BoolArray) -> NDArray[np.uint8]:
        values = share[chosen][:, None]
        mixed: NDArray[np.uint8] = np.round(255 + values * (np.array(colour) - 255)).astype(np.uint8)
        return mixed

    return colours


def _mesh(rerun: Any, view: SceneView, chosen: BoolArray, colours: Callable[[BoolArray], Any], z: float) -> Any:
    """Chosen cells as squares of two triangles each."""
    grid = view.problem.scene.lattice.grid
    rows, columns = np.nonzero(chosen)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    squares = (np.column_stack([columns, rows])[:, None] + corners) * grid.resolution_m + np.asarray(grid.origin_m)
    first = 4 * np.arange(len(rows), dtype=np.uint32)[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)).reshape(-1, 3)
    by_cell = np.broadcast_to(np.asarray(colours(chosen), dtype=np.uint8), (len(rows), 3))
    return rerun.Mesh3D(
        vertex_positions=_raised(squares.reshape(-1, 2), z),
        triangle_indices=triangles,
        vertex_colors=np.repeat(by_cell, 4, axis=0),
    )
