"""Learnt rewards as files."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.artefacts.store import Input, read_json
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import FloatArray
from navirl_cli.errors import ArtefactError, NavirlError
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.reward import Reward


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


def _number(value: float) -> float | None:
    """JSON knows no NaN."""
    return float(value) if isfinite(value) else None
