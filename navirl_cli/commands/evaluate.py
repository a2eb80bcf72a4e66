"""``navirl evaluate``: metrics of demonstrated, learnt and baseline paths, and comparisons of groups."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.metrics import metrics_document
from navirl_cli.artefacts.rewards import LearntReward, read_reward_for
from navirl_cli.cluster import workers_of
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
    say,
    seed_option,
    workers_options,
)
from navirl_cli.commands.types import Choice, FilePath, Number, OutputPath
from navirl_cli.commands.usage import Command, Example, refuse_unused, section
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import FIELDS
from navirl_cli.documents.tables import ENDINGS, Format, written
from navirl_cli.errors import unknown
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS
from navirl_cli.evaluation.questions import Answers, Asked, answers_to, asked_of
from navirl_cli.files import Input
from navirl_cli.reports.evaluation import evaluation_text, metrics_table, write_evaluation
from navirl_cli.reports.per_trial import PER_TRIAL_ENDINGS, check_per_trial, write_per_trial


class Shares(click.ParamType):  # type: ignore[type-arg]
    """Comma-separated shares from 0 to 1."""

    name = "share,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Parse and check."""
        if not isinstance(value, str):
            return tuple(value)
        try:
            shares = tuple(float(part) for part in value.split(","))
        except ValueError:
            shares = (-1.0,)
        if not all(0 <= share <= 1 for share in shares):
            self.fail(f"expected numbers from 0 to 1 as 0.25,0.5,0.75, found {value!r}", param, ctx)
        return tuple(dict.fromkeys(shares))


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
        Example(
            "Several files in a table for a paper, with medians",
            "navirl evaluate monday.json tuesday.json --quantiles 0.5 -o metrics.tex",
        ),
    ],
)
@click.argument("demos", metavar="DEMOS...", nargs=-1, type=FilePath)
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
    click.option(
        "--quantiles",
        type=Shares(),
        default=(),
        help="Also quantiles by group of these shares, comma-separated: 0.5 for medians, or 0.25,0.5,0.75.",
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
    click.option(
        "--per-trial",
        type=OutputPath(PER_TRIAL_ENDINGS),
        help="Long table to write as well, one row for each trial, type of path and metric: .csv, or .parquet "
        "where pyarrow is installed.",
    ),
    output_option("File to write as well: .json, .csv, .md or .tex.", *ENDINGS, required=False),
    json_option,
    force_option,
)
@workers_options
def evaluate(
    demos: tuple[Path, ...],
    choosing: Choosing,
    rewards: tuple[Path, ...],
    person: str | None,
    metrics: tuple[Metric, ...],
    list_metrics: bool,
    fields: tuple[str, ...],
    pairs: tuple[tuple[str, str], ...],
    ranks: bool,
    quantiles: tuple[float, ...],
    per_trial: Path | None,
    samples: int,
    error: float | None,
    seed: int,
    style: str,
    as_json: bool,
    output: Path | None,
    force: bool,
    workers: int | None,
    cluster: str | None,
) -> None:
    """Measure demonstrated, learnt and baseline paths, and compare groups of them.

    Several files of demonstrations stand in one table, and groups of the same name are compared by participant; so are
    the learnt paths of several rewards. With several tests, p-values are also given by Holm's method. Fewer than
    two participants who differ are no test.

    Each metric has a mean and a standard deviation by group: over demonstrations for driven paths, over the policy for
    learnt paths. Distances are from the robot's shell to people's centres. Expected visits of the policy give exact
    means of path length, heading change and path length in zones; the other means are over sampled paths.
    """
    if list_metrics:
        _list_metrics(Format(style), as_json=as_json)
        return
    _check_arguments(demos, rewards, pairs, ranks=ranks)
    _check_files([*demos, *rewards], output, per_trial, force=force)
    everyone = dict(zip(_names(demos), map(demonstrations_in, demos), strict=True))
    learnt = {path.stem: _reward_for(path, everyone, person) for path in rewards}
    trained = [one.trained([d for own in everyone.values() for d in own]) for one in learnt.values()]
    asked = asked_of(
        everyone, choosing.subset, trained, everything=choosing.everything, pairs=pairs, fields=fields, ranked=ranks
    )
    for line in asked.notes:
        say(line)
    precision = Precision(samples, error)
    with workers_of(workers, cluster) as executor:
        found = _answers(asked, learnt, metrics, precision, seed, executor)
    inputs = [Input.of(path) for path in (*demos, *rewards)]
    document = metrics_document(found.result, found.pairs, found.ranked, metrics, inputs, precision, seed, quantiles)
    if per_trial is not None:
        write_per_trial(per_trial, found.result, asked.files, metrics, force=force)
    text = partial(evaluation_text, found.result, found.pairs, found.ranked, metrics, quantiles=quantiles)
    if output is not None:
        write_evaluation(output, document, text, force=force)
    if as_json:
        echo_json(document)
    else:
        echo(text(Format(style)))
    finish(found.result.notes)


