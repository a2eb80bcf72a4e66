"""The long table of an evaluation: one row for each trial, type of path and metric."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.tables import Cell, Column, Format, Table, written
from navirl_cli.errors import MissingPackageError
from navirl_cli.evaluation.compare import Comparison
from navirl_cli.evaluation.metrics import Metric
from navirl_cli.files import replacing


def per_trial_table(
    result: Comparison, files: Mapping[str, Sequence[Demonstration]], metrics: Sequence[Metric]
) -> Table:
    """The table; values of learnt paths are expected ones in the trial's scene.

    Args:
        result: What was measured, in the order of the demonstrations.
        files: The demonstrations by the name of their file.
        metrics: That were asked for.
    """
    names = ("file", "trial", "participant", "condition", "cycle", "set", "group", "path_type", "metric", "unit")
    columns = (*map(Column, names), Column("value"), Column("missing"))
    trials = [(file, one) for file, own in files.items() for one in own]
    rows: list[tuple[Cell, ...]] = []
    for (file, one), row in zip(trials, result.rows, strict=True):
        labels = (file, one.id, one.participant, one.condition.value, one.cycle, one.set, row.group)
        for path_type, values in row.values.items():
            reasons = row.missing.get(path_type, {})
            rows += [
                (*labels, path_type, metric.name, metric.unit, values[metric.name], reasons.get(metric.name))
                for metric in metrics
                if metric.name in values
            ]
    return Table(columns, tuple(rows))


def write_per_trial(
    path: Path,
    result: Comparison,
    files: Mapping[str, Sequence[Demonstration]],
    metrics: Sequence[Metric],
    *,
    force: bool = False,
) -> None:
    """Write the table as .csv, or as .parquet.

    Args:
        path: The file.
        result: As of :func:`per_trial_table`.
        files: As of :func:`per_trial_table`.
        metrics: As of :func:`per_trial_table`.
        force: Replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
        MissingPackageError: pandas or pyarrow is not installed, for .parquet.
    """
    table = per_trial_table(result, files, metrics)
    if path.suffix.lower() == ".csv":
        with replacing(path, force=force) as temporary:
            temporary.write_text(written(table, Format.CSV) + "\n", encoding="utf-8", newline="")
        return
    try:
        from pandas import DataFrame

        with replacing(path, force=force) as temporary:
            DataFrame.from_records([dict(one) for one in table.records()]).to_parquet(temporary)
    except ImportError as error:
        raise MissingPackageError(
            f"{path}: .parquet needs pandas and pyarrow, found none; install them with: pip install pandas pyarrow, or "
            "write .csv"
        ) from error
