"""Options that the figures of ``navirl plot`` share: file, width, style, and trial."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.commands import completion
from navirl_cli.commands.choosing import Choosing
from navirl_cli.commands.shared import check_output, force_option, output_option, say
from navirl_cli.commands.types import Choice, FilePath
from navirl_cli.commands.usage import Function, section
from navirl_cli.errors import DemonstrationError, unknown

if TYPE_CHECKING:
    from navirl_cli.artefacts.rewards import LearntReward
    from navirl_cli.demos.demonstration import Demonstration

#: Keys of :data:`navirl_cli.figures.style.LOOKS`, which is imported only to draw a figure.
STYLES = ("paper", "screen", "dark")
#: Keys of :data:`navirl_cli.figures.style.FONTS`.
FONTS = ("sans", "times")
#: Extensions of files; keys of :data:`navirl_cli.figures.sheet.METADATA`.
FORMATS = (".png", ".pdf", ".svg")


@dataclass(frozen=True)
class Page:
    """File and look of a figure."""

    output: Path
    wide: bool
    style: str
    force: bool
    font: str = "sans"

    @property
    def width_in(self) -> float:
        """Width of one column, or of a page with two columns, inches."""
        from navirl_cli.figures.style import COLUMN_IN, PAGE_IN

        return PAGE_IN if self.wide else COLUMN_IN

    @contextmanager
    def look(self) -> Iterator[None]:
        """Draw in the chosen style."""
        from navirl_cli.figures.style import styled

        with styled(self.style, self.font):
            yield

    def save(self, figure: Any, *, trim: bool = True) -> None:
        """Save a figure and print its name; with ``trim`` without empty height."""
        from navirl_cli.figures.sheet import save_figure

        with self.look():
            notes = save_figure(figure, self.output, force=self.force, trim=trim)
        for line in notes:
            say(line)
        click.echo(self.output)

    def draw(
        self,
        draw: Callable[[list[Any]], object],
        *,
        height_in: float | None = None,
        panels: int = 1,
        columns: int | None = None,
    ) -> None:
        """Open a figure, draw on its axes, save it; by default its height follows from its maps."""
        from navirl_cli.figures.sheet import new_figure

        with self.look():
            figure, axes = new_figure(self.width_in, height_in, panels, columns)
            draw(axes)
        self.save(figure, trim=height_in is None)


def page_options(function: Function) -> Function:
    """Options of every figure, as argument ``page``; a file that cannot be written is refused early."""

    @wraps(function)
    def packed(output: Path, wide: bool, style: str, font: str, force: bool, **others: Any) -> Any:
        given = (path for value in others.values() for path in (value if isinstance(value, tuple) else (value,)))
        check_output(output, [path for path in given if isinstance(path, Path)], force=force)
        return function(page=Page(output, wide, style, force, font), **others)

    figure_options = section(
        "Output",
        output_option("Figure to write: .png, .pdf or .svg.", *FORMATS),
        click.option(
            "--wide", is_flag=True, help="Width of a page with two columns (7.16 in) instead of one column (3.5 in)."
        ),
        click.option(
            "--style",
            type=Choice(STYLES),
            default="paper",
            show_default=True,
            help="paper: 300 dpi; screen: 600 dpi; dark: light ink on near-black, 600 dpi.",
        ),
        click.option(
            "--font",
            type=Choice(FONTS),
            default="sans",
            show_default=True,
            help="Letters; times: like those of an IEEE paper.",
        ),
        force_option,
    )
    return figure_options(packed)  # type: ignore[return-value]


crop_option = click.option("--crop", is_flag=True, help="Show only the surroundings of the paths.")
trial_option = click.option(
    "--trial", shell_complete=completion.trials, help="Trial to draw, e.g. p01/3.  [default: the first chosen]"
)
reward_option = click.option("--reward", type=FilePath, required=True, help="Learnt reward.")


def trial_of(demonstrations: Sequence["Demonstration"], trial: str | None) -> "Demonstration":
    """The demonstration of a trial, or the first one.

    Raises:
        DemonstrationError: The trial is unknown.
    """
    for one in demonstrations:
        if trial in {None, one.id}:
            return one
    raise DemonstrationError(unknown("`trial`", trial, [one.id for one in demonstrations]))


def scene_of(
    choosing: Choosing,
    demonstrations: Sequence["Demonstration"],
    rewards: Sequence["LearntReward"],
    trial: str | None,
) -> tuple["Demonstration", list["Demonstration"]]:
    """The trial whose scene is drawn, and the chosen demonstrations; by default the first of these.

    Raises:
        NavirlError: A name is unknown.
    """
    if trial is None:
        return choosing.scene_of(demonstrations, rewards)
    one = trial_of(choosing.subset.of(demonstrations), trial)
    return one, choosing.of(demonstrations, rewards, quiet=True)
