"""``navirl evaluate``: what demonstrated, learnt and baseline paths are like, and how groups of them differ."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.metrics import metrics_document
from navirl_cli.artefacts.rewards import read_reward_for
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.shared import (
    demonstrations_in,
    demos_argument,
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    progress_bar,
    samples_option,
    seed_option,
)
from navirl_cli.commands.types import Choice, FilePath, Number
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.tables import ENDINGS, Format, written
from navirl_cli.errors import ArtefactError, DemonstrationError, unknown
from navirl_cli.evaluation.compare import compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import FIELDS
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS, Metric
from navirl_cli.evaluation.paired import pairs_of
from navirl_cli.evaluation.ranks import ranks_of
from navirl_cli.files import Input, check_writable, replacing
from navirl_cli.irl.reward import Reward
from navirl_cli.reports.evaluation import evaluation_text, metrics_table


class Metrics(click.ParamType):  # type: ignore[type-arg]
    """Comma-separated names of metrics, or all."""

    name = "name,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Metric, ...]:
        """Look the names up."""
        if not isinstance(value, str):
            return tuple(value)
        if value == "all":
            return tuple(BY_NAME.values())
        names = [name.strip() for name in value.split(",")]
        for name in names:
            if name not in BY_NAME:
                self.fail(f"{unknown('', name, BY_NAME)}; --list-metrics lists all", param, ctx)
        return tuple(BY_NAME[name] for name in dict.fromkeys(names))


def _list_metrics(ctx: click.Context, _param: click.Parameter, value: bool) -> None:
    """Print all metrics and end."""
    if value:
        click.echo(written(metrics_table()))
        ctx.exit()


@click.command(
    cls=Command,
    examples=[
        Example("Driven, learnt and baseline paths", "navirl evaluate demos.json --reward reward.json"),
        Example(
            "Two metrics of two groups, compared by participant",
            "navirl evaluate demos.json --metrics length_m,area_m2 --pair 'force, cycle 2' joystick",
        ),
        Example("A table for a paper", "navirl evaluate demos.json --reward reward.json --samples 100 -o metrics.tex"),
    ],
)
@demos_argument
@section(
    "Metrics",
    click.option(
        "--metrics",
        default=PAPER_METRICS,
        type=Metrics(),
        help="Comma-separated names of metrics, or all.  [default: length_m,min_distance_m,area_m2]",
    ),
    click.option(
        "--list-metrics",
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=_list_metrics,
        help="List all metrics with unit, definition and source, and exit.",
    ),
    click.option(
        "--by",
        "fields",
        multiple=True,
        type=Choice(list(FIELDS)),
        help="Group by this; repeatable.  [default: condition, cycle and set]",
    ),
)
@section(
    "Learnt paths",
    click.option(
        "--reward",
        "rewards",
        multiple=True,
        type=FilePath,
        help="Learnt reward, to measure the paths of its policy too; repeatable.",
    ),
    samples_option(),
    click.option(
        "--precision",
        type=Number(1e-3, 1),
        help="Sample until the Monte Carlo error of each mean is below this share of the mean or of its standard "
        "deviation.",
    ),
    seed_option,
)
@section(
    "Comparisons",
    click.option(
        "--pair",
        "pairs",
        multiple=True,
        nargs=2,
        metavar="GROUP OTHER",
        help="Compare the driven paths of two groups by participant; repeatable.",
    ),
    click.option(
        "--ranks", is_flag=True, help="Rank each demonstration by likelihood among paths sampled from the policy."
    ),
)
@section(
    "Output",
    click.option(
        "--format",
        "style",
        type=Choice([how.value for how in Format]),
        default=Format.TEXT.value,
        show_default=True,
        help="Format of the printed tables.",
    ),
    output_option("File to write as well: .json, .csv, .md or .tex.", required=False),
    json_option,
    force_option,
)
def evaluate(
    demos: Path,
    rewards: tuple[Path, ...],
    metrics: tuple[Metric, ...],
    fields: tuple[str, ...],
    pairs: tuple[tuple[str, str], ...],
    ranks: bool,
    samples: int,
    precision: float | None,
    seed: int,
    style: str,
    as_json: bool,
    output: Path | None,
    force: bool,
) -> None:
    """Measure demonstrated, learnt and baseline paths, and compare groups of them.

    Each metric has a mean and a standard deviation by group: over demonstrations for driven paths, over the policy for
    learnt paths. Distances are from the robot's shell to people's centres. Expected visits of the policy give exact
    means of path length, heading change and path length in zones; the other means are over sampled paths.
    """
    import numpy as np

    if ranks and len(rewards) != 1:
        raise click.UsageError("--ranks needs one --reward.")
    if output is not None:
        _check_output(output, force=force)
    demonstrations = demonstrations_in(demos)
    learnt = _rewards(rewards, demonstrations)
    rng = np.random.default_rng(seed)
    with progress_bar("evaluate", len(demonstrations)) as update:
        result = compare(
            demonstrations,
            learnt,
            Precision(samples, precision),
            rng,
            metrics=metrics,
            fields=fields,
            progress=lambda done, _all: update(done, ""),
        )
    compared = [(one, other, pairs_of(result.rows, one, other, metrics, rng)) for one, other in pairs]
    ranked = ranks_of(demonstrations, next(iter(learnt.values())), samples, rng) if ranks else []
    inputs = [Input.of(path) for path in (demos, *rewards)]
    content = metrics_document(result, compared, ranked, metrics, inputs, Precision(samples, precision), seed)
    if output is not None:
        _write(output, content, evaluation_text(result, compared, ranked, metrics, ENDINGS[output.suffix]), force=force)
    if as_json or style == Format.JSON:
        echo_json(content)
    else:
        echo(evaluation_text(result, compared, ranked, metrics, Format(style)))
    finish(result.notes)


def _rewards(paths: Sequence[Path], demonstrations: list[Demonstration]) -> dict[str, Reward]:
    """Learnt rewards by the names of their files.

    Raises:
        DemonstrationError: Two files have one name.
    """
    learnt: dict[str, Reward] = {}
    for path in paths:
        if path.stem in learnt:
            raise DemonstrationError(f"{path}: another --reward is called {path.stem!r} too; rename one of the files")
        learnt[path.stem] = read_reward_for(path, demonstrations).reward
    return learnt


def _check_output(output: Path, *, force: bool) -> None:
    """Refuse early what cannot be written."""
    if output.suffix not in ENDINGS:
        known = ", ".join(ENDINGS)
        raise ArtefactError(f"{output}: expected a name that ends in one of {known}, found {output.suffix!r}")
    check_writable(output, force=force)


def _write(output: Path, content: dict[str, Any], text: str, *, force: bool) -> None:
    """The results in the format of the file's ending."""
    if ENDINGS[output.suffix] is Format.JSON:
        write_json(output, "metrics", content, force=force)
        return
    with replacing(output, force=force) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8", newline="")
