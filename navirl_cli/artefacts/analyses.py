"""Bootstrap, profile likelihoods and cross-validation in reward files."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from navirl_cli.artefacts.store import number, numbers, row
from navirl_cli.errors import ArtefactError
from navirl_cli.irl.intervals import Ends, Errors, Intervals, Kind
from navirl_cli.irl.profile import Profile

if TYPE_CHECKING:  # a reader of rewards does not draw again or leave out
    from navirl_cli.evaluation.reach import ReachEffect
    from navirl_cli.irl.bootstrap import Bootstrap
    from navirl_cli.irl.validation import Validation


def bootstrap_document(found: "Bootstrap") -> dict[str, Any]:
    """Bootstrap draws with their standard errors and 95 % intervals."""
    lower, upper = found.interval()
    return {
        "seed": found.seed,
        "failed": found.failed,
        "identified_draws": found.identified_draws.tolist(),
        "stopped_early": found.stopped_early,
        "standard_errors": numbers(found.standard_errors),
        "lower": numbers(lower),
        "upper": numbers(upper),
        "interval": "bca",
        "accelerated": found.accelerated.tolist(),
        "theta": numbers(found.theta),
    }


def intervals_document(found: Intervals) -> dict[str, Any]:
    """The intervals of all parameters."""
    return {
        "method": found.kind.value,
        "errors": found.errors.value,
        "level": found.level,
        "parameters": [{"name": one.parameter, "lower": one.lower, "upper": one.upper} for one in found.ends],
    }


def intervals_of(document: dict[str, Any], names: Sequence[str], path: str) -> Intervals:
    """Intervals read back; arguments as of :func:`profile_of`.

    Raises:
        ArtefactError: A parameter is unknown, or the ends are in the wrong order.
    """
    ends = []
    for one in document["parameters"]:
        lower, upper = one["lower"], one["upper"]
        if one["name"] not in names:
            raise ArtefactError(f"{path}: intervals: expected one of {', '.join(names)}, found {one['name']}")
        if lower is not None and upper is not None and lower > upper:
            raise ArtefactError(f"{path}: the interval of {one['name']} ends at {upper:g}, below its start {lower:g}")
        ends.append(Ends(one["name"], lower, upper))
    return Intervals(Kind(document["method"]), Errors(document["errors"]), document["level"], tuple(ends))


def profile_document(found: Profile) -> dict[str, Any]:
    """A profile likelihood with its interval."""
    return {
        "parameter": found.name,
        "level": found.level,
        "lower": found.lower,
        "upper": found.upper,
        "values": numbers(found.values),
        "relative_log_likelihood": numbers(found.relative),
        "theta": numbers(found.theta),
    }


def profile_of(document: dict[str, Any], names: Sequence[str], path: str) -> Profile:
    """A profile read back.

    Args:
        document: Its part of the file.
        names: The reward's parameters.
        path: The file, for messages.

    Raises:
        ArtefactError: Its parameter is unknown, or its lists do not fit each other.
    """
    name = document["parameter"]
    if name not in names:
        raise ArtefactError(f"{path}: profiles: expected one of {', '.join(names)}, found a profile of {name}")
    values = row(document["values"])
    relative = row(document["relative_log_likelihood"])
    theta = [row(one) for one in document["theta"]]
    ascends = np.isfinite(values).all() and np.isfinite(relative).all() and (np.diff(values) > 0).all()
    fits = len(values) == len(relative) == len(theta) > 1 and all(len(one) == len(names) for one in theta)
    if not (ascends and fits):
        raise ArtefactError(
            f"{path}: the profile of {name} needs ascending values, with a likelihood and parameters for each"
        )
    return Profile(name, values, relative, np.array(theta), document["level"], document["lower"], document["upper"])


def validation_document(found: "Validation") -> dict[str, Any]:
    """Cross-validation by participant left out."""
    return {
        "left_out": list(found.participants),
        "steps": found.steps.tolist(),
        "statuses": [status.value for status in found.statuses],
        "models": {
            model: {
                "log_likelihood": numbers(values),
                "log_likelihood_per_step": number(found.per_step(model)),
                "parameter_count": found.sizes[model],
            }
            for model, values in found.log_likelihoods.items()
        },
        "features": {
            parameter.name: {
                "demonstrated": numbers(found.demonstrated[:, j]),
                "expected": numbers(found.expected[:, j]),
                "mismatch_standard_errors": numbers(found.mismatch[:, j]),
                "identified": found.identified[:, j].tolist(),
            }
            for j, parameter in enumerate(found.parameters)
        },
    }


def reach_document(found: "ReachEffect") -> dict[str, Any]:
    """All steps beside those within reach."""
    return {
        "reach_m": found.reach.reach_m,
        "seen_in": found.reach.seen_in,
        "steps_reachable": found.steps_reachable,
        "steps_all": found.steps_all,
        "min_distance_all_m": found.min_distance_all_m,
        "min_distance_reachable_m": found.min_distance_reachable_m,
    }
