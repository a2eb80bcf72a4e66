"""Which demonstrations a question about a reward is about, where the user does not say."""

from collections.abc import Sequence
from dataclasses import dataclass

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import ArgumentError, counted
from navirl_cli.evaluation.groups import Trained, evidence_group_of


@dataclass(frozen=True, eq=False)
class Chosen:
    """The demonstrations, and in one line why these."""

    demonstrations: tuple[Demonstration, ...]
    #: Empty where the user chose them, or where all are meant.
    note: str = ""


def check_choice(subset: Subset, *, everything: bool) -> None:
    """Refuse a choice of some and all demonstrations.

    Raises:
        ArgumentError: Both are named.
    """
    if everything and subset.names:
        raise ArgumentError(f"`all` takes all demonstrations; leave out `{next(iter(subset.names))}`")


def choose(
    demonstrations: Sequence[Demonstration],
    subset: Subset,
    trained: Sequence[Trained | None] = (),
    *,
    everything: bool = False,
    also: Sequence[Demonstration] = (),
) -> Chosen:
    """Choose demonstrations: those that the user names, else those that rewards were learnt from, else all.

    Args:
        demonstrations: Of a file.
        subset: The user's choice.
        trained: What each reward was learnt from; None where that is unknown.
        everything: All demonstrations, whatever the rewards were learnt from.
        also: Demonstrations to compare with, besides those learnt from.

    Raises:
        ArgumentError: The user names some and all.
        DemonstrationError: As of :meth:`Subset.of`.
    """
    check_choice(subset, everything=everything)
    if subset.names:
        return Chosen(tuple(subset.of(demonstrations)))
    known = [one for one in trained if one is not None]
    if everything or not known or len(known) < len(trained):
        return Chosen(tuple(demonstrations))
    ids = frozenset().union(*(one.ids for one in known))
    named = frozenset(one.id for one in also)
    own = [one for one in demonstrations if one.id in ids]
    if own:
        kept = tuple(one for one in demonstrations if one.id in ids | named)
        return Chosen(
            kept, _said(kept, demonstrations, "those that the reward was learnt from", also=len(kept) > len(own))
        )
    groups = frozenset().union(*(one.groups for one in known))
    kept = tuple(one for one in demonstrations if evidence_group_of(one) in groups or one.id in named)
    if not any(evidence_group_of(one) in groups for one in kept):
        listed = " / ".join(sorted(groups))
        return Chosen(
            tuple(demonstrations), f"no demonstration is like those that the reward was learnt from ({listed})"
        )
    return Chosen(kept, _said(kept, demonstrations, "new ones like those that the reward was learnt from"))


def _said(
    kept: Sequence[Demonstration], demonstrations: Sequence[Demonstration], which: str, *, also: bool = False
) -> str:
    """The line about a choice; empty where it leaves nothing out."""
    if len(kept) == len(demonstrations):
        return ""
    others = ", and those to compare with" if also else ""
    return (
        f"{len(kept)} of {counted(len(demonstrations), 'demonstration')}: {which}{others}; `all` takes the others too"
    )
