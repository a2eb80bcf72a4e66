"""``navirl inspect``: the content of logs."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    bytes_bar,
    echo,
    echo_json,
    finish,
    json_option,
    logs_argument,
    namespace_option,
    say,
    topic_option,
    topics_by_role,
)
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.text import to_text
from navirl_cli.errors import LogError
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import sources_of
from navirl_cli.reports.overview import overview_document, overview_report


@click.command(
    cls=Command,
    examples=[
        Example("Topics of a log, and the topics that extract would use", "navirl inspect p01.mcap"),
        Example("All logs of a folder, with a check of every message", "navirl inspect logs --check"),
        Example("For a program", "navirl inspect p01.mcap --topic wrench=/wrench --json"),
    ],
)
@logs_argument
@section(
    "Input",
    topic_option,
    namespace_option,
    click.option("--check", is_flag=True, help="Read every message. This also finds damage inside chunks."),
)
@section("Output", json_option)
def inspect(
    logs: tuple[Path, ...], topics: tuple[tuple[str, str], ...], namespace: str | None, check: bool, as_json: bool
) -> None:
    """Show the content of logs, and the topics that extract would use.

    LOG is an MCAP file, a rosbag2 folder, a folder of recordings, or a pattern. The output lists duration, clocks and
    damage; for every topic its type, number of messages, rate and gaps; the topics that extract would use; and missing
    data, with the option that supplies it.

    A gap is a pause in a regular topic of at least half a second and five periods. Rates exclude gaps. The stamp
    lead is the header's stamp minus the time of receipt, relative to the odometry. It is near 0 for topics of the same
    clock; tf is often stamped ahead on purpose.
    """
    refused: list[LogError] = []
    views = []
    with bytes_bar("inspect") as update:
        for source in sources_of(logs, refused=refused):
            try:
                views.append(overview(source, topics_by_role(topics), namespace, check=check, progress=update))
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