def _answers(
    asked: Asked,
    learnt: Mapping[str, LearntReward],
    metrics: Sequence[Metric],
    precision: Precision,
    seed: int,
    executor: Executor,
) -> Answers:
    """Everything that is asked for, with a progress bar."""
    import numpy as np

    rewards = {name: one.reward for name, one in learnt.items()}
    with progress_bar("evaluate", sum(map(len, asked.files.values()))) as update:
        rng = np.random.default_rng(seed)
        return answers_to(asked, rewards, metrics, precision, rng, lambda done, _all: update(done, ""), executor)


def _check_files(inputs: Sequence[Path], output: Path | None, per_trial: Path | None, *, force: bool) -> None:
    """Refuse, before any work, files that cannot be written."""
    for path in (output, per_trial):
        if path is not None:
            check_output(path, inputs, force=force)
    if output is not None and per_trial is not None and output.resolve() == per_trial.resolve():
        raise click.UsageError("--output and --per-trial: expected two files, found one twice.")
    if per_trial is not None:
        check_per_trial(per_trial)


def _names(paths: Sequence[Path]) -> list[str]:
    """Names of files: their stems, or their paths where stems are the same."""
    stems = [path.stem for path in paths]
    return [path.stem if stems.count(path.stem) == 1 else str(path) for path in paths]


def _reward_for(path: Path, files: Mapping[str, Sequence[Demonstration]], person: str | None) -> LearntReward:
    """A reward, checked against the cells of all demonstrations."""
    return read_reward_for(path, [one for own in files.values() for one in own], person)


def _list_metrics(how: Format, *, as_json: bool) -> None:
    """Print all metrics."""
    if as_json:
        echo_json({"metrics": metrics_table().records()})
    else:
        click.echo(written(metrics_table(), how))


def _check_arguments(
    demos: Sequence[Path], rewards: Sequence[Path], pairs: Sequence[tuple[str, str]], *, ranks: bool
) -> None:
    """Refuse options that are invalid whatever the files hold."""
    if not demos:
        raise click.UsageError("Missing argument 'DEMOS...'.")
    if len({*demos}) < len(demos):
        raise click.UsageError("DEMOS: expected different files, found one twice.")
    if ranks and len(demos) > 1:
        raise click.UsageError(
            "--ranks needs one file of demonstrations; join several with navirl merge, or leave out --ranks."
        )
    refuse_unused("--reward", "samples", "error", "everything", "person", used=bool(rewards))
    if ranks and len(rewards) != 1:
        raise click.UsageError("--ranks needs one --reward; give one, or leave out --ranks.")
    stems = [path.stem for path in rewards]
    if twice := [stem for stem in stems if stems.count(stem) > 1]:
        raise click.UsageError(f"--reward: expected files of different names, found several {twice[0]}; rename one.")
    for one, other in pairs:
        if one == other:
            raise click.UsageError(f"--pair: expected two groups, found {one!r} twice.")
