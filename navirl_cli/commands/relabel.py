"""``navirl relabel``: other labels for the trials of a demonstrations file."""

from pathlib import Path

import click

from navirl_cli.artefacts.demonstrations import demonstrations_of
from navirl_cli.artefacts.editing import relabelled as relabelled_content
from navirl_cli.artefacts.joined import as_one, read_contents
from navirl_cli.artefacts.steps import edited
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.shared import check_output, demos_argument, echo, force_option, output_option, say
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, given_words, section
from navirl_cli.demos.labels import read_labels
from navirl_cli.demos.relabelling import relabelled
from navirl_cli.errors import Number, counted
from navirl_cli.files import Input


@click.command(
    cls=Command,
    examples=[
        Example("Labels of a table", "navirl relabel demos.json --trials trials.csv -o labelled.json"),
        Example("In place of an older file", "navirl relabel demos.json --trials trials.csv -o labelled.json --force"),
    ],
)
@demos_argument
@section(
    "Labels",
    click.option(
        "--trials",
        type=FilePath,
        required=True,
        help="CSV table with participant, condition, cycle and set of trials, as navirl inspect --trials writes it to "
        "be filled in.",
    ),
)
@section("Output", output_option("Demonstrations file to write."), force_option)
def relabel(demos: tuple[Path, ...], trials: Path, output: Path, force: bool) -> None:
    """Give trials of a demonstrations file other labels, without extracting them again.

    Empty cells change nothing. A new participant renames a trial. Robot radius, people and nominal line change maps
    or paths: for these, extract again with the table.
    """
    check_output(output, [*demos, trials], force=force)
    contents = read_contents(demos)
    document, unlike = as_one(contents)
    before = demonstrations_of(document, ", ".join(map(str, demos)))
    after, notes = relabelled(before, read_labels(trials))
    content = relabelled_content(document, after, Input.of(trials))
    write_json(output, "demonstrations", edited(content, "relabel", contents, given_words(), output), force=force)
    changed = sum(_labels(old) != _labels(new) for old, new in zip(before, after, strict=True))
    echo(f"{output}: {changed} of {counted(len(after), 'demonstration')} {Number(changed):has|have} other labels")
    for line in (*unlike, *notes):
        say(line)


def _labels(one: object) -> tuple[object, ...]:
    """The labels of a demonstration."""
    return tuple(getattr(one, name) for name in ("participant", "condition", "cycle", "set"))
