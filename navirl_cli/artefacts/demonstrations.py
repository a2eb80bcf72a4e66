"""Demonstrations files."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.artefacts.manifest import manifest_path, read_listed, read_manifest
from navirl_cli.artefacts.store import no_garbage, read_json
from navirl_cli.demos.demonstration import Condition, Contact, Demonstration, PersonTrack
from navirl_cli.demos.grid import Grid
from navirl_cli.errors import ArtefactError, DemonstrationError, NavirlError
from navirl_cli.files import MANIFEST, Input

if TYPE_CHECKING:  # commands that only read demonstrations need neither logs nor their extraction
    from navirl_cli.demos.extract import ExtractSettings
    from navirl_cli.demos.gain import Gain
    from navirl_cli.logs.load import LoadOptions

#: Larger numbers are refused: no trial holds them, and they would need unlimited memory. In the units of the lists.
_MOST = {"t_s": 1e6, "x_m": 1e8, "y_m": 1e8, "yaw_rad": 1e6, "force_x_n": 1e6, "force_y_n": 1e6}
#: Decimals of metres, radians and newtons in files. No sensor resolves a micrometre.
DECIMALS = 6
#: Of seconds: clocks count nanoseconds.
TIME_DECIMALS = 9


@no_garbage()
def demonstrations_document(
    demonstrations: Sequence[Demonstration], inputs: Sequence[Input], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Demonstrations as the content of a demonstrations file."""
    grids = {demonstration.grid.digest: demonstration.grid for demonstration in demonstrations}
    return {
        "inputs": [vars(one) for one in inputs],
        "settings": dict(settings),
        "maps": {
            digest: {
                "resolution_m": grid.resolution_m,
                "origin_m": list(grid.origin_m),
                "rows": ["".join(row) for row in np.where(grid.occupied, "#", ".")],
            }
            for digest, grid in grids.items()
        },
        "demonstrations": [_written(demonstration) for demonstration in demonstrations],
    }


def settings_document(
    settings: "ExtractSettings",
    options: "LoadOptions",
    map_file: Path | None,
    trials: Path | None,
    *,
    join: bool = False,
) -> dict[str, Any]:
    """The settings of an extraction.

    Args:
        settings: Of the extraction.
        options: The user's choices about the logs.
        map_file: The map in place of the log's.
        trials: The table of labels.
        join: Whether the logs are one recording.
    """
    from navirl_cli.logs.load import Forces

    return asdict(settings) | {
        "topics": {role: list(names) for role, names in options.topics.items()},
        "namespace": options.namespace,
        "time": options.time.value,
        "frame": options.frame,
        "wrench_frame": options.wrench_frame,
        "force_scale": options.force_scale,
        "wrench": options.forces is not Forces.IGNORED,
        "strict": options.strict,
        "join": join,
        "map": None if map_file is None else map_file.name,
        "trials": None if trials is None else trials.name,
    }


def gain_document(gains: "Sequence[tuple[str, Gain | None]]") -> dict[str, Any] | None:
    """The gain of each recording with the name of its log, and of all together. None if no trial holds a push."""
    from navirl_cli.demos.gain import pooled

    known = [(log, gain) for log, gain in gains if gain is not None]
    if not known:
        return None
    logs = [{"log": log, **vars(gain)} for log, gain in known]
    return {**vars(pooled([gain for _, gain in known])), "logs": logs}


def read_demonstrations(path: Path) -> list[Demonstration]:
    """Demonstrations of a file, or of all files of a folder with a manifest.

    Raises:
        ArtefactError: As in :func:`read_json`, or a demonstration contradicts itself.
    """
    listing = manifest_path(path)
    if listing.name != MANIFEST:
        return demonstrations_of(read_json(path, "demonstrations"), str(path))
    grids: dict[str, Grid] = {}
    contents = []
    for entry in read_manifest(listing):
        if entry.file is not None:
            file = listing.parent / entry.file
            document = read_json(file, "demonstrations", entry.file_sha256)
            contents.append((entry, demonstrations_of(document, str(file), grids)))
    return read_listed(listing, contents)


@no_garbage()
def demonstrations_of(
    document: Mapping[str, Any], path: str, known: dict[str, Grid] | None = None
) -> list[Demonstration]:
    """The demonstrations of a file's content.

    Args:
        document: As :func:`demonstrations_document` makes it.
        path: Where it comes from, for messages.
        known: Maps by their digests, which are not made again; those of the file are added.

    Raises:
        ArtefactError: A demonstration contradicts itself.
    """
    try:
        grids = {} if known is None else known
        grids.update({digest: _grid(content) for digest, content in document["maps"].items() if digest not in grids})
        found = [_read(content, grids) for content in document["demonstrations"]]
    except (NavirlError, ValueError, TypeError, KeyError, OverflowError) as error:
        raise ArtefactError(f"{path}: {error}") from error
    twice = [name for name, count in Counter(one.id for one in found).items() if count > 1]
    if twice:
        raise ArtefactError(f"{path}: two demonstrations are called {twice[0]}; ids must be unique")
    return found


def _rounded(values: FloatArray, decimals: int = DECIMALS) -> list[float]:
    found: list[float] = np.round(values, decimals).tolist()
    return found


