"""``navirl merge``: the trials of several demonstrations files in one."""

from pathlib import Path

import click

from navirl_cli.artefacts.editing import merged
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.commands.shared import check_output, echo, force_option, output_option, say
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.errors import counted


@click.command(
    cls=Command,
    examples=[
        Example("Two files", "navirl merge monday.json tuesday.json -o demos.json"),
        Example("In place of an older file", "navirl merge monday.json tuesday.json -o demos.json --force"),
    ],
)
@click.argument("demos", metavar="DEMOS...", nargs=-1, required=True, type=FilePath)
@section("Output", output_option("Demonstrations file to write."), force_option)
def merge(demos: tuple[Path, ...], output: Path, force: bool) -> None:
    """Write the trials of several demonstrations files into one.

    The ids of trials must differ. Settings of the extractions that differ are listed.
    """
    if len(demos) < 2:
        raise click.UsageError("merge needs two or more files.")
    check_output(output, demos, force=force)
    documents = {str(path): read_json(path, "demonstrations") for path in demos}
    if len(documents) < len(demos):
        raise click.UsageError("merge: expected different files, found one twice.")
    content, notes = merged(documents)
    write_json(output, "demonstrations", content, force=force)
    people = {one["participant"] for one in content["demonstrations"]}
    count = len(people)
    echo(f"{output}: {counted(len(content['demonstrations']), 'demonstration')} of {counted(count, 'participant')}")
    for line in notes:
        say(line)
