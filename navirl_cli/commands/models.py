"""``navirl models``: several rewards side by side."""

from pathlib import Path

import click

from navirl_cli.cluster import workers_of
from navirl_cli.commands.choosing import Choosing
from navirl_cli.commands.learning import l2_option, selection_options, terms_option
from navirl_cli.commands.shared import (
    demonstrations_in,
    demos_argument,
    echo,
    echo_json,
    finish,
    json_option,
    progress_bar,
    say,
    workers_options,
)
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.text import to_text
from navirl_cli.errors import counted
from navirl_cli.irl.models import MODELS, compare_models, with_paper
from navirl_cli.irl.selection import Steps, select
from navirl_cli.irl.terms.term import Term
from navirl_cli.parallel import keep_freed_memory
from navirl_cli.reports.fit_remarks import cannot_learn
from navirl_cli.reports.models import models_document, models_lost, models_remarks, models_report


@click.command(
    cls=Command,
    examples=[
        Example("One condition and cycle", "navirl models demos.json --condition force --cycle 2"),
        Example(
            "Another model beside the paper's",
            "navirl models demos.json --cycle 2 --terms length,deviation,length-space",
        ),
    ],
)
@demos_argument
@selection_options
@section(
    "Models",
    terms_option(
        "models",
        multiple=True,
        help="Compare this sum of terms with the paper's, instead of the sums that navirl knows; repeatable. Terms are "
        "named as for navirl fit.",
    ),
    l2_option,
)
@workers_options
@section("Output", json_option)
def models(
    demos: tuple[Path, ...],
    choosing: Choosing,
    only_corrected: bool,
    truncated: bool,
    steps: str,
    reach: float | None,
    models: tuple[tuple[Term, ...], ...],
    l2: float,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
) -> None:
    """Compare rewards by how well they predict participants left out.

    Each model is fitted to all participants but one and predicts the steps of that one, for each participant in turn.
    """
    if reach is not None and Steps(steps) is not Steps.REACHABLE:
        raise click.UsageError("--reach needs --steps reachable.")
    selected = select(
        demonstrations_in(*demos),
        choosing.subset,
        only_corrected=only_corrected,
        truncated=truncated,
        steps=Steps(steps),
        reach_m=reach,
    )
    for line in cannot_learn(selected.demonstrations):
        say(line)
    chosen = with_paper(models or MODELS)
    each = len(selected.evidence.several_people("models")) + 1
    say(f"{counted(len(chosen), 'model')}, each fitted {each} times: to all participants, and to all but each")
    bar = progress_bar("fit", each * len(chosen), line_every=each)
    keep_freed_memory()
    with workers_of(workers, cluster) as executor, bar as update:
        found = compare_models(selected.evidence, chosen, l2, executor=executor, progress=update)
    if as_json:
        echo_json(models_document(found, l2))
    else:
        echo(to_text(models_report(found)))
    for line in models_remarks(found):
        say(line)
    finish(models_lost(found))
