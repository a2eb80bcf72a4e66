"""The long table of an evaluation: one row for each trial, type of path and metric."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.tables import Cell, Column, Format, Table, is_missing, written
from navirl_cli.errors import ArgumentError, MissingPackageError
from navirl_cli.evaluation.compare import Comparison
from navirl_cli.evaluation.metric import Metric
from navirl_cli.files import replacing

PER_TRIAL_ENDINGS = (".csv", ".parquet")


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
        path: The file, checked by :func:`check_per_trial`.
        result: As of :func:`per_trial_table`.
        files: As of :func:`per_trial_table`.
        metrics: As of :func:`per_trial_table`.
        force: Replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    table = per_trial_table(result, files, metrics)
    with replacing(path, force=force) as temporary:
        if path.suffix.lower() == ".csv":
            temporary.write_text(written(table, Format.CSV) + "\n", encoding="utf-8", newline="")
        else:
            _write_parquet(temporary, table)


def check_per_trial(path: Path) -> None:
    """Refuse, before any work, a table that cannot be written.

    Args:
        path: Of the table.

    Raises:
        ArgumentError: It ends otherwise.
        MissingPackageError: pyarrow is not installed, for .parquet.
    """
    if path.suffix.lower() not in PER_TRIAL_ENDINGS:
        raise ArgumentError(f"`per_trial`: expected a file that ends in .csv or .parquet, found {path.name}")
    if path.suffix.lower() == ".parquet" and find_spec("pyarrow") is None:
        raise MissingPackageError(
            f"{path}: .parquet needs pyarrow, which is not installed; install it with: pip install 'navirl[parquet]', "
            "or write .csv"
        )


def _write_parquet(path: Path, table: Table) -> None:
    """Write a table whose columns have the same types whatever they hold; missing values are nulls."""
    import pyarrow as pa
    from pyarrow import parquet

    numbers = {"cycle": pa.int64(), "value": pa.float64()}
    schema = pa.schema([(one.name, numbers.get(one.name, pa.string())) for one in table.columns])
    cells = [[None if is_missing(cell) else cell for cell in table.column(j)] for j in range(len(table.columns))]
    columns = [pa.array(own, type=field.type) for own, field in zip(cells, schema, strict=True)]
    parquet.write_table(pa.Table.from_arrays(columns, schema=schema), path)