def _written(demonstration: Demonstration) -> dict[str, Any]:
    """One demonstration as JSON."""
    d = demonstration
    return {
        "id": d.id,
        "participant": d.participant,
        "condition": d.condition.value,
        "corrected": d.corrected,
        "cycle": d.cycle,
        "log": d.log,
        "start_ns": d.start_ns,
        "t_s": _rounded(d.t_s, TIME_DECIMALS),
        "x_m": _rounded(d.xy_m[:, 0]),
        "y_m": _rounded(d.xy_m[:, 1]),
        "yaw_rad": _rounded(d.yaw_rad),
        "force_x_n": None if d.force_n is None else _rounded(d.force_n[:, 0]),
        "force_y_n": None if d.force_n is None else _rounded(d.force_n[:, 1]),
        "contacts": None
        if d.contacts is None
        else [
            {
                "start_s": round(contact.start_s, DECIMALS),
                "end_s": round(contact.end_s, DECIMALS),
                "peak_force_n": round(contact.peak_force_n, DECIMALS),
                "impulse_n_s": _rounded(np.array(contact.impulse_n_s)),
            }
            for contact in d.contacts
        ],
        "set": d.set,
        "nominal_m": None if d.nominal_m is None else [_rounded(corner) for corner in d.nominal_m],
        "laid_out_m_s": d.laid_out_m_s,
        "goal_m": _rounded(np.array(d.goal_m)),
        "people_m": [_rounded(person) for person in d.people_m],
        "tracks": [_track_written(track) for track in d.tracks],
        "robot_radius_m": d.robot_radius_m,
        "map": d.grid.digest,
        "cells": d.cells.tolist(),
        "truncated": d.truncated,
        "notes": list(d.notes),
        "warnings": list(d.warnings),
    }


def _track_written(track: PersonTrack) -> dict[str, Any]:
    """A person's motion as JSON."""
    return {
        "name": track.name,
        "spread_m": round(track.spread_m, DECIMALS),
        "t_s": _rounded(track.t_s, TIME_DECIMALS),
        "x_m": _rounded(track.xy_m[:, 0]),
        "y_m": _rounded(track.xy_m[:, 1]),
    }


def _grid(content: Mapping[str, Any]) -> Grid:
    """A map of a demonstrations file."""
    rows = content["rows"]
    if len({len(row) for row in rows}) != 1:
        raise ValueError("a map's rows differ in length")
    occupied = np.array([list(row) for row in rows]) == "#"
    x, y = content["origin_m"]
    return Grid(occupied, float(content["resolution_m"]), (float(x), float(y)))


def _read(content: Mapping[str, Any], grids: Mapping[str, Grid]) -> Demonstration:
    """One demonstration of a demonstrations file."""
    name = content["id"]
    if content["map"] not in grids:
        raise ValueError(f"demonstration {name}: its map {content['map']!r} is not in the file")
    try:
        grid = grids[content["map"]]
        x_bounds, y_bounds = _around(grid)
        x, y = _numbers(content, "x_m", x_bounds), _numbers(content, "y_m", y_bounds)
        forceless = content["force_x_n"] is None or content["force_y_n"] is None
        return Demonstration(
            id=name,
            participant=content["participant"],
            condition=Condition(content["condition"]),
            corrected=content["corrected"],
            cycle=content["cycle"],
            start_ns=content["start_ns"],
            t_s=_numbers(content, "t_s"),
            xy_m=np.stack([x, y], axis=1),
            yaw_rad=_numbers(content, "yaw_rad"),
            force_n=None
            if forceless
            else np.stack([_numbers(content, "force_x_n"), _numbers(content, "force_y_n")], axis=1),
            contacts=None if content["contacts"] is None else tuple(_contact(one) for one in content["contacts"]),
            goal_m=(content["goal_m"][0], content["goal_m"][1]),
            people_m=np.array(content["people_m"], dtype=float).reshape(-1, 2),
            robot_radius_m=content["robot_radius_m"],
            grid=grid,
            cells=np.array(content["cells"], dtype=np.int64),
            log=content["log"],
            tracks=tuple(_track(track) for track in content.get("tracks", ())),
            set=content.get("set"),
            nominal_m=None if content.get("nominal_m") is None else np.array(content["nominal_m"], dtype=float),
            laid_out_m_s=content.get("laid_out_m_s"),
            truncated=content.get("truncated", False),
            notes=tuple(content["notes"]),
            warnings=tuple(content.get("warnings", ())),
        )
    except (ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"demonstration {name}: {error}") from error


def _numbers(content: Mapping[str, Any], name: str, bounds: tuple[float, float] | None = None) -> FloatArray:
    """(n,) numbers of a list.

    Raises:
        ValueError: One of them is out of bounds.
    """
    values = np.array(content[name], dtype=float)
    least, most = bounds or (-_MOST[name], _MOST[name])
    beyond = values[(values < least) | (values > most)]
    if len(beyond):
        raise ValueError(f"{name}: expected numbers from {least:g} to {most:g}, found {beyond[0]:g}")
    return values


def _around(grid: Grid) -> tuple[tuple[float, float], tuple[float, float]]:
    """Bounds of x and of y, m: the map, and as much as its length around it."""
    rows, columns = grid.shape
    beside = max(rows, columns) * grid.resolution_m
    (x, y), (width, height) = grid.origin_m, (columns * grid.resolution_m, rows * grid.resolution_m)
    return (x - beside, x + width + beside), (y - beside, y + height + beside)


def _contact(content: Mapping[str, Any]) -> Contact:
    """One contact of a demonstration."""
    x, y = content["impulse_n_s"]
    return Contact(content["start_s"], content["end_s"], content["peak_force_n"], (x, y))


def _track(content: Mapping[str, Any]) -> PersonTrack:
    """A person's motion in a demonstration."""
    t, x, y = (_numbers(content, key) for key in ("t_s", "x_m", "y_m"))
    try:
        return PersonTrack(content["name"], t, np.stack([x, y], axis=1))
    except DemonstrationError as error:  # which does not name the demonstration
        raise ValueError(str(error)) from error
