"""``navirl select``: some of the trials of a demonstrations file."""

from pathlib import Path

import click

from navirl_cli.artefacts.demonstrations import demonstrations_of
from navirl_cli.artefacts.editing import some_of
from navirl_cli.artefacts.joined import as_one, read_contents
from navirl_cli.artefacts.steps import edited
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.choosing import Choosing, choice_options
from navirl_cli.commands.shared import check_output, demos_argument, echo, force_option, output_option, say
from navirl_cli.commands.usage import Command, Example, given_words, section
from navirl_cli.errors import counted


@click.command(
    cls=Command,
    examples=[
        Example("One cycle", "navirl select demos.json --cycle 2 -o second.json"),
        Example("Two participants", "navirl select demos.json --participant p01 --participant p02 -o some.json"),
    ],
)
@demos_argument
@choice_options(reward=False)
@section("Output", output_option("Demonstrations file to write."), force_option)
def select(demos: tuple[Path, ...], choosing: Choosing, output: Path, force: bool) -> None:
    """Write some of the trials of a demonstrations file.

    Everything else of the file stays as it is. Names of one option are alternatives, and all options hold at once.
    """
    if not choosing.subset.names:
        raise click.UsageError("Name what to select: --condition, --cycle, --set, --participant or --trial.")
    check_output(output, demos, force=force)
    contents = read_contents(demos)
    document, notes = as_one(contents)
    everyone = demonstrations_of(document, ", ".join(map(str, demos)))
    chosen = choosing.of(everyone)
    content = some_of(document, {one.id for one in chosen})
    write_json(output, "demonstrations", edited(content, "select", contents, given_words(), output), force=force)
    echo(f"{output}: {len(chosen)} of {counted(len(everyone), 'demonstration')}")
    for line in notes:
        say(line)
