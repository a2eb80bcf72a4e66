"""Metrics of paths as a file: what ``navirl evaluate`` writes."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from navirl_cli.artefacts.store import number, read_json
from navirl_cli.evaluation.compare import DRIVEN, Comparison
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import GroupMetrics, Measured, quantiles_of
from navirl_cli.evaluation.metric import Metric, Values
from navirl_cli.evaluation.paired import Interval, Paired
from navirl_cli.evaluation.ranks import Ranking, by_group_and_training
from navirl_cli.files import Input

#: Two groups and their comparison by metric.
Pairs = Sequence[tuple[str, str, Mapping[str, Paired]]]


def metrics_document(
    result: Comparison,
    pairs: Pairs,
    ranked: Ranking,
    metrics: Sequence[Metric],
    inputs: Sequence[Input],
    precision: Precision,
    seed: int,
    quantiles: Sequence[float] = (),
) -> dict[str, Any]:
    """The content of a metrics file.

    Args:
        result: Metrics by group.
        pairs: Comparisons of groups.
        ranked: Ranks of demonstrations; empty if they were not asked for.
        metrics: That were asked for.
        inputs: The files that it was made from.
        precision: How many paths were drawn.
        seed: Of what was drawn by chance.
        quantiles: Shares that were asked for.
    """
    names = [metric.name for metric in metrics]
    learnt = any(row.error for row in result.groups)
    return {
        "inputs": [vars(one) for one in inputs],
        "samples": precision.samples if learnt else 0,
        "precision": precision.error,
        "seed": seed,
        "metrics": names,
        "missing": result.missing,
        "groups": [_group(row, names) for row in result.groups],
        "demonstrations": [_demonstration(row, names) for row in result.rows],
        "pairs": [
            {"group": one, "minus": other, "metrics": {name: _pair(value) for name, value in found.items()}}
            for one, other, found in pairs
        ],
        "ranks": None if not ranked.ranks else _ranks(ranked),
        **({"quantiles": _quantiles(result, names, quantiles)} if quantiles else {}),
    }


def _quantiles(result: Comparison, names: Sequence[str], shares: Sequence[float]) -> list[dict[str, Any]]:
    """Quantiles over the demonstrations of each group, by type of path."""
    return [
        {
            "group": own.group,
            "path_type": own.path_type,
            "count": own.count,
            "share": share,
            "metrics": _chosen(values, names),
        }
        for own in quantiles_of(result.rows, names, shares)
        for share, values in own.values.items()
    ]


def read_metrics(path: Path) -> dict[str, Any]:
    """Read a metrics file; one of version 1 as the present version holds the same.

    Raises:
        ArtefactError: The file is missing, no metrics file, or breaks its schema.
    """
    return read_json(path, "metrics")


def _group(row: GroupMetrics, names: Sequence[str]) -> dict[str, Any]:
    """One group's paths of one type."""
    drawn = {"monte_carlo_error": _chosen(row.error, names), "exact": _chosen(row.exact, names)}
    measured = {"participants": row.participants, "half_interval": _chosen(row.half_interval, names)}
    return {
        "group": row.group,
        "path_type": row.path_type,
        "count": row.count,
        "mean": _chosen(row.mean, names),
        "standard_deviation": _chosen(row.std, names),
        **(drawn if row.error else measured),
        "missing": {name: dict(reasons) for name, reasons in row.missing.items()},
    }


def _demonstration(row: Measured, names: Sequence[str]) -> dict[str, Any]:
    """One demonstration as it was driven."""
    return {
        "id": row.id,
        "participant": row.participant,
        "group": row.group,
        "path_type": DRIVEN,
        "metrics": _chosen(row.values[DRIVEN], names),
        "missing": dict(row.missing.get(DRIVEN, {})),
    }


def _chosen(values: Values, names: Iterable[str]) -> dict[str, float | None]:
    """Values in the order of the names; null for those that do not exist."""
    return {name: number(values[name]) for name in names if name in values}


def _pair(one: Paired) -> dict[str, Any]:
    """One comparison of two groups."""
    return {
        "mean_difference": one.mean,
        **_interval("student", one.student),
        **_interval("bootstrap", one.bootstrap),
        "n": one.n,
        "wilcoxon_p": number(one.wilcoxon_p),
        **({} if one.holm_p is None else {"holm_p": number(one.holm_p)}),
        "cohen_dz": number(one.cohen_dz),
        "rank_biserial": number(one.rank_biserial),
        "by_participant": dict(one.differences),
    }


def _interval(name: str, interval: Interval | None) -> dict[str, float | None]:
    """Lower and upper end; null for an interval that does not exist."""
    ends = interval or (float("nan"), float("nan"))
    return {f"{name}_{end}": number(value) for end, value in zip(("lower", "upper"), ends, strict=True)}


def _ranks(ranked: Ranking) -> dict[str, Any]:
    """Ranks and their test by group."""
    groups = []
    for own in by_group_and_training(ranked.ranks):
        statistic, p_value = own.uniformity()
        groups.append(
            {
                "group": own.group,
                "held_out": own.held_out,
                "count": len(own.ranks),
                "statistic": statistic,
                "p_value": p_value,
            }
        )
    return {
        "groups": groups,
        "not_ranked": dict(ranked.not_ranked),
        "demonstrations": [
            {
                "id": one.id,
                "group": one.group,
                "log_likelihood": number(one.log_likelihood),
                "rank": one.rank,
                "distance_rank": one.distance_rank,
                "area_rank": one.area_rank,
                "held_out": one.held_out,
                "fits_badly": one.fits_badly,
            }
            for one in ranked.ranks
        ],
    }
