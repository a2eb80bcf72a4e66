"""What ``navirl evaluate`` prints."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from navirl_cli.artefacts.metrics import Pairs
from navirl_cli.artefacts.store import write_json
from navirl_cli.documents.tables import ENDINGS, Cell, Column, Format, Interval, Spread, Table, written
from navirl_cli.evaluation.compare import DRIVEN, LEARNT, PATH_TYPES, Comparison
from navirl_cli.evaluation.groups import GroupMetrics, quantiles_of
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.metrics import METRICS
from navirl_cli.evaluation.paired import FEWEST, TESTED, Paired
from navirl_cli.evaluation.ranks import Ranking
from navirl_cli.files import replacing
from navirl_cli.reports.ranks import group_ranks_table, rank_lines, rank_table

#: More metrics are written below each other.
MOST_COLUMNS = 6
#: Digits after the point of metrics.
DECIMALS = 3


def metrics_table() -> Table:
    """All metrics, one a row."""
    columns = tuple(map(Column, ("name", "unit", "paths", "needs", "definition", "source")))
    rows = tuple((m.name, m.unit, m.paths, ", ".join(m.needs), m.definition, m.source) for m in METRICS)
    return Table(columns, rows)


def evaluation_text(
    result: Comparison,
    pairs: Pairs,
    ranked: Ranking,
    metrics: Sequence[Metric],
    how: Format,
    *,
    quantiles: Sequence[float] = (),
) -> str:
    """Everything in one format.

    Args:
        result: Metrics by group.
        pairs: Comparisons of groups.
        ranked: Ranks of demonstrations.
        metrics: That were asked for.
        how: The format; CSV holds the groups only, with one number a column.
        quantiles: Shares that were asked for.
    """
    if how is Format.CSV:
        return written(_numbers(result, metrics), how)
    wide = len(metrics) <= MOST_COLUMNS
    tables = [
        *(_side_by_side(result, metrics) if wide else _below_each_other(result, metrics)),
        *([_intervals(result, metrics)] if wide else []),
        *([_quantiles(result, metrics, quantiles)] if quantiles else []),
        *(_paired(one, other, found, metrics) for one, other, found in pairs),
        *([group_ranks_table(ranked.ranks), rank_table(ranked.ranks)] if ranked.ranks else []),
    ]
    parts = [written(table, how) for table in tables if table is not None]
    left_out = _gathered((result.missing[m.name], m.label) for m in metrics if m.name in result.missing)
    missing = "\n".join(f"Left out: {', '.join(labels)}: {reason}." for reason, labels in left_out.items())
    legend = "\n".join(_legend(result, metrics)) if how is Format.TEXT else ""
    said = "\n".join(f"{line[0].upper()}{line[1:]}." for line in rank_lines(ranked))
    return "\n\n".join(filter(None, [*parts, said, missing, legend]))


def write_evaluation(
    path: Path, document: Mapping[str, Any], text: Callable[[Format], str], *, force: bool = False
) -> None:
    """Write results in the format of a file's ending.

    Args:
        path: The file, with one of ENDINGS.
        document: The content of a metrics file.
        text: Everything in another format.
        force: Replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    how = ENDINGS[path.suffix.lower()]
    if how is Format.JSON:
        write_json(path, "metrics", document, force=force)
        return
    with replacing(path, force=force) as temporary:
        temporary.write_text(text(how) + "\n", encoding="utf-8", newline="")


def group_table(groups: Sequence[GroupMetrics], metrics: Sequence[Metric], caption: str = "") -> Table:
    """Mean and standard deviation by group and type of path.

    Args:
        groups: The rows.
        metrics: The columns; rows without any of them are left out.
        caption: Stands above.
    """
    columns = [
        Column("group"),
        Column("path_type", "paths"),
        Column("n"),
        *(Column(metric.name, metric.heading, DECIMALS) for metric in metrics),
    ]
    rows: list[tuple[Cell, ...]] = [
        (row.group, row.path_type, row.count, *(_cell(row, metric) for metric in metrics))
        for row in groups
        if any(metric.name in row.mean for metric in metrics)
    ]
    return Table(tuple(columns), tuple(rows), caption, _missing_note(groups, metrics))


