"""People who differ, in reward files: the typical reward's file holds the reward of each person beside it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.artefacts.store import number, numbers, row
from navirl_cli.errors import ArtefactError, unknown
from navirl_cli.irl.intervals import LEVEL, Errors, Kind
from navirl_cli.irl.log_scale import LogScale
from navirl_cli.irl.newcomer import Others
from navirl_cli.irl.population import Person, Population
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.spread import Spread
from navirl_cli.irl.uncertainty import condition_number


def population_document(found: Population, ids: Sequence[str]) -> dict[str, Any]:
    """How people are scattered, and each of them.

    Args:
        found: The people.
        ids: Of the demonstrations from which they were learnt.
    """
    columns = (found.mean, found.scatter, found.scatter_lower, found.scatter_upper, np.sqrt(found.scatter_squared))
    return {
        "parameters": [
            {
                "name": name,
                "log_mean": float(mean),
                "scatter": float(middle),
                "scatter_lower": float(lower),
                "scatter_upper": float(upper),
                "scatter_rms": float(square),
                "people_differ": bool(differ),
            }
            for name, mean, middle, lower, upper, square, differ in zip(
                found.scale.names, *columns, found.differ, strict=True
            )
        ],
        "log_covariance": numbers(found.covariance),
        "log_likelihood": found.log_likelihood,
        "log_likelihood_alike": found.log_likelihood_alike,
        "persons": [_person_document(one, ids) for one in found.persons],
    }


def _person_document(found: Person, ids: Sequence[str]) -> dict[str, Any]:
    """One person's reward."""
    return {
        "name": found.name,
        "parameters": [
            {"name": parameter.name, "value": value, "lower": float(lower), "upper": float(upper)}
            for parameter, value, lower, upper in zip(
                found.reward.parameters, found.reward.theta, found.lower, found.upper, strict=True
            )
        ],
        "covariance": numbers(found.covariance),
        "demonstrations": [ids[owner] for owner in found.owners],
        "steps": found.steps,
        "log_likelihood": found.log_likelihood,
        "log_likelihood_typical": found.log_likelihood_typical,
        "log_likelihood_uniform": found.log_likelihood_uniform,
        "effective_draws": number(found.effective),
        "draws": found.drawn,
    }


def whose(person: str, others: Sequence[str]) -> dict[str, Any]:
    """Whose reward a file holds, and towards whom it was drawn."""
    return {"person": person, "shrunk_towards": [name for name in others if name != person]}


def names_of_persons(content: Mapping[str, Any]) -> list[str]:
    """The people whose rewards a file's content holds; none for one reward for all."""
    population = content.get("population")
    return [] if population is None else [one["name"] for one in population["persons"]]


def others_of(content: Mapping[str, Any], reward: Reward, path: str) -> Others | None:
    """What a file's content says about the next person; None for one reward for all.

    Raises:
        ArtefactError: A parameter is unknown, or the covariance has another size.
    """
    population = content.get("population")
    if population is None:
        return None
    rows = {one["name"]: one for one in population["parameters"]}
    names = [parameter.name for parameter in reward.parameters]
    own = [name for name in names if name in rows]
    variance = _square(population["log_covariance"], len(own), f"{path}: population/log_covariance")
    if list(rows) != own:
        raise ArtefactError(f"{path}: population/parameters: expected some of {', '.join(names)}, in this order")
    if any(value == 0 for name, value in zip(names, reward.theta, strict=True) if name in rows):
        raise ArtefactError(f"{path}: population/parameters: expected values other than 0, found 0")
    mean, scatter = (np.array([one[key] for one in rows.values()]) for key in ("log_mean", "scatter_rms"))
    scale = LogScale(reward, np.array([name in rows for name in names]))
    return Others(scale, Spread(mean, np.sqrt(scatter**2 + np.diag(variance))))


def _square(rows: list[Any], size: int, where: str) -> FloatArray:
    """A square matrix of a file.

    Raises:
        ArtefactError: It has another size.
    """
    if len(rows) != size or any(len(one) != size for one in rows):
        raise ArtefactError(f"{where}: expected {size} rows of {size} numbers")
    return np.array([row(one) for one in rows]).reshape(size, size)


