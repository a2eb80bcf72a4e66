"""``navirl study``: the paper's evaluation over the logs of a whole study."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.cluster import workers_of
from navirl_cli.commands.learning import terms_option
from navirl_cli.commands.shared import (
    bytes_bar,
    demonstrations_in,
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    logs_argument,
    merged,
    output_option,
    progress_bar,
    refuse_inputs,
    samples_option,
    say,
    seed_option,
    topic_option,
    topics_by_role,
    workers_options,
)
from navirl_cli.commands.types import Count, FilePath
from navirl_cli.commands.usage import Command, Example, refuse_unused, section
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import Extraction, ExtractSettings
from navirl_cli.demos.recordings import extract_recordings
from navirl_cli.documents.text import to_text
from navirl_cli.errors import ArtefactError
from navirl_cli.files import MANIFEST, Input, check_writable, replacing, swapped_folder
from navirl_cli.irl.selection import whole
from navirl_cli.logs.load import Forces, LoadOptions
from navirl_cli.parallel import keep_freed_memory
from navirl_cli.remote import Remote

if TYPE_CHECKING:
    from navirl_cli.irl.terms.term import Term
    from navirl_cli.reports.study import StudyContext
    from navirl_cli.study.pipeline import Study

REPORT, PAGE, SUMMARY, DEMOS = "report.md", "report.html", "summary.json", "demos.json"


@click.command(
    cls=Command,
    examples=[
        Example("Logs with session records", "navirl study p01.mcap p02.mcap p03.mcap -o study"),
        Example("Demonstrations extracted before", "navirl study demos.json --samples 100 -o study"),
    ],
)
@logs_argument
@section("Input", topic_option)
@section(
    "Questionnaire",
    click.option(
        "--questionnaire", type=FilePath, help="CSV of answers with columns participant,question,modality,answer."
    ),
    click.option("--levels", default=5, show_default=True, type=Count(2, 11), help="Answers are from 1 to this."),
)
@section("Learnt paths", terms_option(), samples_option(), seed_option)
@workers_options
@section(
    "Output",
    output_option("Folder to write; created if it does not exist."),
    json_option,
    force_option,
)
def study(
    logs: tuple[Path, ...],
    output: Path,
    questionnaire: Path | None,
    levels: int,
    terms: tuple["Term", ...],
    samples: int,
    seed: int,
    topics: tuple[tuple[str, str], ...],
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    force: bool,
) -> None:
    """Evaluate a study as the paper does: fits by participant and pooled, figures, claims, report.

    LOG is a log as for navirl extract. Its metadata record navirl.session names the participant, and the condition and
    the cycle of each trial, as in logs written by navirl import-study and navirl simulate. A wrench is not needed. For
    logs that need options of navirl extract, run it first and give its demos.json.

    The first cycle of each participant is fitted from the study's initial parameters, the second cycle from the result
    of the first; then all second cycles together. The folder holds report.md, report.html (the same in one file),
    summary.json (all numbers of the tables), demos.json and figures/.
    """
    from navirl_cli.artefacts.study import study_document
    from navirl_cli.figures.study import draw_study
    from navirl_cli.irl.terms.registry import names_of
    from navirl_cli.reports.study import FIGURES, StudyContext, overview_of, remarks
    from navirl_cli.study.questionnaire import read_answers, shares
    from navirl_cli.study.unseen import pooled_policy

    refuse_unused("--questionnaire", "levels", used=questionnaire is not None)
    answers = [] if questionnaire is None else read_answers(questionnaire, levels)
    bars = shares(answers, levels)
    _check_files(output, [*logs, *filter(None, [questionnaire])], force=force)
    with workers_of(workers, cluster) as executor, swapped_folder(output) as folder, TemporaryDirectory() as screens:
        (folder / "figures").mkdir()
        given = _given(logs, LoadOptions(topics=topics_by_role(topics), forces=Forces.OPTIONAL), executor)
        found, demonstrations = _fitted(given, samples, seed, terms, executor), given.demonstrations
        inputs = [*given.inputs, *map(Input.of, filter(None, [questionnaire]))]
        settings = {"samples": samples, "seed": seed, "levels": levels, "terms": names_of(found.terms)}
        document = {"inputs": [vars(one) for one in inputs], "settings": settings}
        document |= study_document(found, given.cells, bars)
        write_json(folder / SUMMARY, "study", document, force=force)
        kept = demonstrations_document(demonstrations, inputs, asdict(ExtractSettings()))
        write_json(folder / DEMOS, "demonstrations", kept, force=force)
        pooled = pooled_policy(found)
        with progress_bar("draw", len(FIGURES)) as update:
            here = executor if cluster is None else None  # figures are files of this machine
            drawn = draw_study(
                found, pooled, bars, folder / "figures", Path(screens), force=force, progress=update, executor=here
            )
        problems = [line for one in (*found.participants, found.pooled) for line in one.problems]
        lost = [*given.lost, *problems, *pooled.notes]
        notes = [*merged(given.notes), *remarks(demonstrations, answers)]
        context = StudyContext(given.logs, [*notes, *lost], given.cells, drawn, bars, samples, seed)
        _write_report(folder, found, context, force=force)
    if as_json:
        echo_json(document)
    else:
        echo(to_text(overview_of(found, context)))
    for line in notes:
        say(line)
    finish(lost)


@dataclass(frozen=True, eq=False)
class _Given:
    """The content of the user's files."""

    demonstrations: list[Demonstration]
    logs: list[str]
    inputs: list[Input]
    #: Completion times, s, by modality and participant.
    completion_s: dict[str, dict[str, tuple[float, ...]]]
    #: Published paths and whether our cells are the same, and whose they are.
    cells: list[tuple[str, bool]]
    published: set[str]
    #: Notes ("name: text"), and lost data.
    notes: list[str]
    lost: list[str]


