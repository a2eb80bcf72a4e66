"""All figures of a study, as files."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.groups import by_group
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.figures import answers, properties, times
from navirl_cli.figures.conditions import draw_path_panels
from navirl_cli.figures.layout import settle
from navirl_cli.figures.policies import TitledScene, draw_policy_and_reward
from navirl_cli.figures.sheet import new_figure, save_figure
from navirl_cli.figures.style import COLUMN_IN, PAGE_IN
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
        force: Replace existing files. Files of an earlier run without data now are deleted.
        progress: Called with the number of figures drawn and the name of the last.
        executor: Where to draw; by default local processes.

    Returns:
        The .png file of each figure drawn.
    """
    wanted = _wanted(study, pooled, bars)
    for name in FIGURES if force else ():
        for extension in () if name in wanted else FORMATS:
            (folder / f"{name}.{extension}").unlink(missing_ok=True)
    paths = {}
    for name in map_in_order(partial(_saved, folder=folder, force=force), list(wanted.items()), executor):
        paths[name] = folder / f"{name}.png"
        if progress is not None:
            progress(len(paths), name)
    return paths


def _saved(job: tuple[str, Callable[[], _Drawn]], folder: Path, *, force: bool) -> str:
    """Draw one figure and save it in all formats."""
    name, draw = job
    figure, trim = draw()
    settle(figure, trim=trim)
    for extension in FORMATS:
        save_figure(figure, folder / f"{name}.{extension}", force=force, trim=False)
    return name


def _wanted(study: Study, pooled: PooledPolicy, bars: Sequence[Shares]) -> dict[str, Callable[[], _Drawn]]:
    """The figures for which there are data."""
    wanted: dict[str, Callable[[], _Drawn]] = {}
    if study.completion_s:
        wanted["fig2_completion_times"] = partial(_completion, study)
    by_hand = {
        name: own for name, own in by_group(study.demonstrations).items() if own[0].condition.value != "autonomous"
    }
    alone = {name: own for name, own in by_group(study.demonstrations).items() if name not in by_hand}
    for name, groups in (("fig3_paths", by_hand), ("fig5_replays", alone)):
        if groups:
            wanted[name] = partial(_paths, list(groups.items()))
    if bars:
        wanted["fig4_answers"] = partial(_answers, bars)
    if study.groups:
        wanted["fig7_properties"] = partial(_properties, study)
    for name, scenes in (("fig8_pooled", pooled.seen), ("fig9_unseen", pooled.unseen)):
        if scenes:
            wanted[name] = partial(_policies, scenes, study.seconds[0].robot_radius_m)
    return wanted


def _completion(study: Study) -> _Drawn:
    figure, (axes,) = new_figure(COLUMN_IN, times.HEIGHT_IN)
    every = {modality: [t for own in known.values() for t in own] for modality, known in study.completion_s.items()}
    times.draw_completion_times(axes, every)
    return figure, False


def _paths(panels: Sequence[tuple[str, Sequence[Demonstration]]]) -> _Drawn:
    figure, axes = new_figure(PAGE_IN, panels=len(panels), columns=min(2, len(panels)))
    draw_path_panels(axes, panels)
    return figure, True


def _answers(bars: Sequence[Shares]) -> _Drawn:
    figure, (axes,) = new_figure(PAGE_IN, answers.height_for(bars, PAGE_IN))
    answers.draw_answers(axes, bars)
    return figure, False


def _properties(study: Study) -> _Drawn:
    bars = properties.bars_of(study.groups, learnt_from=())
    figure, axes = new_figure(PAGE_IN, properties.height_for(bars, PAGE_IN), len(PAPER_METRICS))
    properties.draw_properties(axes, bars)
    return figure, False


def _policies(scenes: Sequence[TitledScene], robot_radius_m: float) -> _Drawn:
    figure, axes = new_figure(PAGE_IN, panels=2 * len(scenes), columns=2)
    draw_policy_and_reward(axes, scenes, robot_radius_m)
    return figure, True
