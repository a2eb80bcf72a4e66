"""``navirl inspect``: what a log holds."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    bytes_bar,
    echo,
    echo_json,
    finish,
    json_option,
    say,
    topic_option,
    topics_by_role,
)
from navirl_cli.commands.types import FilePath
from navirl_cli.documents.text import to_text
from navirl_cli.errors import LogError
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import sources_of
from navirl_cli.reports.overview import overview_document, overview_report


@click.command()
@click.argument("logs", nargs=-1, required=True, type=FilePath)
@topic_option
@click.option("--check", is_flag=True, help="Read every message: damage inside of chunks shows only then.")
@json_option
def inspect(logs: tuple[Path, ...], topics: tuple[tuple[str, str], ...], check: bool, as_json: bool) -> None:
    """Tell what logs hold, and what extract would make of it.

    LOG is an MCAP file, a bag folder, a folder of recordings, or a pattern. Duration, clocks, damage, and every topic
    with its type, number of messages, rate and silences; then the topics that extract would take, and what is missing
    and how to supply it. A silence is a pause of a regular topic, five times as long as usual and half a second at
    least; the rate leaves silences out. The stamp lead is a header's stamp less its receipt, against the odometry's:
    near 0 on one clock; tf is often stamped a second ahead on purpose.
    """
    refused: list[LogError] = []
    views = []
    with bytes_bar("inspect") as update:
        for source in sources_of(logs, refused=refused):
            try:
                views.append(overview(source, topics_by_role(topics), check=check, progress=update))
            except LogError as error:
                refused.append(error)
    if refused and not views:
        raise refused[0]
    if as_json:
        echo_json([overview_document(view) for view in views])
    else:
        echo(to_text(block for view in views for block in overview_report(view)))
    for view in views:
        for note in view.source.notes:
            say(note)
    finish([*map(str, refused), *(line for view in views for line in view.damage)])
