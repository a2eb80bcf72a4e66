"""Every number of a study's report as JSON."""

from collections.abc import Iterable, Sequence
from typing import Any

from navirl_cli.artefacts.store import number
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metrics import PAPER_METRICS, Values
from navirl_cli.irl.fit import Fit
from navirl_cli.study.claims import Claim
from navirl_cli.study.learning import Closeness, CycleFit, Learnt
from navirl_cli.study.measures import GroupProperties
from navirl_cli.study.pipeline import PUBLISHED_PARTICIPANTS, PUBLISHED_THETA, Study
from navirl_cli.study.questionnaire import Shares


def study_document(study: Study, cells: Sequence[tuple[str, bool]], answers: Sequence[Shares]) -> dict[str, Any]:
    """The content of a study's summary.

    Args:
        study: The study.
        cells: Published paths, and whether our cells are the same; empty where none were published.
        answers: To the questionnaire; none where there is none.
    """
    return {
        "participants": {one.participant: _learnt(one) for one in study.participants},
        "pooled": _learnt(study.pooled),
        "metrics": {one.group: _properties(one) for one in study.groups},
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
                "group": row.group,
                "metrics": _metrics(row.driven) | {"min_center_distance_m": number(row.center_distance_m)},
                "metrics_on_grid": _metrics(row.on_grid),
                "onset_m": number(row.onset_m),
            }
            for row in study.rows
        ],
    }


def _metrics(values: Values) -> dict[str, float | None]:
    """The paper's three."""
    return {metric.name: number(values[metric.name]) for metric in PAPER_METRICS}


def _learnt(learnt: Learnt) -> dict[str, Any]:
    """The reward after the second cycle, and after the first."""
    return {**_cycle(learnt.second), "first_cycle": _cycle(learnt.first), "trouble": list(learnt.trouble)}


def _cycle(found: CycleFit | None) -> dict[str, Any]:
    """One cycle's fit and how near its paths come to the second cycle's; nulls where there is none."""
    if found is None:
        return dict.fromkeys(
            (
                "theta",
                "standard_errors",
                "standard_errors_clustered",
                "status",
                "log_likelihood",
                "steps",
                "demonstrations",
                "paths",
            )
        )
    return {**_fit(found.fit), "paths": None if found.near is None else _closeness(found.near)}


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
    return {
        "demonstrated": _metrics(near.demonstrated),
        "demonstrated_standard_deviation": _metrics(near.demonstrated_spread),
        "expected": _metrics(near.expected),
        "standard_deviation": _metrics(near.spread),
        "monte_carlo_error": _metrics(near.error),
    }


def _properties(group: GroupProperties) -> dict[str, Any]:
    """Mean and standard deviation of each property over the group's paths."""
    means = _mean_and_spread(group.driven)
    for name, (mean, spread) in (
        ("min_center_distance_m", group.center_distance_m),
        ("onset_m", group.onset_m),
    ):
        means[name] = {"mean": number(mean), "standard_deviation": number(spread)}
    return {
        "paths": group.driven.count,
        "participants": group.participants,
        "driven": means,
        "on_grid": _mean_and_spread(group.on_grid),
    }


def _mean_and_spread(metrics: GroupMetrics) -> dict[str, dict[str, float | None]]:
    mean, spread = _metrics(metrics.mean), _metrics(metrics.std)
    return {name: {"mean": mean[name], "standard_deviation": spread[name]} for name in mean}


def _claim(claim: Claim) -> dict[str, Any]:
    return {
        "claim": claim.text,
        "asked": claim.asked,
        "verdict": claim.verdict.value,
        "differences": [
            {
                "of": one.what,
                "unit": one.unit,
                "mean": one.mean,
                "lower": number(one.lower),
                "upper": number(one.upper),
                "by_participant": dict(one.values),
                "margin": None if one.margin is None else number(one.margin),
                "against": one.against,
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
