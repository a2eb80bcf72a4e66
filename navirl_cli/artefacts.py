"""What navirl writes and reads back: JSON files, versioned, checked against their schema, written whole."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli import __version__
from navirl_cli.demos.demonstration import Condition, Contact, Demonstration
from navirl_cli.demos.grid import FloatArray, Grid
from navirl_cli.errors import ArtefactError, NavirlError
from navirl_cli.files import replacing
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.reward import Reward

#: Decimals of metres, radians and newtons in files: a micrometre is below every sensor.
DECIMALS = 6


@dataclass(frozen=True)
class Input:
    """A file that something was made from."""

    file: str
    sha256: str

    @staticmethod
    def of(path: Path) -> "Input":
        """Name and hash of a file.

        Raises:
            ArtefactError: It cannot be read.
        """
        digest = sha256()
        try:
            with path.open("rb") as stream:
                while block := stream.read(1 << 20):
                    digest.update(block)
        except OSError as error:
            raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
        return Input(path.name, digest.hexdigest())


@dataclass(frozen=True)
class LearntReward:
    """A reward as read back from its file."""

    reward: Reward
    #: (k, k), NaN where the data held no information.
    covariance: FloatArray
    #: Side of the cells that it was learnt on, m.
    resolution_m: float
    #: Ids of the demonstrations that it was learnt from.
    demonstrations: tuple[str, ...]


def write_json(path: Path, kind: str, content: Mapping[str, Any], *, force: bool) -> None:
    """Write an artefact.

    Args:
        path: The file.
        kind: "demonstrations", "reward" or "metrics".
        content: Without the fields that name format and version.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    document = {"format": f"navirl/{kind}", "version": 1, "navirl": __version__, **content}
    with replacing(path, force=force) as temporary:
        temporary.write_text(json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: Path, kind: str) -> dict[str, Any]:
    """Read an artefact and check it against its schema.

    Raises:
        ArtefactError: The file is missing, no JSON, of another kind, or breaks the schema.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        hint = "; logs become demonstrations by navirl extract" if path.suffix == ".mcap" else ""
        raise ArtefactError(f"{path}: expected a JSON file of navirl {kind}, found none ({error}){hint}") from error
    found = document.get("format") if isinstance(document, dict) else None
    if found != f"navirl/{kind}":
        what = f"a file of format {found!r}" if found else "other JSON"
        raise ArtefactError(f"{path}: expected navirl {kind} (format 'navirl/{kind}'), found {what}")
    problem = next(iter(_validator(kind).iter_errors(document)), None)
    if problem is not None:
        place = "/".join(str(part) for part in problem.absolute_path) or "the whole file"
        message = problem.message if len(problem.message) < 200 else problem.message[:200] + " ..."
        raise ArtefactError(f"{path}: breaks the schema of navirl {kind} at {place}: {message}")
    return dict(document)


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


def read_demonstrations(path: Path) -> list[Demonstration]:
    """Demonstrations of a file.

    Raises:
        ArtefactError: As in :func:`read_json`, or a demonstration contradicts itself.
    """
    document = read_json(path, "demonstrations")
    try:
        grids = {digest: _grid(content) for digest, content in document["maps"].items()}
        found = [_read(content, grids) for content in document["demonstrations"]]
    except (NavirlError, ValueError, TypeError, KeyError, OverflowError) as error:
        raise ArtefactError(f"{path}: {error}") from error
    twice = [name for name, count in Counter(one.id for one in found).items() if count > 1]
    if twice:
        raise ArtefactError(f"{path}: two demonstrations are called {twice[0]}; ids must be unique")
    return found


def reward_document(
    fit: Fit, demonstrations: Sequence[Demonstration], inputs: Sequence[Input], resolution_m: float
) -> dict[str, Any]:
    """A fit as the content of a reward file."""
    return {
        "inputs": [vars(one) for one in inputs],
        "parameters": [
            {
                "name": parameter.name,
                "unit": parameter.unit,
                "value": value,
                "standard_error": _number(error),
                "identified": bool(identified),
                "on_bound": bool(on_bound),
            }
            for parameter, value, error, identified, on_bound in zip(
                fit.reward.parameters, fit.reward.theta, fit.standard_errors, fit.identified, fit.on_bound, strict=True
            )
        ],
        "covariance": [[_number(value) for value in row] for row in fit.covariance],
        "resolution_m": resolution_m,
        "status": fit.status.value,
        "l2": fit.l2,
        "initial": {p.name: value for p, value in zip(fit.initial.parameters, fit.initial.theta, strict=True)},
        "log_likelihood": fit.log_likelihood,
        "log_likelihood_initial": fit.log_likelihood_initial,
        "log_likelihood_uniform": fit.log_likelihood_uniform,
        "demonstrations": [demonstration.id for demonstration in demonstrations],
        "participants": sorted({demonstration.participant for demonstration in demonstrations}),
        "steps": fit.steps,
        "iterations": fit.iterations,
        "evaluations": fit.evaluations,
    }


def read_reward(path: Path) -> LearntReward:
    """A reward of a file.

    Raises:
        ArtefactError: As in :func:`read_json`, or the parameters are none of a reward.
    """
    document = read_json(path, "reward")
    values = {parameter["name"]: parameter["value"] for parameter in document["parameters"]}
    names = [parameter["name"] for parameter in document["parameters"]]
    missing = {parameter.name for parameter in Reward.named({}).parameters} - set(names)
    if missing or len(names) > len(values):
        raise ArtefactError(f"{path}: expected each parameter once, found {', '.join(names)}")
    try:
        reward = Reward.named(values)
    except NavirlError as error:
        raise ArtefactError(f"{path}: {error}") from error
    covariance = np.array(document["covariance"], dtype=float)
    if covariance.shape != (len(values), len(values)):
        raise ArtefactError(f"{path}: covariance: expected {len(values)} rows and columns, found {covariance.shape}")
    return LearntReward(reward, covariance, document["resolution_m"], tuple(document["demonstrations"]))


def read_reward_for(path: Path, demonstrations: Sequence[Demonstration]) -> LearntReward:
    """The reward of a file, for use on demonstrations.

    Raises:
        ArtefactError: As in :func:`read_reward`, or the reward was learnt on cells of another size: a reward per step
            means something else where steps have another length.
    """
    learnt = read_reward(path)
    others = {d.grid.resolution_m for d in demonstrations if not np.isclose(d.grid.resolution_m, learnt.resolution_m)}
    if others:
        raise ArtefactError(
            f"{path}: learnt on cells of {learnt.resolution_m:g} m, but the demonstrations lie on cells of "
            f"{min(others):g} m; extract them with --resolution {learnt.resolution_m:g}, or fit anew"
        )
    return learnt


def _refuse_constant(name: str) -> float:
    """NaN and Infinity are no JSON."""
    raise ValueError(f"{name} is no JSON number")


def _number(value: float) -> float | None:
    """JSON knows no NaN."""
    return float(value) if isfinite(value) else None


def _rounded(values: FloatArray) -> list[float]:
    return [float(value) for value in np.round(values, DECIMALS)]


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
        "t_s": [round(float(t), 9) for t in d.t_s],
        "x_m": _rounded(d.xy_m[:, 0]),
        "y_m": _rounded(d.xy_m[:, 1]),
        "yaw_rad": _rounded(d.yaw_rad),
        "force_x_n": None if d.force_n is None else _rounded(d.force_n[:, 0]),
        "force_y_n": None if d.force_n is None else _rounded(d.force_n[:, 1]),
        "contacts": [
            {
                "start_s": round(contact.start_s, DECIMALS),
                "end_s": round(contact.end_s, DECIMALS),
                "peak_n": round(contact.peak_n, DECIMALS),
                "impulse_ns": _rounded(np.array(contact.impulse_ns)),
            }
            for contact in d.contacts
        ],
        "goal_m": _rounded(np.array(d.goal_m)),
        "people_m": [_rounded(person) for person in d.people_m],
        "robot_radius_m": d.robot_radius_m,
        "map": d.grid.digest,
        "cells": d.cells.tolist(),
        "notes": list(d.notes),
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
        x, y, force_x, force_y = (content[key] for key in ("x_m", "y_m", "force_x_n", "force_y_n"))
        forceless = force_x is None or force_y is None
        return Demonstration(
            id=name,
            participant=content["participant"],
            condition=Condition(content["condition"]),
            corrected=content["corrected"],
            cycle=content["cycle"],
            start_ns=content["start_ns"],
            t_s=np.array(content["t_s"], dtype=float),
            xy_m=np.stack([np.array(x, dtype=float), np.array(y, dtype=float)], axis=1),
            yaw_rad=np.array(content["yaw_rad"], dtype=float),
            force_n=None if forceless else np.stack([np.array(force_x, float), np.array(force_y, float)], axis=1),
            contacts=tuple(
                Contact(c["start_s"], c["end_s"], c["peak_n"], (c["impulse_ns"][0], c["impulse_ns"][1]))
                for c in content["contacts"]
            ),
            goal_m=(content["goal_m"][0], content["goal_m"][1]),
            people_m=np.array(content["people_m"], dtype=float).reshape(-1, 2),
            robot_radius_m=content["robot_radius_m"],
            grid=grids[content["map"]],
            cells=np.array(content["cells"], dtype=np.int64),
            log=content["log"],
            notes=tuple(content["notes"]),
        )
    except (ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"demonstration {name}: {error}") from error


@cache
def _validator(kind: str) -> Any:
    """The compiled schema of a kind of artefact."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(json.loads(schema_path(kind).read_text(encoding="utf-8")))


def schema_path(kind: str) -> Path:
    """The JSON Schema of a kind of artefact: inside an installed package, or at the top of a source tree."""
    package = Path(__file__).parent
    name = f"{kind}.schema.json"
    inside = package / "schemas" / name
    return inside if inside.exists() else package.parent / "schemas" / name
