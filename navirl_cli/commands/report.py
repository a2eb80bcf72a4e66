"""``navirl report``: one page on demonstrations and the reward learnt from them."""

from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from navirl_cli.artefacts.joined import read_content
from navirl_cli.artefacts.rewards import check_cells, learnt_of, reward_content
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
from navirl_cli.commands.usage import Command, Example, as_options, section
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.documents.document import Block, Bullets
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.files import Input, replacing


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
    import numpy as np

    from navirl_cli.documents.page import to_html
    from navirl_cli.evaluation.compare import compare
    from navirl_cli.evaluation.ranks import ranking
    from navirl_cli.figures.report import draw_report
    from navirl_cli.irl.scene import scenes_of
    from navirl_cli.irl.solved import solved
    from navirl_cli.reports.made import Made, changed_settings, subset_words
    from navirl_cli.reports.reward import METRICS, report_of

    check_output(output, [*demos, reward], force=force)
    everyone = demonstrations_in(*demos)
    content = reward_content(reward, person)
    learnt = learnt_of(content, str(reward))
    check_cells(learnt, everyone, str(reward))
    demonstrations = choosing.of(everyone, [learnt])
    rng = np.random.default_rng(seed)
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
        figures = draw_report(
            demonstrations, learnt.reward.parameters, shown, result.groups, learnt.profiles, Path(folder)
        )
        extracted, _ = read_content(demos)
        made_from = [*extracted["inputs"], *(vars(Input.of(path)) for path in (*demos, reward))]
        logs = tuple(one["file"] for one in extracted["inputs"])
        changed = changed_settings(extracted["settings"], asdict(ExtractSettings()))
        asked = [*subset_words(choosing.subset), *(["--all"] if choosing.everything else [])]
        asked += ["--person", person] if person is not None else []
        asked += ["--samples", str(samples), "--seed", str(seed)]
        made = Made(tuple(map(_name, demos)), reward.name, logs, changed, tuple(asked), seed, everyone)
        found = report_of(demonstrations, learnt, content, result, ranked, figures, made_from, made)
        page = to_html(replace(found, blocks=tuple(map(_with_options, found.blocks))))
    with replacing(output, force=force) as temporary:
        temporary.write_text(page, encoding="utf-8")
    click.echo(output)
    finish(result.notes)


def _name(path: Path) -> str:
    """The name of a file, or of a folder as extract takes it."""
    return f"{path.resolve().name}/" if path.is_dir() else path.name


def _with_options(block: Block) -> Block:
    """A list of the page with arguments shown as options; running text holds formulas, and stays."""
    return Bullets(tuple(map(as_options, block.items))) if isinstance(block, Bullets) else block
