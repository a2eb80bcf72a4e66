"""Options of the commands that learn: demonstrations, terms, regulariser."""

from collections.abc import Callable
from typing import Any

import click

from navirl_cli.commands import completion
from navirl_cli.commands.choosing import choice_options
from navirl_cli.commands.types import Choice, Number, Terms
from navirl_cli.commands.usage import Function, section
from navirl_cli.irl.fit import PAPER_L2
from navirl_cli.irl.selection import Steps

_steps_options = section(
    "Demonstrations",
    click.option(
        "--truncated", is_flag=True, help="Also use trials that are cut off, which extract --keep-truncated kept."
    ),
    click.option("--only-corrected", is_flag=True, help="Use only trials in which the person intervened."),
    click.option(
        "--steps",
        type=Choice([steps.value for steps in Steps]),
        default=Steps.ALL.value,
        show_default=True,
        help="Use all steps of a path, those during contact, or those during contact or within the person's reach, "
        "where no push is acceptance (reachable).",
    ),
    click.option(
        "--reach",
        type=Number(0.1, 100),
        help="Reach of people, between the centres of robot and person, m.  [default: the largest distance at which "
        "people pushed]",
    ),
)


def selection_options(function: Function) -> Function:
    """Which demonstrations and steps a reward is learnt from; those of :func:`choice_options` as ``choosing``."""
    return choice_options(reward=False)(_steps_options(function))


l2_option = click.option(
    "--l2",
    default=PAPER_L2,
    show_default=True,
    type=Number(0, 1e6),
    help="Weight of the regulariser, nats: l2/2 times the sum of squares of the parameters, those per metre in units "
    "of 10 /m, without the parameters that a prior determines; 0 for none.",
)


def terms_option(name: str = "terms", **options: Any) -> Callable[[Function], Function]:
    """``--terms``.

    Args:
        name: The argument of the command.
        options: Further options of click.
    """
    return click.option(
        "--terms",
        name,
        metavar="NAME,...",
        type=Terms(),
        shell_complete=completion.terms,
        **{
            "default": (),
            "help": "Terms whose sum the reward is: length, deviation, personal-space, saturating-deviation, "
            "anisotropic-space, length-space, turn, an installed term, or one of a Python file as my_term.py:MyTerm.  "
            "[default: length,deviation,personal-space]",
            **options,
        },
    )