def of_person(content: Mapping[str, Any], name: str, path: str) -> dict[str, Any]:
    """The content of a reward file with the reward of one of its people, in place of the typical one.

    Args:
        content: As :func:`navirl_cli.artefacts.rewards.reward_document` makes it.
        name: Of the person.
        path: Where it comes from, for messages.

    Raises:
        ArtefactError: The file holds one reward for all, or no reward of this person.
    """
    names = names_of_persons(content)
    if not names:
        raise ArtefactError(
            f"{path}: expected a reward with one for each person, found one reward for all; fit with `pool` persons"
        )
    if name not in names:
        raise ArtefactError(f"{path}: {unknown('person', name, names)}")
    own = content["population"]["persons"][names.index(name)]
    parameters, covariance = _own_parameters(own, content, path)
    varying = {one["name"] for one in content["population"]["parameters"]}
    start = {one["name"]: one["value"] for one in content["parameters"]}
    ends = [
        {key: one[key] for key in ("name", "lower", "upper")} for one in own["parameters"] if one["name"] in varying
    ]
    return {
        **{key: value for key, value in content.items() if key not in {"population", "pool"}},
        **whose(name, names),
        "parameters": parameters,
        "covariance": numbers(covariance),
        "covariance_clustered": None,
        "condition_number": number(condition_number(covariance)),
        "initial": start,
        "log_likelihood": own["log_likelihood"],
        "log_likelihood_initial": own["log_likelihood_typical"],
        "log_likelihood_uniform": own["log_likelihood_uniform"],
        "demonstrations": list(own["demonstrations"]),
        "participants": [name],
        "steps": own["steps"],
        "iterations": 1,
        "search": {
            "log_likelihood": [own["log_likelihood_typical"], own["log_likelihood"]],
            "theta": [list(start.values()), [one["value"] for one in parameters]],
        },
        "reach": None,
        "intervals": [
            {"method": Kind.POSTERIOR.value, "errors": Errors.MODEL.value, "level": LEVEL, "parameters": ends}
        ],
    }


def _own_parameters(
    own: Mapping[str, Any], content: Mapping[str, Any], path: str
) -> tuple[list[dict[str, Any]], FloatArray]:
    """A person's parameters in the form of a fit's, and their covariance; not known where people do not differ.

    Raises:
        ArtefactError: Names or sizes differ, or an interval ends below its start.
    """
    parameters = [_merged(one, typical, own, path) for one, typical in _pairs(own, content, path)]
    where = f"{path}: population/persons/{own['name']}/covariance"
    covariance = _square(own["covariance"], len(parameters), where)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    varying = {one["name"] for one in content["population"]["parameters"]}
    held = np.array([one["name"] not in varying for one in parameters])
    covariance[held] = covariance[:, held] = errors[held] = np.nan
    for one, error in zip(parameters, errors, strict=True):
        one["standard_error"] = number(error)
    return parameters, covariance


def for_person(content: Mapping[str, Any], name: str, path: str) -> dict[str, Any]:
    """What a reward file's content says about a person beforehand: the own reward, or for a new person all of it.

    Raises:
        ArtefactError: The file holds one reward for all.
    """
    known = name in names_of_persons(content) or not names_of_persons(content)
    return of_person(content, name, path) if known else dict(content)


def _pairs(
    own: Mapping[str, Any], content: Mapping[str, Any], path: str
) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """A person's parameters with the typical ones.

    Raises:
        ArtefactError: The names differ.
    """
    names, found = ([one["name"] for one in some["parameters"]] for some in (content, own))
    if names != found:
        raise ArtefactError(
            f"{path}: parameters of {own['name']}: expected {', '.join(names)}, found {', '.join(found)}"
        )
    return list(zip(own["parameters"], content["parameters"], strict=True))


def _merged(one: Mapping[str, Any], typical: Mapping[str, Any], own: Mapping[str, Any], path: str) -> dict[str, Any]:
    """A person's parameter in the form of a fit's.

    Raises:
        ArtefactError: The interval ends below its start.
    """
    if one["lower"] > one["upper"]:
        raise ArtefactError(
            f"{path}: the interval of {one['name']} of {own['name']} ends at {one['upper']:g}, below its start "
            f"{one['lower']:g}"
        )
    return {
        **typical,
        "value": one["value"],
        "standard_error_clustered": None,
        "bias_subtracted": None,
        "bias_expected": None,
    }
