"""``navirl inspect``: the content of logs."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    bytes_bar,
    echo,
    echo_json,
    finish,
    frame_option,
    goal_option,
    json_option,
    logs_argument,
    merged,
    namespace_option,
    say,
    split_option,
    topic_option,
    topics_by_role,
)
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.demos.labels import log_names
from navirl_cli.demos.listing import Listing, TrialSettings, list_trials
from navirl_cli.demos.trials import Split
from navirl_cli.documents.tables import Format, written
from navirl_cli.documents.text import to_text
from navirl_cli.errors import LogError, NavirlError
from navirl_cli.logs.load import LoadOptions
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import Source, sources_of
from navirl_cli.reports.overview import overview_document, overview_report
from navirl_cli.reports.trials import trials_table


@click.command(
    cls=Command,
    examples=[
        Example("Topics of a log, and the topics that extract would use", "navirl inspect p01.mcap"),
        Example("All logs of a folder, with a check of every message", "navirl inspect logs --check"),
        Example("A table of the trials, to be filled in", "navirl inspect p01.mcap p02.mcap --trials"),
    ],
)
@logs_argument
@section(
    "Trials",
    click.option(
        "--trials",
        is_flag=True,
        help="Print a CSV table of the trials instead, with columns to fill in, for extract --trials and for annotate.",
    ),
    split_option,
    goal_option,
    frame_option,
)
@section(
    "Input",
    topic_option,
    namespace_option,
    click.option("--check", is_flag=True, help="Read every message. This also finds damage inside chunks."),
)
@section("Output", json_option)
def inspect(
    logs: tuple[Path, ...],
    topics: tuple[tuple[str, str], ...],
    namespace: str | None,
    check: bool,
    trials: bool,
    split: str,
    goal: tuple[float, float] | None,
    frame: str | None,
    as_json: bool,
) -> None:
    """Show the content of logs, and the topics that extract would use.

    LOG is an MCAP file, a rosbag2 folder, a folder of recordings, or a pattern. The output lists duration, clocks and
    damage; for every topic its type, number of messages, rate and gaps; the topics that extract would use; and missing
    data, with the option that supplies it.

    A gap is a pause in a regular topic of at least half a second and five periods. Rates exclude gaps. The stamp
    lead is the header's stamp minus the time of receipt, relative to the odometry. It is near 0 for topics of the same
    clock; tf is often stamped ahead on purpose.

    With --trials, the output is a table with one row for each trial that extract would find. It shows what the log
    states of the trial. Fill in the empty cells.
    """
    settings = TrialSettings(Split(split), goal)
    if check and trials:
        raise click.UsageError("--check excludes --trials.")
    if tables := [path for path in logs if trials and path.suffix.lower() == ".csv"]:
        raise click.UsageError(
            f"--trials prints the table; write it with: navirl inspect LOG --trials > {tables[0].name}"
        )
    if not trials and (settings != TrialSettings() or frame):
        raise click.UsageError("--split, --goal and --frame need --trials.")
    options = LoadOptions(topics=topics_by_role(topics), namespace=namespace, frame=frame)
    refused: list[NavirlError] = []
    sources = _sources(logs, refused)
    if trials:
        _list(sources, settings, options, refused, as_json=as_json)
    else:
        _show(sources, options, refused, check=check, as_json=as_json)


def _sources(logs: tuple[Path, ...], refused: list[NavirlError]) -> list[Source]:
    """The recordings, with the errors of those that cannot be found."""
    errors: list[LogError] = []
    sources = sources_of(logs, refused=errors)
    refused += errors
    return sources


def _show(
    sources: list[Source], options: LoadOptions, refused: list[NavirlError], *, check: bool, as_json: bool
) -> None:
    """Print what is in recordings."""
    views = []
    with bytes_bar("inspect") as update:
        for source in sources:
            try:
                views.append(overview(source, options.topics, options.namespace, check=check, progress=update))
            except LogError as error:
                refused.append(error)
    if refused and not views:
        raise refused[0]
    if as_json:
        echo_json({"logs": [overview_document(view) for view in views]})
    else:
        echo(to_text(block for view in views for block in overview_report(view)))
    for view in views:
        for note in view.source.notes:
            say(note)
    finish([*map(str, refused), *(line for view in views for line in view.damage)])


def _list(
    sources: list[Source], settings: TrialSettings, options: LoadOptions, refused: list[NavirlError], *, as_json: bool
) -> None:
    """Print the trials of recordings as a table."""
    found: list[Listing] = []
    with bytes_bar("inspect") as update:
        for source, name in zip(sources, log_names(sources), strict=True):
            try:
                found.append(list_trials(source, name, settings, options, update))
            except NavirlError as error:
                refused.append(error)
    if refused and not found:
        raise refused[0]
    table = trials_table(trial for one in found for trial in one.trials)
    if as_json:
        echo_json({"trials": table.records()})
    else:
        click.echo(written(table, Format.CSV))
    for note in merged(note for one in found for note in one.notes):
        say(note)
    finish([*(f"left out: {error}" for error in refused), *(line for one in found for line in one.damage)])