def _missing_note(rows: Sequence[GroupMetrics], metrics: Sequence[Metric]) -> str:
    """Why values are missing: each reason with the metrics that it concerns and the groups."""
    groups = dict.fromkeys(row.group for row in rows)
    found = [
        (reason, where, metric.label)
        for group in groups
        for metric in metrics
        for reason, where in _missing_in([row for row in rows if row.group == group], metric.name)
    ]
    labels = _gathered(((reason, where), label) for reason, where, label in found)
    places = _gathered(((reason, ", ".join(own)), where) for (reason, where), own in labels.items())
    parts = [
        f"{own} ({reason})" + ("" if where == list(groups) else f" in {' / '.join(where)}")
        for (reason, own), where in places.items()
    ]
    return f"Missing: {'; '.join(parts)}." if parts else ""


def _missing_in(rows: Sequence[GroupMetrics], name: str) -> Iterable[tuple[str, str]]:
    """Reasons for which a group lacks values of a metric, and where: the group, types of paths unless it is all."""
    having = [row for row in rows if name in row.mean]
    path_types = _gathered(
        ((reason, count, row.count), row.path_type)
        for row in having
        for reason, count in row.missing.get(name, {}).items()
    )
    for (reason, count, of), own in path_types.items():
        types = "" if len(own) == len(having) else f", {', '.join(own)}"
        yield reason, f"{rows[0].group}{types}" + ("" if count == of else f": {count} of {of}")


Key = TypeVar("Key")


def _gathered(items: Iterable[tuple[Key, str]]) -> dict[Key, list[str]]:
    """Texts by key, in the order in which they come."""
    found: dict[Key, list[str]] = {}
    for key, text in items:
        found.setdefault(key, []).append(text)
    return found


def _side_by_side(result: Comparison, metrics: Sequence[Metric]) -> list[Table]:
    """A table of the metrics of all paths, and one each of those of driven and of learnt paths only."""
    parts = [[metric for metric in metrics if metric.paths == paths] for paths in ("all", "driven", "learnt")]
    return [table for part in parts if part and (table := group_table(result.groups, part)).rows]


def _below_each_other(result: Comparison, metrics: Sequence[Metric]) -> list[Table]:
    """For each group the same tables, transposed: a row for each metric, a column for each type of path."""
    tables = []
    for group in dict.fromkeys(row.group for row in result.groups):
        caption = f"{group}, n = {next(row.count for row in result.groups if row.group == group)}"
        for paths in ("all", "driven", "learnt"):
            part = [metric for metric in metrics if metric.paths == paths]
            rows = [row for row in result.groups if row.group == group and any(m.name in row.mean for m in part)]
            if part and rows:
                columns = (Column("metric"), *(Column(row.path_type, decimals=DECIMALS) for row in rows))
                cells: list[tuple[Cell, ...]] = [(m.heading, *(_cell(row, m) for row in rows)) for m in part]
                own = caption if paths == "all" else f"{group}, {paths} paths only"
                tables.append(Table(columns, tuple(cells), own, _missing_note(rows, part)))
    return tables


def _cell(row: GroupMetrics, metric: Metric) -> Spread:
    """Mean, exact where visits give it, and standard deviation."""
    return Spread(row.expected(metric.name), row.std.get(metric.name, float("nan")))


def _intervals(result: Comparison, metrics: Sequence[Metric]) -> Table | None:
    """Intervals of the means of driven paths; None where no group has one."""
    driven = [row for row in result.groups if row.path_type == DRIVEN]
    known = [m for m in metrics if any(isfinite(row.half_interval.get(m.name, np.nan)) for row in driven)]
    rows: list[tuple[Cell, ...]] = [
        (row.group, row.participants, *(_interval(row, metric.name) for metric in known)) for row in driven
    ]
    columns = (Column("group"), Column("participants"), *(Column(m.name, m.heading, DECIMALS) for m in known))
    caption = "95 % intervals of the means of driven paths (Student, over participants)"
    note = "" if all(row.participants > 1 for row in driven) else "One participant has no interval."
    return Table(columns, tuple(rows), caption, note) if known else None


def _interval(row: GroupMetrics, name: str) -> Interval:
    """Mean minus and plus half the interval."""
    mean, half = row.mean.get(name, float("nan")), row.half_interval.get(name, float("nan"))
    return Interval(mean - half, mean + half)


def _quantiles(result: Comparison, metrics: Sequence[Metric], shares: Sequence[float]) -> Table:
    """Quantiles by group and type of path."""
    columns = (
        Column("group"),
        Column("path_type", "paths"),
        Column("n"),
        Column("share", "quantile", 3),
        *(Column(metric.name, metric.heading, DECIMALS) for metric in metrics),
    )
    rows = [
        (own.group, own.path_type, own.count, share, *(values.get(metric.name) for metric in metrics))
        for own in quantiles_of(result.rows, [metric.name for metric in metrics], shares)
        for share, values in own.values.items()
    ]
    note = "Over demonstrations; of learnt paths over the expected values in their scenes. 0.5 is the median."
    return Table(columns, tuple(rows), "Quantiles", note)


