"""Options that choose demonstrations, the same for every command."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any

import click

from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.commands import completion
from navirl_cli.commands.shared import say
from navirl_cli.commands.types import Choice, Count
from navirl_cli.commands.usage import Function, section
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.subset import Subset
from navirl_cli.evaluation.choice import check_choice, choose

#: click's names of the options of :func:`choice_options`.
NAMES = ("conditions", "cycles", "sets", "participants", "trials", "everything")


@dataclass(frozen=True)
class Choosing:
    """The user's choice of demonstrations."""

    subset: Subset
    everything: bool = False

    def of(
        self,
        demonstrations: Sequence[Demonstration],
        rewards: Sequence[LearntReward] = (),
        *,
        also: Sequence[Demonstration] = (),
        quiet: bool = False,
    ) -> list[Demonstration]:
        """The chosen demonstrations; a line on stderr says where the rewards decide it.

        Args:
            demonstrations: Of the file.
            rewards: By default those that these were learnt from are chosen.
            also: Demonstrations to compare with, besides by default.
            quiet: Without the line.

        Raises:
            NavirlError: As of :func:`~navirl_cli.evaluation.choice.choose`.
        """
        trained = [one.trained(demonstrations) for one in rewards]
        found = choose(demonstrations, self.subset, trained, everything=self.everything, also=also)
        if found.note and not quiet:
            say(found.note)
        return list(found.demonstrations)

    def scene_of(
        self, demonstrations: Sequence[Demonstration], rewards: Sequence[LearntReward], *, quiet: bool = False
    ) -> tuple[Demonstration, list[Demonstration]]:
        """The demonstration whose scene is meant, the first chosen one, and all chosen ones; arguments as :meth:`of`.

        Raises:
            NavirlError: As of :func:`~navirl_cli.evaluation.choice.choose`.
        """
        trained = [one.trained(demonstrations) for one in rewards]
        found = choose(demonstrations, self.subset, trained, everything=self.everything)
        first = found.demonstrations[0]
        if found.note and not quiet:
            said = f"the first of {found.note}" if len(found.demonstrations) < len(demonstrations) else found.note
            say(f"scene of {first.id}, {said}, `trial` another")
        return first, list(found.demonstrations)


def choice_options(
    *, reward: bool, trial: bool = True, title: str = "Demonstrations"
) -> Callable[[Function], Function]:
    """``--condition --cycle --set --participant --trial --all`` as one argument ``choosing``, a :class:`Choosing`.

    Args:
        reward: The command takes rewards: by default those demonstrations that they were learnt from are chosen, and
            ``--all`` chooses all.
        trial: With ``--trial``. Commands that show one trial have their own.
        title: Section of the help.
    """

    def decorate(function: Function) -> Function:
        @wraps(function)
        def packed(
            conditions: tuple[str, ...],
            cycles: tuple[int, ...],
            sets: tuple[str, ...],
            participants: tuple[str, ...],
            trials: tuple[str, ...] = (),
            everything: bool = False,
            **others: Any,
        ) -> Any:
            subset = Subset(conditions, cycles, sets, participants, trials)
            check_choice(subset, everything=everything)
            return function(choosing=Choosing(subset, everything), **others)

        chosen = section(title, *_OPTIONS, *([_TRIAL] if trial else []), *([_ALL] if reward else []))
        return chosen(packed)  # type: ignore[return-value]

    return decorate


_OPTIONS = (
    click.option(
        "--condition",
        "conditions",
        multiple=True,
        type=Choice([condition.value for condition in Condition]),
        help="Only trials of this condition; repeatable.",
    ),
    click.option(
        "--cycle",
        "cycles",
        multiple=True,
        type=Count(1),
        shell_complete=completion.cycles,
        help="Only trials of this cycle; repeatable.",
    ),
    click.option(
        "--set",
        "sets",
        multiple=True,
        shell_complete=completion.sets,
        help="Only trials of this set, e.g. 'obstacle avoidance', or 'main task' for those of none; repeatable.",
    ),
    click.option(
        "--participant",
        "participants",
        multiple=True,
        shell_complete=completion.participants,
        help="Only trials of this participant; repeatable.",
    ),
)
_TRIAL = click.option(
    "--trial",
    "trials",
    multiple=True,
    shell_complete=completion.trials,
    help="Only this trial, e.g. p01/3; repeatable.",
)
_ALL = click.option(
    "--all",
    "everything",
    is_flag=True,
    help="All trials.  [default: those that the reward was learnt from]",
)
