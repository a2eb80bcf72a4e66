"""``navirl annotate``: labels of trials into a copy of a log."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    bytes_bar,
    check_output,
    echo,
    echo_json,
    finish,
    force_option,
    frame_option,
    goal_option,
    json_option,
    namespace_option,
    output_option,
    say,
    split_option,
    topic_option,
    topics_by_role,
)
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.demos.annotate import annotate as annotated
from navirl_cli.demos.labels import read_labels
from navirl_cli.demos.listing import TrialSettings
from navirl_cli.demos.trials import Split
from navirl_cli.errors import counted
from navirl_cli.logs.load import LoadOptions


@click.command(
    cls=Command,
    examples=[
        Example("Labels into a copy of a log", "navirl annotate p01.mcap trials.csv -o labelled.mcap"),
        Example("A copy that is compressed", "navirl annotate p01.mcap trials.csv -o labelled.mcap.zst"),
    ],
)
@click.argument("log", type=FilePath)
@click.argument("trials", type=FilePath)
@section("Input", topic_option, namespace_option, frame_option)
@section("Trials", split_option, goal_option)
@section("Output", output_option("Log to write; for a folder, a new folder."), json_option, force_option)
def annotate(
    log: Path,
    trials: Path,
    output: Path,
    topics: tuple[tuple[str, str], ...],
    namespace: str | None,
    frame: str | None,
    split: str,
    goal: tuple[float, float] | None,
    as_json: bool,
    force: bool,
) -> None:
    """Write the labels of trials into a copy of a log.

    The copy keeps the labels, so that navirl extract needs no table for it. TRIALS is a table as navirl inspect
    --trials writes it, filled in. LOG is an MCAP file or a rosbag2 folder. The copy holds all that the log holds, byte
    by byte, and a metadata record navirl.session with the labels. An existing record stays in the file, and the new
    one, which also holds what the table leaves empty, counts in its place.

    The copy of a file is compressed if its name ends in .zst or .lz4. Of a folder, all files are copied.
    """
    if not log.is_dir():
        check_output(output, [log, trials], force=force)
    options = LoadOptions(topics=topics_by_role(topics), namespace=namespace, frame=frame)
    with bytes_bar("annotate") as update:
        found = annotated(
            log, read_labels(trials), output, TrialSettings(Split(split), goal), options, force=force, progress=update
        )
    if as_json:
        echo_json({"log": str(found.path), "trials": found.trials, "labelled": found.labelled})
    else:
        echo(f"{found.path}: {found.labelled} of {counted(found.trials, 'trial')} labelled")
    for note in found.notes:
        say(note)
    finish(found.damage)
