"""``navirl report``: one page on demonstrations and the reward learnt from them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.artefacts.demonstrations import settings_document
from navirl_cli.artefacts.joined import as_one, read_contents
from navirl_cli.artefacts.rewards import LearntReward, check_cells, learnt_of, reward_content
from navirl_cli.artefacts.steps import names_of, steps_of
from navirl_cli.commands.choosing import Choosing, choice_options
from navirl_cli.commands.shared import (
    check_output,
    demonstrations_in,
    demos_argument,
    finish,
    force_option,
    output_option,
    person_option,
    progress_bar,
    samples_option,
    seed_option,
)
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, as_options, given_words, section
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.documents.document import Block, Bullets
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.files import Input, replacing
from navirl_cli.logs.load import LoadOptions

if TYPE_CHECKING:
    from navirl_cli.reports.made import Made


@click.command(
    cls=Command,
    examples=[
        Example("A page to send to a colleague", "navirl report demos.json reward.json -o report.html"),
        Example("A quick look", "navirl report demos.json reward.json --samples 50 -o report.html --force"),
    ],
)
@demos_argument
@click.argument("reward", type=FilePath)
@choice_options(reward=True)
@section("Learnt paths", person_option, samples_option(), seed_option)
@section("Output", output_option("Page to write: .html.", ".html"), force_option)
def report(
    demos: tuple[Path, ...],
    reward: Path,
    choosing: Choosing,
    person: str | None,
    output: Path,
    samples: int,
    seed: int,
    force: bool,
) -> None:
    """Write one self-contained HTML page on demonstrations and the reward learnt from them.

    The page has the parameters with intervals and their meaning in metres, warnings, metrics of driven and learnt
    paths, how typical the demonstrations are of the policy, figures, trials, and the files with their hashes. It has a
    light and a dark style, for screens, phones and paper; tables can be sorted, figures enlarged.
    """
    check_output(output, [*demos, reward], force=force)
    everyone = demonstrations_in(*demos)
    content = reward_content(reward, person)
    learnt = learnt_of(content, str(reward))
    check_cells(learnt, everyone, str(reward))
    demonstrations = choosing.of(everyone, [learnt])
    made = _made(demos, reward, everyone, seed)
    page, lost = _page(demonstrations, learnt, content, made, samples)
    with replacing(output, force=force) as temporary:
        temporary.write_text(page, encoding="utf-8")
    click.echo(output)
    finish(lost)


def _page(
    demonstrations: Sequence[Demonstration],
    learnt: LearntReward,
    content: Mapping[str, Any],
    made: "Made",
    samples: int,
) -> tuple[str, Sequence[str]]:
    """The page, and what of the measured paths is lost."""
    import numpy as np

    from navirl_cli.documents.page import to_html
    from navirl_cli.evaluation.compare import compare
    from navirl_cli.evaluation.ranks import ranking
    from navirl_cli.figures.report import draw_report
    from navirl_cli.irl.scene import scenes_of
    from navirl_cli.irl.solved import solved
    from navirl_cli.reports.reward import METRICS, report_of

    rng = np.random.default_rng(made.seed)
    with progress_bar("evaluate", len(demonstrations)) as update:
        result = compare(
            demonstrations,
            {"learnt": learnt.reward},
            Precision(samples),
            rng,
            metrics=METRICS,
            progress=lambda done, _all: update(done, ""),
        )
    ranked = ranking(demonstrations, learnt.reward, learnt.trained(demonstrations), samples, rng)
    taught = [one for one in demonstrations if one.id in learnt.demonstrations] or demonstrations
    shown = taught[0], solved(learnt.reward, scenes_of(taught[:1])[0])
    with TemporaryDirectory() as folder:
        parameters = learnt.reward.parameters
        figures = draw_report(demonstrations, parameters, shown, result.groups, learnt.profiles, Path(folder))
        found = report_of(demonstrations, learnt, content, result, ranked, figures, made)
        return to_html(replace(found, blocks=tuple(map(_with_options, found.blocks)))), result.notes


def _made(demos: Sequence[Path], reward: Path, everyone: Sequence[Demonstration], seed: int) -> "Made":
    """The files of the page, and the options by which they were made."""
    from navirl_cli.reports.made import Made

    contents, names = read_contents(demos), names_of(demos)
    extracted, _ = as_one(contents)
    return Made(
        demos=tuple(map(Input.of, demos)),
        reward=Input.of(reward),
        inputs=[Input(**one) for one in extracted["inputs"]],
        settings=extracted["settings"],
        usual=settings_document(ExtractSettings(), LoadOptions(), None, None),
        options=tuple(given_words()),
        seed=seed,
        everyone=everyone,
        names=names,
        steps=steps_of(names, contents.values()),
    )


def _with_options(block: Block) -> Block:
    """A list of the page with arguments shown as options; running text holds formulas, and stays."""
    return Bullets(tuple(map(as_options, block.items))) if isinstance(block, Bullets) else block
