"""The published data of one participant: paths, map and completion times, checked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import PurePosixPath
from typing import Any, Final, ParamSpec, TypeVar

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.grid import Grid, grid_from_occupancy
from navirl_cli.errors import ArtefactError
from navirl_cli.logs.recording import Occupancy
from navirl_cli.published.fields import occupancy_in, pairs_in, state_of
from navirl_cli.published.pickled import read_pickle
from navirl_cli.published.runs import DEMONSTRATIONS, EXPECTED, MAP, TIMES, Run

#: Limits of what can be driven in a hallway: paths in a file, length of a path in m, people; m from the map's origin.
MOST_PATHS, MOST_M, MOST_PEOPLE, FARTHEST_M = 100, 1000.0, 100, 1e6
#: Most bytes of completion times.
MOST_OF_TIMES: Final = 10_000

Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")


@dataclass(frozen=True)
class Part:
    """The role of a list of demonstrations in the study."""

    condition: Condition
    #: Interaction cycle, for pushed passes.
    cycle: int | None = None
    #: Purpose, where it is not a plain pass.
    set: str | None = None


#: The lists of the published files, by file and key, in the order in which the study was run.
PARTS: Final[Mapping[tuple[str, str], Part]] = {
    ("force_demos", "passing_1"): Part(Condition.FORCE, cycle=1),
    ("force_demos", "passing_2"): Part(Condition.FORCE, cycle=2),
    ("force_demos", "replay"): Part(Condition.AUTONOMOUS, set="replay of the learnt policy"),
    ("force_demos", "obstacle_course"): Part(Condition.FORCE, set="obstacle course"),
    ("joystick_demos", "passing"): Part(Condition.JOYSTICK),
    ("joystick_demos", "replay"): Part(Condition.AUTONOMOUS, set="replay of the joystick"),
    ("obs_avoidance_demos", "replay"): Part(Condition.AUTONOMOUS, set="obstacle avoidance"),
}
_CONDITIONS: Final = dict(zip(DEMONSTRATIONS, (Condition.FORCE, Condition.JOYSTICK, Condition.AUTONOMOUS), strict=True))


@dataclass(frozen=True, eq=False)
class PublishedPath:
    """One demonstration as published."""

    #: "force_demos/passing_1/1": file, list, number.
    name: str
    part: Part
    #: (n, 2) m, map frame, as published; no times.
    xy_m: FloatArray
    #: (p, 2) column and row of the people's cells.
    people: IntArray
    #: (k, 2) column and row of the path's cells.
    cells: IntArray


@dataclass(frozen=True, eq=False)
class Participant:
    """The published data of one participant."""

    name: str
    #: The map of all cells.
    occupancy: Occupancy
    #: In the order in which the study was run.
    paths: tuple[PublishedPath, ...]
    #: Times in which the obstacle course was completed, s, by modality.
    completion_s: Mapping[str, tuple[float, ...]]
    #: Missing and unusable data, in words.
    lost: tuple[str, ...]

    @property
    def grid(self) -> Grid:
        """The map's cells. The published map is an inflated costmap, which no radius grows."""
        return grid_from_occupancy(
            self.occupancy.data, self.occupancy.resolution_m, self.occupancy.origin_m, robot_radius_m=0.0
        )


@dataclass(frozen=True)
class _Entry:
    """One demonstration in its file."""

    #: The demonstration's file and place in it, for messages.
    place: str
    #: File without ending, and list.
    part: tuple[str, str]
    number: int
    value: Any


def participant_of(run: Run) -> Participant:
    """Read and check the files of one participant; unusable data are left out and listed.

    Raises:
        ArtefactError: No path or no map is usable.
    """
    lost = list(run.lost)
    entries = [
        entry
        for name in DEMONSTRATIONS
        if name in run.files
        for entry in _tried(lost, _entries, f"{run.place}/{name}", run.files[name]) or ()
    ]
    occupancy = _map(run, entries, lost)
    missing = [name for name in EXPECTED if name not in run.files and not any(name in line for line in run.lost)]
    if missing:
        lost.append(f"{run.place}: expected {', '.join(missing)} too, found no such files; their data are left out")
    known = list(PARTS)
    entries.sort(key=lambda entry: known.index(entry.part) if entry.part in PARTS else len(known))
    found = [_tried(lost, _path, entry, occupancy) for entry in entries] if occupancy else []
    paths = tuple(path for path in found if path is not None)
    if occupancy is None or not paths:
        first = f"none: {lost[0]}" if lost else "empty lists; download the files again"
        rest = f" (and {len(lost) - 1} more)" if lost[1:] else ""
        raise ArtefactError(f"{run.place}: expected demonstrations and a map, found {first}{rest}")
    times = {name.removesuffix(TIMES): name for name in sorted(run.files) if name.endswith(TIMES)}
    completed = {
        modality: _tried(lost, _completion, f"{run.place}/{name}", run.files[name]) for modality, name in times.items()
    }
    completion_s = {modality: seconds for modality, seconds in completed.items() if seconds is not None}
    return Participant(run.name, occupancy, paths, completion_s, tuple(lost))