def _numbers(result: Comparison, metrics: Sequence[Metric]) -> Table:
    """The groups with a column for each number, and the reasons for missing ones."""
    columns = [Column("group"), Column("path_type"), Column("n")]
    columns += [
        Column(f"{m.name}_{part}") for m in metrics for part in ("mean", "std", "half_interval", "error", "exact")
    ]
    rows = []
    for row in result.groups:
        values = (row.mean, row.std, row.half_interval, row.error, row.exact)
        numbers = [own.get(metric.name) for metric in metrics for own in values]
        reasons = [f"{name}: {reason} ({n})" for name, own in row.missing.items() for reason, n in own.items()]
        rows.append((row.group, row.path_type, row.count, *numbers, "; ".join(reasons)))
    return Table((*columns, Column("missing")), tuple(rows))


def _paired(one: str, other: str, found: Mapping[str, Paired], metrics: Sequence[Metric]) -> Table:
    """Differences by metric."""
    several = any(pair.holm_p is not None for pair in found.values())
    columns = (
        Column("metric"),
        Column("mean_difference", "mean difference", DECIMALS, sign=True),
        Column("student_interval", "95 % interval (Student)", DECIMALS, sign=True),
        Column("bootstrap_interval", "95 % interval (bootstrap)", DECIMALS, sign=True),
        Column("n"),
        Column("wilcoxon_p", "p (Wilcoxon)", 4),
        *([Column("holm_p", "p (Holm)", 4)] if several else []),
        Column("cohen_dz", "Cohen's d_z", 2),
        Column("rank_biserial", "rank-biserial r", 2),
    )
    known = [(metric, found[metric.name]) for metric in metrics if metric.name in found]
    rows = tuple(
        (
            metric.heading,
            pair.mean,
            Interval(*pair.student),
            None if pair.bootstrap is None else Interval(*pair.bootstrap),
            pair.n,
            pair.wilcoxon_p,
            *([pair.holm_p] if several else []),
            pair.cohen_dz,
            pair.rank_biserial,
        )
        for metric, pair in known
    )
    paths = "" if other.startswith(LEARNT) else ", driven paths"
    return Table(columns, rows, f"{one} - {other}{paths}, paired by participant", _paired_note(known, metrics))


def _paired_note(known: Sequence[tuple[Metric, Paired]], metrics: Sequence[Metric]) -> str:
    """Why numbers of a comparison are missing."""
    pairs = [pair for _, pair in known]
    there = {metric.name for metric, _ in known}
    lacking = [metric.label for metric in metrics if metric.name not in there]
    notes = []
    if any(pair.holm_p is not None for pair in pairs):
        notes.append("p (Holm) is corrected for all tests of these tables.")
    differing = [sum(value != 0 for value in pair.differences.values()) for pair in pairs]
    if any(pair.n < FEWEST for pair in pairs):
        notes.append(f"A bootstrap interval needs {FEWEST} participants, Student's interval 2.")
    if any(count < TESTED for count in differing):
        notes.append(f"Wilcoxon's test needs {TESTED} participants who differ; other rows do not count as tests.")
    if not all(differing):
        notes.append("Without a difference there is no effect size.")
    elif any(not isfinite(pair.cohen_dz) for pair in pairs):
        notes.append("Cohen's d_z needs 2 participants whose differences differ.")
    if lacking:
        notes.append(f"No participant has driven paths of both groups with a value of: {', '.join(lacking)}.")
    return " ".join(notes)


def _legend(result: Comparison, metrics: Sequence[Metric]) -> list[str]:
    """The meaning of the metrics and of the types of paths."""
    path_types = {row.path_type if row.path_type in PATH_TYPES else LEARNT for row in result.groups}
    lines = ["mean ± standard deviation over n demonstrations; of learnt paths of one path, in the scenes of n of them"]
    lines += [f"{metric.label}: {metric.definition}" for metric in metrics]
    lines += [f"{path_type}: {text}" for path_type, text in PATH_TYPES.items() if path_type in path_types]
    errors = [
        row.error[m.name] / row.std[m.name]
        for row in result.groups
        for m in metrics
        if m.name in row.error and m.name not in row.exact and row.std[m.name] > 0
    ]
    if errors:
        lines.append(f"Monte Carlo error of learnt paths' means: at most {max(errors):.2g} of their standard deviation")
    return lines
