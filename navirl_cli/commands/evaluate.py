"""``navirl evaluate``: metrics of demonstrated, learnt and baseline paths, and comparisons of groups."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.metrics import metrics_document
from navirl_cli.artefacts.rewards import read_reward_for
from navirl_cli.commands import completion
from navirl_cli.commands.choosing import Choosing, choice_options
from navirl_cli.commands.shared import (
    check_output,
    demonstrations_in,
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    person_option,
    progress_bar,
    samples_option,
    seed_option,
)
from navirl_cli.commands.types import Choice, FilePath, Number
from navirl_cli.commands.usage import Command, Example, refuse_unused, section
from navirl_cli.demos.subset import FIELDS
from navirl_cli.documents.tables import ENDINGS, Format, written
from navirl_cli.errors import unknown
from navirl_cli.evaluation.compare import compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import groups_named
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS, Metric
from navirl_cli.evaluation.paired import pairs_of
from navirl_cli.evaluation.ranks import Ranking, check_to_rank, chosen_to_rank, ranking
from navirl_cli.files import Input
from navirl_cli.reports.evaluation import evaluation_text, metrics_table, write_evaluation


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
@click.argument("demos", metavar="DEMOS", required=False, type=FilePath)
@choice_options(reward=True)
@section(
    "Metrics",
    click.option(
        "--metrics",
        default=PAPER_METRICS,
        type=Metrics(),
        shell_complete=completion.metrics,
        help="Comma-separated names of metrics, or all.  [default: length_m,min_distance_m,area_m2]",
    ),
    click.option(
        "--list-metrics", is_flag=True, help="List all metrics with unit, definition and source; DEMOS is not needed."
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
    person_option,
    samples_option(),
    click.option(
        "--precision",
        "error",
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
        shell_complete=completion.groups,
        help="Compare the driven paths of two groups by participant; repeatable.",
    ),
    click.option(
        "--ranks",
        is_flag=True,
        help="Rank each demonstration by likelihood, least distance and area among paths sampled from the policy, by "
        "group, for the groups that the reward was learnt from.",
    ),
)
@section(
    "Output",
    click.option(
        "--format",
        "style",
        type=Choice([how.value for how in Format if how is not Format.JSON]),
        default=Format.TEXT.value,
        show_default=True,
        help="Format of the printed tables.",
    ),
    output_option("File to write as well: .json, .csv, .md or .tex.", *ENDINGS, required=False),
    json_option,
    force_option,
)
def evaluate(
    demos: Path | None,
    choosing: Choosing,
    rewards: tuple[Path, ...],
    person: str | None,
    metrics: tuple[Metric, ...],
    list_metrics: bool,
    fields: tuple[str, ...],
    pairs: tuple[tuple[str, str], ...],
    ranks: bool,
    samples: int,
    error: float | None,
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

    if list_metrics:
        _list_metrics(Format(style), as_json=as_json)
        return
    if demos is None:
        raise click.UsageError("Missing argument 'DEMOS'.")
    _check_arguments(rewards, pairs, ranks=ranks)
    if person is not None and not rewards:
        raise click.UsageError("--person goes with --reward.")
    if output is not None:
        check_output(output, [demos, *rewards], force=force)
    everyone = demonstrations_in(demos)
    files = {path.stem: read_reward_for(path, everyone, person) for path in rewards}
    trained = next(iter(files.values())).trained(everyone) if ranks else None
    named = [name for pair in pairs for name in pair]
    also = [one for own in groups_named(choosing.subset.of(everyone), named, fields, "pair") for one in own]
    also += chosen_to_rank(everyone, trained)[0] if ranks else []
    demonstrations = choosing.of(everyone, list(files.values()), also=also)
    learnt = {name: one.reward for name, one in files.items()}
    if ranks:
        check_to_rank(demonstrations, trained)
    rng, precision = np.random.default_rng(seed), Precision(samples, error)
    with progress_bar("evaluate", len(demonstrations)) as update:
        result = compare(
            demonstrations,
            learnt,
            precision,
            rng,
            metrics=metrics,
            fields=fields,
            progress=lambda done, _all: update(done, ""),
        )
    compared = [(one, other, pairs_of(result.rows, one, other, metrics, rng)) for one, other in pairs]
    ranked = Ranking()
    if ranks:
        ranked = ranking(demonstrations, next(iter(learnt.values())), trained, samples, rng)
    inputs = [Input.of(path) for path in (demos, *rewards)]
    document = metrics_document(result, compared, ranked, metrics, inputs, precision, seed)
    text = partial(evaluation_text, result, compared, ranked, metrics)
    if output is not None:
        write_evaluation(output, document, text, force=force)
    if as_json:
        echo_json(document)
    else:
        echo(text(Format(style)))
    finish(result.notes)


def _list_metrics(how: Format, *, as_json: bool) -> None:
    """Print all metrics."""
    if as_json:
        echo_json({"metrics": metrics_table().records()})
    else:
        click.echo(written(metrics_table(), how))


def _check_arguments(rewards: Sequence[Path], pairs: Sequence[tuple[str, str]], *, ranks: bool) -> None:
    """Refuse options that are invalid whatever the files hold."""
    refuse_unused("--reward", "samples", "error", "everything", used=bool(rewards))
    if ranks and len(rewards) != 1:
        raise click.UsageError("--ranks needs one --reward.")
    stems = [path.stem for path in rewards]
    if twice := [stem for stem in stems if stems.count(stem) > 1]:
        raise click.UsageError(f"--reward: expected files of different names, found several {twice[0]}; rename one.")
    for one, other in pairs:
        if one == other:
            raise click.UsageError(f"--pair: expected two groups, found {one!r} twice.")
