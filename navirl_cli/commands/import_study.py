"""``navirl import-study``: the published user study as logs."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click

from navirl_cli.commands.shared import echo_json, finish, force_option, json_option, output_option, progress_bar, say
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import Cell, Column, Table, written
from navirl_cli.errors import ArtefactError
from navirl_cli.files import check_writable, new_folder
from navirl_cli.parallel import map_in_order
from navirl_cli.published.runs import Run, runs_in


@dataclass(frozen=True)
class _Imported:
    """One participant's log; no path where nothing could be used."""

    participant: str
    lost: tuple[str, ...]
    path: Path | None = None
    trials: int = 0
    completion_s: dict[str, tuple[float, ...]] | None = None
    size_bytes: int = 0


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
def import_study(runs: Path, output: Path, force: bool, as_json: bool) -> None:
    """Turn the published user study (RUNS) into logs.

    RUNS is the archive runs.tar.gz that the paper's authors publish, the folder into which it was unpacked, or the
    folder of one participant. The study has neither times nor forces: positions are laid out at 0.4 m/s, and extract
    needs --no-wrench. Otherwise the logs are what a robot would have recorded. The metadata record navirl.published
    holds the published cells. The study's pickles are parsed as data and never executed.
    """
    found, lost = runs_in(runs)
    jobs = [(number, run, output / f"{run.name}.mcap") for number, run in enumerate(found)]
    imported = []
    with new_folder(output), progress_bar("import-study", len(jobs)) as update:
        for _, _, path in jobs:
            check_writable(path, force=force)
        for one in map_in_order(partial(_imported, force=force), jobs):
            imported.append(one)
            update(len(imported), one.participant)
    lost += [line for one in imported for line in one.lost]
    logs = [one for one in imported if one.path is not None]
    if not logs:
        for line in lost:
            say(line)
        raise ArtefactError(
            f"{runs}: expected the study's published files, found nothing that can be used; fetch them anew"
        )
    if as_json:
        echo_json({"logs": [_document(one) for one in logs], "lost": lost})
    else:
        click.echo(written(Table(_COLUMNS, tuple(map(_row, logs)))))
    finish(lost)


def _imported(job: tuple[int, Run, Path], force: bool) -> _Imported:
    """Write one participant's log."""
    from navirl_cli.published.log import write_log
    from navirl_cli.published.participant import participant_of

    number, run, path = job
    try:
        participant = participant_of(run)
    except ArtefactError as error:
        return _Imported(run.name, (str(error),))
    write_log(participant, number, path, force=force)
    times = dict(participant.completion_s)
    return _Imported(run.name, participant.lost, path, len(participant.paths), times, path.stat().st_size)


_COLUMNS = (
    Column("log"),
    Column("trials"),
    Column("completion_s", "course completed in"),
    Column("size_bytes", "size MB", decimals=2, scale=1e-6),
)


def _row(one: _Imported) -> tuple[Cell, ...]:
    """Of the table."""
    times = [f"{modality} {s:.1f} s" for modality, several in (one.completion_s or {}).items() for s in several]
    return str(one.path), one.trials, ", ".join(times) or "not known", one.size_bytes


def _document(one: _Imported) -> dict[str, object]:
    """For scripts."""
    return {
        "log": str(one.path),
        "participant": one.participant,
        "trials": one.trials,
        "completion_s": one.completion_s,
        "size_bytes": one.size_bytes,
    }