def _given(logs: Sequence[Path], options: LoadOptions, executor: Executor) -> _Given:
    """Logs extracted, or the demonstrations of files that extract wrote."""
    if all(_holds_demonstrations(path) for path in logs):
        held = demonstrations_in(*logs)
        demonstrations = whole(held)
        notes = [f"{one.id}: {note}" for one in demonstrations for note in (*one.notes, *one.warnings)]
        lost = [f"left out: {one.id} is cut off" for one in held if one.truncated]
        return _Given(
            demonstrations, [one.name for one in logs], [Input.of(one) for one in logs], {}, [], set(), notes, lost
        )
    with bytes_bar("extract") as update:
        found = extract_recordings(logs, ExtractSettings(), options, executor=executor, progress=update)
    results, demonstrations = found.extractions, found.demonstrations()
    return _Given(
        demonstrations,
        [one.log for one in results],
        list(found.inputs),
        _completion(results),
        [(f"{one.log}: {name}", same) for one in results for name, same in one.published.items()],
        {one.demonstrations[0].participant for one in results if one.published},
        found.notes(demonstrations),
        found.lost,
    )


def _fitted(given: _Given, samples: int, seed: int, terms: tuple["Term", ...], executor: Executor) -> "Study":
    """The study's rewards and numbers, with a progress bar."""
    from navirl_cli.irl.reward import PAPER_TERMS
    from navirl_cli.study.learning import people_of
    from navirl_cli.study.pipeline import study_of

    keep_freed_memory()
    with progress_bar("fit", len(people_of(given.demonstrations)) + 1, line_every=1) as update:
        return study_of(
            given.demonstrations,
            given.completion_s,
            samples,
            seed,
            terms=terms or PAPER_TERMS,
            published=given.published,
            progress=update,
            executor=executor,
        )


def _holds_demonstrations(path: Path) -> bool:
    """Whether a path is one of a demonstrations file, or of a folder of them."""
    return path.suffix == ".json" or (not isinstance(path, Remote) and (path / MANIFEST).is_file())


def _check_files(output: Path, inputs: Sequence[Path], *, force: bool) -> None:
    """Check early that all results can be written, and that none is an input.

    Raises:
        UsageError: One is an input.
        ArtefactError: A file exists already, or cannot be written.
    """
    from navirl_cli.figures.study import FORMATS
    from navirl_cli.reports.study import FIGURES

    names = [output / "figures" / f"{name}.{extension}" for name in FIGURES for extension in FORMATS]
    if output.exists() and not output.is_dir():
        raise ArtefactError(f"{output}: expected the name of a folder, found a file; choose another `output`")
    paths = [*(output / name for name in (REPORT, PAGE, SUMMARY, DEMOS)), *names]
    refuse_inputs(paths, inputs)
    for path in paths:
        if path.parent.is_dir():
            check_writable(path, force=force)


def _completion(results: Sequence[Extraction]) -> dict[str, dict[str, tuple[float, ...]]]:
    """Completion times, s, by modality and participant."""
    times: dict[str, dict[str, tuple[float, ...]]] = {}
    for result in results:
        participant = result.demonstrations[0].participant
        for modality, own in result.completion_s.items():
            known = times.setdefault(modality, {})
            known[participant] = (*known.get(participant, ()), *own)
    return times


def _write_report(output: Path, study: "Study", context: "StudyContext", *, force: bool) -> None:
    """The report as Markdown and as one page."""
    from navirl_cli.documents.markdown import to_markdown
    from navirl_cli.documents.page import to_html
    from navirl_cli.reports.study import report_of

    report = report_of(study, context)
    for name, text in ((REPORT, to_markdown(report, output)), (PAGE, to_html(report))):
        with replacing(output / name, force=force) as temporary:
            temporary.write_text(text, encoding="utf-8")