def _tried(
    lost: list[str], function: Callable[Arguments, Value], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> Value | None:
    """The result of a function; None after an expected error, which is added to `lost`."""
    try:
        return function(*args, **kwargs)
    except ArtefactError as error:
        lost.append(str(error))
        return None


def _entries(place: str, data: bytes) -> list[_Entry]:
    """The demonstrations of a file: lists of them, or single ones, under any key."""
    file = PurePosixPath(place).stem
    content = read_pickle(data, place)
    keys = sorted(content) if type(content) is dict and all(type(key) is str for key in content) else []
    if not keys or not all(key.isprintable() and len(key) <= 100 for key in keys):
        raise ArtefactError(
            f"{place}: expected lists of demonstrations by their names, found something else; download the file again"
        )
    entries = []
    for key in keys:
        several = content[key] if type(content[key]) is list else [content[key]]
        for number, value in enumerate(several[: MOST_PATHS + 1], start=1):
            entries.append(_Entry(f"{place}/{key}/{number}", (file, key), number, value))
    if len(entries) > MOST_PATHS:
        raise ArtefactError(
            f"{place}: expected at most {MOST_PATHS} demonstrations, found more; download the file again"
        )
    return entries


def _map(run: Run, entries: list[_Entry], lost: list[str]) -> Occupancy | None:
    """The participant's map; without its file that of the first demonstration with a map."""
    if MAP in run.files:
        place = f"{run.place}/{MAP}"
        found = _tried(lost, lambda: _checked(place, occupancy_in, read_pickle(run.files[MAP], place)))
        if found is not None:
            return found
    return next(
        (
            occupancy
            for entry in entries
            if (occupancy := _tried([], _checked, entry.place, _own_map, entry.value)) is not None
        ),
        None,
    )


def _own_map(demonstration: Any) -> Occupancy:
    """The map in a demonstration."""
    return occupancy_in(state_of(demonstration, "Demonstration").get("nav_map"))


def _checked(place: str, parse: Callable[[Any], Value], value: Any) -> Value:
    """The result of a parser; its ValueError becomes an expected error."""
    try:
        return parse(value)
    except ValueError as error:
        raise ArtefactError(f"{place}: {error}; download the file again") from error


def _path(entry: _Entry, occupancy: Occupancy) -> PublishedPath:
    """One demonstration."""
    return _checked(entry.place, lambda value: _parsed(entry, value, occupancy), entry.value)


def _parsed(entry: _Entry, value: Any, occupancy: Occupancy) -> PublishedPath:
    """One demonstration; raises ValueError where it does not fit."""
    state = state_of(value, "Demonstration")
    xy_m = pairs_in(state, "world_poses", float, "pairs of numbers (m), at least 2", least=2)
    people = pairs_in(state, "people_pos", int, "pairs of integers (cells)")
    cells = pairs_in(state, "grid_path", int, "pairs of integers (cells), at least 1", least=1)
    if not (np.abs(xy_m) <= FARTHEST_M).all():
        raise ValueError(f"world_poses: expected finite numbers of at most {FARTHEST_M:g} m, found others")
    length_m = float(np.hypot(*np.diff(xy_m, axis=0).T).sum())
    if not 0 < length_m <= MOST_M:
        raise ValueError(f"world_poses: expected a path of at most {MOST_M:g} m, found one of {length_m:g} m")
    if len(people) > MOST_PEOPLE:
        raise ValueError(f"people_pos: expected at most {MOST_PEOPLE} people, found {len(people)}")
    rows, columns = occupancy.data.shape
    if not ((cells >= 0) & (cells < (columns, rows))).all():
        raise ValueError(f"grid_path: expected cells of the map ({columns} x {rows}), found others")
    own = _own_map(value) if "nav_map" in state else occupancy
    if (own.origin_m, own.resolution_m) != (occupancy.origin_m, occupancy.resolution_m):
        raise ValueError(
            f"nav_map: expected the participant's map (cells of {occupancy.resolution_m} m from {occupancy.origin_m} "
            f"m), found another (cells of {own.resolution_m} m from {own.origin_m} m)"
        )
    file, key = entry.part
    plain = None if key.startswith("passing") else key.replace("_", " ")
    part = PARTS.get(entry.part, Part(_CONDITIONS[f"{file}.pkl"], set=plain))
    return PublishedPath(f"{file}/{key}/{entry.number}", part, xy_m, people, cells)


def _completion(place: str, data: bytes) -> tuple[float, ...]:
    """Seconds, one or several."""
    try:
        seconds = tuple(float(word) for word in data.decode("ascii").split()) if len(data) <= MOST_OF_TIMES else ()
    except ValueError:
        seconds = ()
    if not seconds or not all(isfinite(value) and value > 0 for value in seconds):
        raise ArtefactError(f"{place}: expected seconds above 0, found {data[:40]!r}; download the file again")
    return seconds
