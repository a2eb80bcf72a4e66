"""``navirl import-study``: the published user study as logs."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    progress_bar,
    refuse_inputs,
    say,
)
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import written
from navirl_cli.errors import ArtefactError


@click.command(
    "import-study",
    cls=Command,
    examples=[
        Example("The published archive", "navirl import-study runs.tar.gz -o logs"),
        Example("For a program", "navirl import-study runs.tar.gz -o logs --json"),
    ],
)
@click.argument("runs", type=FilePath)
@section(
    "Output",
    output_option("Folder of the logs; created if it does not exist."),
    json_option,
    force_option,
)
def import_study(runs: Path, output: Path, as_json: bool, force: bool) -> None:
    """Turn the published user study (RUNS) into logs.

    RUNS is the archive runs.tar.gz that the paper's authors publish, the folder into which it was unpacked, or the
    folder of one participant. The study has neither times nor forces. Times follow from a speed of 0.4 m/s, and extract
    needs --no-wrench. Otherwise the logs are as a robot would have recorded them. The metadata record navirl.published
    holds the published cells. The study's pickles are parsed as data and never executed.
    """
    from navirl_cli.published.log import write_logs
    from navirl_cli.published.runs import runs_in
    from navirl_cli.reports.logs import imported_document, imported_table

    found, lost = runs_in(runs)
    refuse_inputs([output / f"{run.name}.mcap" for run in found], [runs] if runs.is_file() else [])
    with progress_bar("import-study", len(found)) as update:
        imported = write_logs(found, output, force=force, progress=update)
    lost += [line for one in imported for line in one.lost]
    logs = [one for one in imported if one.path is not None]
    if not logs:
        for line in lost:
            say(line)
        raise ArtefactError(
            f"{runs}: expected published files of the study, found none that can be used; fetch them again"
        )
    if as_json:
        echo_json(imported_document(logs, lost))
    else:
        echo(written(imported_table(logs)))
    say(f"the study has no forces: extract needs --no-wrench for these logs; navirl study {output} evaluates them")
    finish(lost)
