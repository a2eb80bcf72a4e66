"""``navirl info``: what a file of navirl holds."""

import json
from pathlib import Path

import click

from navirl_cli.artefacts.joined import read_content
from navirl_cli.artefacts.manifest import manifest_path
from navirl_cli.artefacts.rewards import learnt_of
from navirl_cli.artefacts.store import read_any
from navirl_cli.commands.shared import echo, echo_json, json_option, say
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.text import to_text
from navirl_cli.files import MANIFEST
from navirl_cli.reports.info import field_of, info_report, summary_of


@click.command(
    cls=Command,
    examples=[
        Example("Which participants, conditions and cycles there are", "navirl info demos.json"),
        Example("Several files as one", "navirl info monday.json tuesday.json"),
        Example("One value for a script", "navirl info reward.json --field parameters.c0"),
    ],
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=FilePath)
@section(
    "Output",
    click.option(
        "--field",
        metavar="NAME",
        help="Print this value alone: a name of --json or of the file, with dots between levels, e.g. parameters.c0.",
    ),
    json_option,
)
def info(files: tuple[Path, ...], field: str | None, as_json: bool) -> None:
    """Show what a file of demonstrations, a reward, metrics, a plan or a study holds.

    Several files of demonstrations, and folders of them, are shown as one. For logs, see navirl inspect.
    """
    if field is not None and as_json:
        raise click.UsageError("--field prints one value; leave out --json.")
    if len(files) == 1 and manifest_path(files[0]).name != MANIFEST:
        artefact, content = read_any(files[0])
    else:
        artefact, (content, notes) = "demonstrations", read_content(files)
        for line in notes:
            say(line)
    summary = summary_of(artefact, content)
    if field is not None:
        value = field_of(summary, content, field)
        echo(value if isinstance(value, str) else json.dumps(value, allow_nan=False))
    elif as_json:
        echo_json(summary)
    else:
        if artefact == "reward":
            learnt_of(content, str(files[0]))  # names the file of a term that is not known here
        echo(to_text(info_report(", ".join(map(str, files)), artefact, content)))
