"""``navirl evaluate``: path properties of demonstrated, learnt and baseline paths."""

import csv
import io
from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.rewards import read_reward_for
from navirl_cli.artefacts.store import Input, write_json
from navirl_cli.commands.shared import (
    FilePath,
    demonstrations_in,
    demos_argument,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    progress_bar,
    samples_option,
    seed_option,
    text_table,
)
from navirl_cli.errors import ArtefactError
from navirl_cli.evaluation.compare import KINDS, Comparison, compare
from navirl_cli.evaluation.metrics import METRICS, PathMetrics
from navirl_cli.files import check_writable, replacing


@click.command()
@demos_argument
@click.option("--reward", type=FilePath, help="Learnt reward, to measure paths drawn from its policy.")
@samples_option
@seed_option
@json_option
@click.option("--csv", "as_csv", is_flag=True, help="Print CSV in place of the table.")
@output_option("Write the results as .json or .csv too.", required=False)
@force_option
def evaluate(
    demos: Path,
    reward: Path | None,
    samples: int,
    seed: int,
    as_json: bool,
    as_csv: bool,
    output: Path | None,
    force: bool,
) -> None:
    """Measure demonstrated, learnt and baseline paths.

    Mean and standard deviation, by condition and cycle, of length, least distance between the robot's shell and a
    person's centre, and area between path and nominal path.
    """
    import numpy as np

    if as_json and as_csv:
        raise click.UsageError("--json and --csv exclude each other.")
    if output is not None:
        _check_output(output, force=force)
    demonstrations = demonstrations_in(demos)
    learnt = None if reward is None else read_reward_for(reward, demonstrations).reward
    with progress_bar("evaluate", len(demonstrations)) as update:
        result = compare(
            demonstrations, learnt, samples, np.random.default_rng(seed), lambda done, _all: update(done, "")
        )
    inputs = [Input.of(path) for path in (demos, reward) if path is not None]
    document = _document(result, inputs, samples if reward else 0, seed)
    if output is not None and output.suffix == ".json":
        write_json(output, "metrics", document, force=force)
    elif output is not None:
        with replacing(output, force=force) as temporary:
            temporary.write_text(_csv(result), encoding="utf-8", newline="")
    if as_json:
        echo_json(document)
    else:
        click.echo(_csv(result) if as_csv else _table(result), nl=not as_csv)
    finish(result.notes)


def _check_output(output: Path, *, force: bool) -> None:
    """Refuse early what cannot be written."""
    if output.suffix not in {".json", ".csv"}:
        raise ArtefactError(f"{output}: expected a name that ends in .json or .csv, found {output.suffix!r}")
    check_writable(output, force=force)


def _values(metrics: PathMetrics) -> dict[str, float | None]:
    """Metrics for JSON, which knows no NaN."""
    return {name: float(value) if isfinite(value) else None for name, value in asdict(metrics).items()}


def _document(result: Comparison, inputs: list[Input], samples: int, seed: int) -> Mapping[str, Any]:
    """The content of a metrics file."""
    return {
        "inputs": [vars(one) for one in inputs],
        "samples": samples,
        "seed": seed,
        "groups": [
            {
                "group": row.group,
                "paths": row.kind,
                "count": row.count,
                "mean": _values(row.mean),
                "standard_deviation": _values(row.std),
            }
            for row in result.groups
        ],
        "demonstrations": [
            {"id": name, "group": group, "metrics": _values(metrics)} for name, group, metrics in result.driven
        ],
    }


def _csv(result: Comparison) -> str:
    """One line a group and kind of path."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    names = [metric.name for metric in METRICS]
    writer.writerow(["group", "paths", "n", *(f"{name}_{part}" for name in names for part in ("mean", "std"))])
    for row in result.groups:
        numbers = [getattr(part, name) for name in names for part in (row.mean, row.std)]
        writer.writerow([row.group, row.kind, row.count, *(f"{n:.6g}" if isfinite(n) else "" for n in numbers)])
    return stream.getvalue()


def _table(result: Comparison) -> str:
    """The same as text, with what the words mean below."""
    header = ("group", "paths", "n", *(f"{metric.label} {metric.unit}" for metric in METRICS))
    rows = [
        (
            row.group,
            row.kind,
            str(row.count),
            *(_mean_and_spread(getattr(row.mean, m.name), getattr(row.std, m.name)) for m in METRICS),
        )
        for row in result.groups
    ]
    used = [kind for kind in KINDS if any(row.kind == kind for row in result.groups)]
    legend = [f"{kind}: {KINDS[kind]}" for kind in used]
    meaning = [f"{metric.label}: {metric.definition}" for metric in METRICS]
    return "\n".join((text_table(header, rows), "", "mean ± standard deviation over n paths", *meaning, *legend))


def _mean_and_spread(mean: float, spread: float) -> str:
    if not isfinite(mean):
        return "-"
    return f"{mean:.3f}" + (f" ± {spread:.3f}" if isfinite(spread) else "")
