"""``navirl merge``: the trials of several demonstrations files in one."""

from pathlib import Path

import click

from navirl_cli.artefacts.editing import plain
from navirl_cli.artefacts.joined import as_one, read_contents
from navirl_cli.artefacts.manifest import manifest_path
from navirl_cli.artefacts.steps import edited
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.shared import check_output, demos_argument, echo, force_option, output_option, say
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.errors import counted
from navirl_cli.files import MANIFEST


@click.command(
    cls=Command,
    examples=[
        Example("Two files", "navirl merge monday.json tuesday.json -o demos.json"),
        Example("In place of an older file", "navirl merge monday.json tuesday.json -o demos.json --force"),
    ],
)
@demos_argument
@section("Output", output_option("Demonstrations file to write."), force_option)
def merge(demos: tuple[Path, ...], output: Path, force: bool) -> None:
    """Write the trials of several demonstrations files into one, or those of a folder with a manifest.

    The ids of trials must differ. Settings of the extractions that differ are listed.
    """
    if len(demos) == 1 and manifest_path(demos[0]).name != MANIFEST:
        raise click.UsageError("merge needs two or more files, or a folder.")
    check_output(output, demos, force=force)
    contents = read_contents(demos)
    content, notes = as_one(contents)
    write_json(output, "demonstrations", edited(plain(content), "merge", contents, (), output), force=force)
    people = {one["participant"] for one in content["demonstrations"]}
    count = len(people)
    echo(f"{output}: {counted(len(content['demonstrations']), 'demonstration')} of {counted(count, 'participant')}")
    for line in notes:
        say(line)
