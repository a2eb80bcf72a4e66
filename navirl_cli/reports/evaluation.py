"""What ``navirl evaluate`` prints and writes."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from navirl_cli.artefacts.store import number
from navirl_cli.documents.tables import Column, Format, Table, formatted
from navirl_cli.evaluation.compare import DRIVEN, KINDS, Comparison
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metrics import METRICS, Metric, Values
from navirl_cli.evaluation.paired import Paired
from navirl_cli.evaluation.ranks import Rank, uniformity
from navirl_cli.files import Input

#: Two groups and their comparison by metric.
Pairs = Sequence[tuple[str, str, Mapping[str, Paired]]]
#: More metrics stand below each other.
MOST_COLUMNS = 6


def metrics_table() -> Table:
    """All metrics, one a row."""
    columns = tuple(map(Column, ("name", "unit", "paths", "needs", "definition", "source")))
    rows = tuple((m.name, m.unit, m.paths, ", ".join(m.needs), m.definition, m.source) for m in METRICS)
    return Table(columns, rows)


def tables(result: Comparison, pairs: Pairs, ranks: Sequence[Rank], metrics: Sequence[Metric], how: Format) -> str:
    """Everything as text.

    Args:
        result: Metrics by group.
        pairs: Comparisons.
        ranks: Of demonstrations.
        metrics: That were asked for.
        how: The format; CSV holds the groups only, with one number a column.
    """
    if how is Format.CSV:
        return _groups_csv(result, metrics)
    wide = len(metrics) <= MOST_COLUMNS
    parts = [formatted(*_groups(result, metrics), how)] if wide else _by_metric(result, metrics, how)
    driven = [
        row for row in result.groups if row.kind == DRIVEN and np.isfinite(list(row.half_interval.values())).any()
    ]
    if driven and wide:
        parts += [
            "95 % intervals of the means of driven paths, over participants",
            formatted(*_intervals(driven, metrics), how),
        ]
    for one, other, found in pairs:
        parts += [f"{one} less {other}, driven paths, paired by participant", formatted(*_paired(found, metrics), how)]
    if ranks:
        parts += [uniform_line(ranks), formatted(*_ranks(ranks), how)]
    if how is Format.TEXT:
        parts.append("\n".join(_legend(result, metrics)))
    return "\n\n".join(parts)


def _groups(result: Comparison, metrics: Sequence[Metric]) -> tuple[list[str], list[list[str]]]:
    """Mean and spread by group and kind of path."""
    header = ["group", "paths", "n", *(metric.heading for metric in metrics)]
    rows = [
        [row.group, row.kind, str(row.count), *(_mean_and_spread(row, metric.name) for metric in metrics)]
        for row in result.groups
    ]
    return header, rows


def group_table(result: Comparison, metrics: Sequence[Metric]) -> Table:
    """Mean and spread by group and kind of path, for a report."""
    header, rows = _groups(result, metrics)
    return Table.of_texts(tuple(header), tuple(map(tuple, rows)), "Mean ± standard deviation.")


def _by_metric(result: Comparison, metrics: Sequence[Metric], how: Format) -> list[str]:
    """A table for each group, with a row for each metric that has values in it."""
    parts = []
    for group in dict.fromkeys(row.group for row in result.groups):
        kinds = [row for row in result.groups if row.group == group]
        told = [metric for metric in metrics if any(isfinite(row.mean.get(metric.name, float("nan"))) for row in kinds)]
        rows = [[metric.heading, *(_mean_and_spread(row, metric.name) for row in kinds)] for metric in told]
        parts += [f"{group}, n = {kinds[0].count}", formatted(["metric", *(row.kind for row in kinds)], rows, how)]
    return parts


def _mean_and_spread(row: GroupMetrics, name: str) -> str:
    mean, spread = row.exact.get(name, row.mean.get(name, float("nan"))), row.std.get(name, float("nan"))
    if not isfinite(mean):
        return "-"
    return f"{mean:.3f}" + (f" ± {spread:.3f}" if isfinite(spread) else "")


def _intervals(driven: Sequence[GroupMetrics], metrics: Sequence[Metric]) -> tuple[list[str], list[list[str]]]:
    """From where to where the mean of each group lies."""
    rows = []
    for row in driven:
        edges = [(row.mean.get(m.name, np.nan), row.half_interval.get(m.name, np.nan)) for m in metrics]
        cells = [f"{mean - half:.3f} to {mean + half:.3f}" if isfinite(half) else "-" for mean, half in edges]
        rows.append([row.group, *cells])
    return ["group", *(metric.heading for metric in metrics)], rows


def _groups_csv(result: Comparison, metrics: Sequence[Metric]) -> str:
    """The same with a column for each number."""
    parts = ("mean", "std", "half_interval", "error", "exact")
    header = ["group", "paths", "n", *(f"{metric.name}_{part}" for metric in metrics for part in parts)]
    rows = []
    for row in result.groups:
        numbers = [
            values.get(metric.name, float("nan"))
            for metric in metrics
            for values in (row.mean, row.std, row.half_interval, row.error, row.exact)
        ]
        rows.append([row.group, row.kind, str(row.count), *(f"{n:.6g}" if isfinite(n) else "" for n in numbers)])
    return formatted(header, rows, Format.CSV)


def _paired(found: Mapping[str, Paired], metrics: Sequence[Metric]) -> tuple[list[str], list[list[str]]]:
    """Differences by metric."""
    header = ["metric", "mean difference", "95 % interval", "n", "p (Wilcoxon)", "Cohen's d_z", "rank-biserial r"]
    rows = []
    for metric in metrics:
        if metric.name not in found:
            continue
        one = found[metric.name]
        lower, upper = one.bootstrap or (np.nan, np.nan)
        interval = f"{lower:+.3f} to {upper:+.3f}" if isfinite(lower) else "-"
        sizes = [
            f"{value:.3g}" if isfinite(value) else "-" for value in (one.wilcoxon_p, one.cohen_dz, one.rank_biserial)
        ]
        rows.append([metric.heading, f"{one.mean:+.3f}", interval, str(one.n), *sizes])
    return header, rows


def uniform_line(ranks: Sequence[Rank]) -> str:
    """What ranks say of a model, in a line."""
    statistic, p_value = uniformity(ranks)
    return (
        f"ranks of {len(ranks)} demonstrations among the policy's paths; a calibrated model gives uniform ranks: "
        f"Kolmogorov-Smirnov D = {statistic:.3f}, p = {p_value:.3g}"
    )


def _ranks(ranks: Sequence[Rank]) -> tuple[list[str], list[list[str]]]:
    """Rank by demonstration."""
    header = ["demonstration", "group", "log-likelihood", "rank"]
    return header, [[one.id, one.group, f"{one.log_likelihood:.3f}", f"{one.rank:.3f}"] for one in ranks]


def _legend(result: Comparison, metrics: Sequence[Metric]) -> list[str]:
    """What the words mean."""
    kinds = dict.fromkeys(row.kind.partition(", ")[0] if row.kind not in KINDS else row.kind for row in result.groups)
    learnt = [row for row in result.groups if row.error]
    lines = ["mean ± standard deviation over n paths; of learnt paths of one path, over n demonstrations' scenes"]
    lines += [f"{metric.label}: {metric.definition}" for metric in metrics]
    lines += [f"{kind}: {KINDS[kind]}" for kind in KINDS if kind in kinds]
    errors = [
        row.error[m.name] / row.std[m.name]
        for row in learnt
        for m in metrics
        if row.std.get(m.name) and m.name not in row.exact
    ]
    if errors:
        lines.append(f"Monte Carlo error of learnt paths' means: at most {max(errors):.2g} of their standard deviation")
    return lines


def document(
    result: Comparison,
    pairs: Pairs,
    ranks: Sequence[Rank],
    metrics: Sequence[Metric],
    inputs: Sequence[Input],
    precision: Precision,
    seed: int,
) -> dict[str, Any]:
    """The content of a metrics file."""
    names = [metric.name for metric in metrics]
    learnt = any(row.error for row in result.groups)
    return {
        "inputs": [vars(one) for one in inputs],
        "samples": precision.samples if learnt else 0,
        "precision": precision.error,
        "seed": seed,
        "groups": [
            {
                "group": row.group,
                "paths": row.kind,
                "count": row.count,
                "mean": _chosen(row.mean, names),
                "standard_deviation": _chosen(row.std, names),
                **(
                    {"error": _chosen(row.error, names), "exact": _chosen(row.exact, names)}
                    if row.error
                    else {"half_interval": _chosen(row.half_interval, names)}
                ),
            }
            for row in result.groups
        ],
        "demonstrations": [
            {"id": row.id, "group": row.group, "paths": DRIVEN, "metrics": _chosen(row.values[DRIVEN], names)}
            for row in result.rows
        ],
        "pairs": [
            {"group": one, "less": other, "metrics": {name: _pair(value) for name, value in found.items()}}
            for one, other, found in pairs
        ],
        "ranks": None if not ranks else _ranks_document(ranks),
    }


def _chosen(values: Values, names: Sequence[str]) -> dict[str, float | None]:
    """Values asked for, for JSON, which knows no NaN."""
    return {name: number(values[name]) for name in names if name in values}


def _pair(one: Paired) -> dict[str, Any]:
    lower, upper = one.bootstrap or (np.nan, np.nan)
    return {
        "mean_difference": one.mean,
        "lower": number(lower),
        "upper": number(upper),
        "n": one.n,
        "p_value": number(one.wilcoxon_p),
        "cohen_dz": number(one.cohen_dz),
        "rank_biserial": number(one.rank_biserial),
        "by_participant": dict(one.differences),
    }


def _ranks_document(ranks: Sequence[Rank]) -> dict[str, Any]:
    statistic, p_value = uniformity(ranks)
    return {
        "statistic": statistic,
        "p_value": p_value,
        "demonstrations": [
            {"id": one.id, "group": one.group, "log_likelihood": number(one.log_likelihood), "rank": one.rank}
            for one in ranks
        ],
    }
