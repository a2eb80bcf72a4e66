"""``navirl study``: the paper's evaluation over the logs of a whole study."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import Input, write_json
from navirl_cli.commands.extraction import all_extracted
from navirl_cli.commands.shared import (
    FilePath,
    echo_json,
    finish,
    force_option,
    json_option,
    merged,
    output_option,
    progress_bar,
    say,
    seed_option,
    text_table,
    topic_option,
    topics_by_role,
)
from navirl_cli.demos.extract import Extraction, ExtractSettings, numbered
from navirl_cli.files import check_writable, make_folder, replacing
from navirl_cli.logs.load import Forces, LoadOptions

if TYPE_CHECKING:
    from navirl_cli.study.pipeline import Study
    from navirl_cli.study.text import Told

REPORT, PAGE, SUMMARY, DEMOS = "report.md", "report.html", "summary.json", "demos.json"


@click.command()
@click.argument("logs", nargs=-1, required=True, type=FilePath)
@output_option("Folder for report, figures and numbers; made where it is missing.")
@click.option("--questionnaire", type=FilePath, help="CSV of answers: participant,question,modality,answer.")
@click.option("--levels", default=5, show_default=True, type=click.IntRange(2, 11), help="Of an answer: 1 to this.")
@click.option(
    "--samples",
    default=1000,
    show_default=True,
    type=click.IntRange(2, 100_000),
    help="Paths drawn from each learnt policy in each scene.",
)
@seed_option
@topic_option
@json_option
@force_option
def study(
    logs: tuple[Path, ...],
    output: Path,
    questionnaire: Path | None,
    levels: int,
    samples: int,
    seed: int,
    topics: tuple[tuple[str, str], ...],
    as_json: bool,
    force: bool,
) -> None:
    """Evaluate a study as the paper does: fits by participant and pooled, figures, claims, report.

    LOG is what navirl extract takes; its metadata record navirl.session says participant, and condition and cycle of
    each trial, as in logs that navirl import-study and navirl simulate write. A log needs no wrench.

    Each participant's first cycle is fitted from the study's initial parameters, the second from the first's result,
    and all second cycles together. Writes report.md, report.html (the same in one file), summary.json (every number of
    the tables), demos.json and figures/.
    """
    from navirl_cli.figures.study import draw_study
    from navirl_cli.study.pipeline import study_of
    from navirl_cli.study.questionnaire import read_answers, shares
    from navirl_cli.study.summary import study_document
    from navirl_cli.study.text import FIGURES, Told

    bars = [] if questionnaire is None else shares(read_answers(questionnaire, levels), levels)
    figures = _folder(output, force=force)
    options = LoadOptions(topics=topics_by_role(topics), forces=Forces.OPTIONAL)
    good, failed = all_extracted(logs, ExtractSettings(), options, join=False)
    results = [result for _, result in good]
    demonstrations = numbered(results)
    cells = {f"{one.log}: {name}": same for one in results for name, same in one.published.items()}
    with progress_bar("fit", len({one.participant for one in demonstrations}) + 1) as update:
        found = study_of(demonstrations, _completion(results), samples, seed, published=bool(cells), progress=update)
    inputs = [*(file for files, _ in good for file in files), *map(Input.of, filter(None, [questionnaire]))]
    settings = {"samples": samples, "seed": seed, "levels": levels}
    document = {"inputs": [vars(one) for one in inputs], "settings": settings, **study_document(found, cells)}
    write_json(output / SUMMARY, "study", document, force=force)
    kept = demonstrations_document(demonstrations, inputs, asdict(ExtractSettings()))
    write_json(output / DEMOS, "demonstrations", kept, force=force)
    with progress_bar("draw", len(FIGURES)) as update:
        drawn, missing = draw_study(found, bars, figures, force=force, progress=update)
    lost = [*failed, *(line for one in results for line in (*one.damage, *one.skipped)), *_trouble(found), *missing]
    notes = merged(note for one in results for note in one.notes)
    told = Told([one.log for one in results], [*notes, *lost], cells, drawn, samples, seed)
    _write_report(output, found, told, force=force)
    if as_json:
        echo_json(document)
    else:
        click.echo(_overview(found, told))
    for line in notes:
        say(line)
    finish(lost)


def _folder(output: Path, *, force: bool) -> Path:
    """Make the folders, and refuse early what could not be written at the end.

    Raises:
        ArtefactError: A folder cannot be made, or a file exists already.
    """
    from navirl_cli.figures.study import FORMATS
    from navirl_cli.study.text import FIGURES

    figures = make_folder(output / "figures")
    names = [figures / f"{name}.{extension}" for name in FIGURES for extension in FORMATS]
    for path in (*(output / name for name in (REPORT, PAGE, SUMMARY, DEMOS)), *names):
        check_writable(path, force=force)
    return figures


def _completion(results: Sequence[Extraction]) -> dict[str, dict[str, tuple[float, ...]]]:
    """Times in which the course was completed, s, by modality and participant."""
    times: dict[str, dict[str, tuple[float, ...]]] = {}
    for result in results:
        participant = result.demonstrations[0].participant
        for modality, own in result.completion_s.items():
            known = times.setdefault(modality, {})
            known[participant] = (*known.get(participant, ()), *own)
    return times


def _trouble(study: "Study") -> list[str]:
    """What could not be learnt."""
    return [line for one in (*study.participants, study.pooled) for line in one.trouble]


def _write_report(output: Path, study: "Study", told: "Told", *, force: bool) -> None:
    """The report as Markdown and as one page."""
    from navirl_cli.reports.markdown import to_markdown
    from navirl_cli.reports.page import to_html
    from navirl_cli.study.text import report_of

    report = report_of(study, told)
    for name, text in ((REPORT, to_markdown(report, output)), (PAGE, to_html(report))):
        with replacing(output / name, force=force) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _overview(study: "Study", told: "Told") -> str:
    """The learnt rewards and the verdicts, as text."""
    from navirl_cli.study.tables import rewards_table
    from navirl_cli.study.text import claims_lines

    table = rewards_table(study)
    lines = [text_table(table.header, table.rows), "", *claims_lines(study.claims)]
    if told.cells:
        lines += ["", f"cells as published: {sum(told.cells.values())} of {len(told.cells)} paths"]
    return "\n".join(lines)
