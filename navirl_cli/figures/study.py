"""All figures of a study, as files."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from importlib import import_module
from pathlib import Path

from matplotlib.figure import Figure

from navirl_cli.evaluation.groups import by_group
from navirl_cli.figures import answers, properties, times
from navirl_cli.figures.report import draw_conditions, draw_property_panels, draw_scenes
from navirl_cli.figures.screens import Drawing, save_for_screens
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN
from navirl_cli.parallel import map_in_order
from navirl_cli.reports.study import FIGURES
from navirl_cli.study.pipeline import Study
from navirl_cli.study.questionnaire import Shares
from navirl_cli.study.unseen import PooledPolicy

#: Formats of every figure: for reports, and for papers.
FORMATS = ("png", "pdf")
#: A drawn figure, and whether to remove empty height.
_Drawn = tuple[Figure, bool]


def draw_study(
    study: Study,
    pooled: PooledPolicy,
    bars: Sequence[Shares],
    folder: Path,
    page: Path,
    *,
    force: bool,
    progress: Callable[[int, str], None] | None = None,
    executor: Executor | None = None,
) -> dict[str, Path]:
    """Draw all figures of a study for which it has data.

    Args:
        study: Its results.
        pooled: Where the pooled reward leads.
        bars: Answers to a questionnaire; may be empty.
        folder: Where to write NAME.png and NAME.pdf; names as in :data:`navirl_cli.reports.study.FIGURES`.
        page: Where to write the same for dark and for narrow screens.
        force: Replace existing files. Files of an earlier run without data now are deleted.
        progress: Called with the number of figures drawn and the name of the last.
        executor: Where to draw; by default local processes.

    Returns:
        The .png files of the figures drawn, with the names of :func:`navirl_cli.figures.screens.save_for_screens`.
    """
    # Before other processes begin, so that these need not import it each: it brings what makes subsets of fonts.
    import_module("matplotlib.backends.backend_pdf")
    wanted = _wanted(study, pooled, bars)
    for name in FIGURES if force else ():
        for extension in () if name in wanted else FORMATS:
            (folder / f"{name}.{extension}").unlink(missing_ok=True)
    files: dict[str, Path] = {}
    draw = partial(_saved, folder=folder, page=page, force=force)
    for done, own in enumerate(map_in_order(draw, list(wanted.items()), executor), 1):
        files |= own
        if progress is not None:
            progress(done, next(iter(own)))
    return files


def _saved(job: tuple[str, Drawing], folder: Path, page: Path, *, force: bool) -> dict[str, Path]:
    """Draw one figure and save it for all screens, and as a vector file."""
    return save_for_screens(job[1], job[0], folder, page, formats=FORMATS, force=force)


def _wanted(study: Study, pooled: PooledPolicy, bars: Sequence[Shares]) -> dict[str, Drawing]:
    """The figures for which there are data."""
    wanted: dict[str, Drawing] = {}
    if study.completion_s:
        wanted["fig2_completion_times"] = Drawing(partial(_completion, study), COLUMN_IN)
    by_hand = {
        name: own for name, own in by_group(study.demonstrations).items() if own[0].condition.value != "autonomous"
    }
    alone = {name: own for name, own in by_group(study.demonstrations).items() if name not in by_hand}
    for name, groups in (("fig3_paths", by_hand), ("fig5_replays", alone)):
        if groups:
            wanted[name] = Drawing(partial(draw_conditions, list(groups.items())))
    if bars:
        wanted["fig4_answers"] = Drawing(partial(_answers, bars))
    if study.groups:
        rows = properties.bars_of(study.groups, learnt_from=())
        wanted["fig7_properties"] = Drawing(partial(draw_property_panels, rows))
    for name, scenes in (("fig8_pooled", pooled.seen), ("fig9_unseen", pooled.unseen)):
        if scenes:
            wanted[name] = Drawing(partial(draw_scenes, scenes, study.seconds[0].robot_radius_m))
    return wanted


def _completion(study: Study, width_in: float) -> _Drawn:
    figure, (axes,) = new_figure(width_in, times.HEIGHT_IN)
    every = {modality: [t for own in known.values() for t in own] for modality, known in study.completion_s.items()}
    times.draw_completion_times(axes, every)
    return figure, False


def _answers(bars: Sequence[Shares], width_in: float) -> _Drawn:
    figure, (axes,) = new_figure(width_in, answers.height_for(bars, width_in))
    answers.draw_answers(axes, bars)
    return figure, False
