"""Every number of a study's report as JSON."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from navirl_cli.artefacts.analyses import intervals_document
from navirl_cli.artefacts.store import number, read_json
from navirl_cli.evaluation.compare import DRIVEN, ON_GRID
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metric import Values
from navirl_cli.irl.fit import Fit
from navirl_cli.study.claims import Claim
from navirl_cli.study.learning import Closeness, CycleFit, Learnt
from navirl_cli.study.pipeline import PUBLISHED_PARTICIPANTS, PUBLISHED_THETA, Study
from navirl_cli.study.questionnaire import Shares


def study_document(study: Study, cells: Sequence[tuple[str, bool]], answers: Sequence[Shares]) -> dict[str, Any]:
    """The content of a study's summary.

    Args:
        study: The study.
        cells: Published paths, and whether our cells are the same; empty without published paths.
        answers: To the questionnaire; empty without one.
    """
    return {
        "participants": {one.participant: _learnt(one) for one in study.participants},
        "pooled": _learnt(study.pooled),
        "metrics": _properties(study.groups),
        "claims": [_claim(one) for one in study.claims],
        "completion_s": {
            modality: {participant: list(times) for participant, times in known.items()}
            for modality, known in study.completion_s.items()
        },
        "published": _published(study, cells) if cells else None,
        "answers": [
            {
                "question": one.question,
                "modality": one.modality,
                "n": one.count,
                "median": number(one.median),
                "counts": one.counts.tolist(),
            }
            for one in answers
        ],
        "demonstrations": [
            {
                "id": row.id,
                "participant": row.participant,
                "group": row.group,
                "metrics": _numbers(row.values[DRIVEN]),
                "metrics_on_grid": _numbers(row.values[ON_GRID]),
                "missing": dict(row.missing[DRIVEN]),
                "missing_on_grid": dict(row.missing[ON_GRID]),
            }
            for row in study.rows
        ],
    }


def read_study(path: Path) -> dict[str, Any]:
    """Read a study's summary.

    Raises:
        ArtefactError: The file is missing, no summary of a study, or breaks its schema.
    """
    return read_json(path, "study")


def _numbers(values: Values) -> dict[str, float | None]:
    """Values by metric; null where one does not exist."""
    return {name: number(value) for name, value in values.items()}


def _learnt(learnt: Learnt) -> dict[str, Any]:
    """The reward after the second cycle, and after the first."""
    return {**_cycle(learnt.second), "first_cycle": _cycle(learnt.first), "problems": list(learnt.problems)}


def _cycle(found: CycleFit | None) -> dict[str, Any]:
    """One cycle's fit and how near its paths come to the second cycle's; nulls if the cycle is missing."""
    if found is None:
        return dict.fromkeys(
            (
                "theta",
                "standard_errors",
                "standard_errors_clustered",
                "intervals",
                "status",
                "log_likelihood",
                "steps",
                "demonstrations",
                "paths",
            )
        )
    intervals = [intervals_document(one) for one in found.intervals]
    return {**_fit(found.fit), "intervals": intervals, "paths": None if found.near is None else _closeness(found.near)}


def _fit(fit: Fit) -> dict[str, Any]:
    names = [parameter.name for parameter in fit.reward.parameters]
    return {
        "theta": dict(zip(names, fit.reward.theta, strict=True)),
        "standard_errors": _by_name(names, fit.standard_errors.tolist()),
        "standard_errors_clustered": None
        if fit.clustered_errors is None
        else _by_name(names, fit.clustered_errors.tolist()),
        "status": fit.status.value,
        "log_likelihood": fit.log_likelihood,
        "steps": fit.steps,
        "demonstrations": fit.demonstrations,
    }


def _by_name(names: Iterable[str], values: Iterable[float]) -> dict[str, float | None]:
    return {name: number(value) for name, value in zip(names, values, strict=True)}


def _closeness(near: Closeness) -> dict[str, Any]:
    """Properties expected under the policy beside the demonstrated ones, on the grid."""
    shown, learnt = near.demonstrated, near.learnt
    return {
        "demonstrated": _numbers(shown.mean),
        "demonstrated_standard_deviation": _numbers(shown.std),
        "expected": _numbers({name: learnt.expected(name) for name in learnt.mean}),
        "standard_deviation": _numbers(learnt.std),
        "monte_carlo_error": _numbers({name: learnt.monte_carlo_error(name) for name in learnt.mean}),
    }


def _properties(rows: Iterable[GroupMetrics]) -> dict[str, Any]:
    """Mean and standard deviation of each property over the paths of each group."""
    found: dict[str, dict[str, Any]] = {}
    for row in rows:
        group = found.setdefault(row.group, {"count": row.count, "participants": row.participants})
        suffix = "" if row.path_type == DRIVEN else "_on_grid"
        group[f"missing{suffix}"] = {name: dict(reasons) for name, reasons in row.missing.items()}
        group["driven" if row.path_type == DRIVEN else "on_grid"] = {
            name: {"mean": number(mean), "standard_deviation": number(row.std[name])} for name, mean in row.mean.items()
        }
    return found


def _claim(claim: Claim) -> dict[str, Any]:
    return {
        "claim": claim.text,
        "question": claim.question,
        "verdict": claim.verdict.value,
        "differences": [
            {
                "quantity": one.quantity,
                "unit": one.unit,
                "mean": one.paired.mean,
                "n": one.paired.n,
                "student_lower": number(one.paired.student.lower),
                "student_upper": number(one.paired.student.upper),
                "by_participant": dict(one.paired.differences),
                "margin": None if one.margin is None else number(one.margin),
                "participants_against": one.against,
                "verdict": one.verdict.value,
            }
            for one in claim.differences
        ],
    }


def _published(study: Study, cells: Sequence[tuple[str, bool]]) -> dict[str, Any]:
    """How the results compare with what was published."""
    return {
        "paths": len(cells),
        "cells_equal": sum(same for _, same in cells),
        "cells_other": sorted(name for name, same in cells if not same),
        "theta": PUBLISHED_THETA,
        "theta_participants": PUBLISHED_PARTICIPANTS,
        "log_likelihood_at_theta": study.published_log_likelihood,
    }
