"""Ranks of demonstrations among paths of a policy, in words and tables."""

from collections.abc import Sequence

import numpy as np

from navirl_cli.documents.tables import Column, Table
from navirl_cli.errors import counted
from navirl_cli.evaluation.ranks import EXTREME, RARE, Rank, Ranking, by_group_and_training

_DECIMALS = 3
_NOTE = (
    "Rank: share of the policy's own paths that are less likely than the demonstration; by distance: that pass people "
    "nearer; by area: with a smaller area. Paths through the centres of cells."
)
_TEST = (
    "Ranks are uniform if the policy is right: Kolmogorov and Smirnov's D by log-likelihood, and medians of all three."
)


def group_ranks_table(ranks: Sequence[Rank]) -> Table:
    """One row for each group, and for its participants held out."""
    columns = (
        Column("group"),
        Column("n"),
        Column("statistic", "D", _DECIMALS),
        Column("p_value", "p", _DECIMALS),
        Column("median_rank", "median rank", 2),
        Column("median_distance_rank", "by distance", 2),
        Column("median_area_rank", "by area", 2),
        Column("fit_badly", "fit badly"),
    )
    rows = []
    for own in by_group_and_training(ranks):
        distances = [one.distance_rank for one in own.ranks if one.distance_rank is not None]
        rows.append(
            (
                own.name,
                len(own.ranks),
                *own.uniformity(),
                float(np.median([one.rank for one in own.ranks])),
                float(np.median(distances)) if distances else None,
                float(np.median([one.area_rank for one in own.ranks])),
                sum(one.fits_badly for one in own.ranks),
            )
        )
    return Table(columns, tuple(rows), "Ranks of demonstrations among the policy's paths, by group", _TEST)


def rank_table(ranks: Sequence[Rank], learnt_from: Sequence[str] | None = None) -> Table:
    """One row for each demonstration.

    Args:
        ranks: Of the demonstrations.
        learnt_from: Ids of those that the reward was learnt from, for a column that says so; None for no column.
    """
    columns = (
        Column("demonstration"),
        Column("group"),
        Column("log_likelihood", "log-likelihood nats", _DECIMALS),
        Column("rank", decimals=_DECIMALS),
        Column("distance_rank", "by distance", _DECIMALS),
        Column("area_rank", "by area", _DECIMALS),
        *([] if learnt_from is None else [Column("learnt_from", "learnt from")]),
    )
    rows = tuple(
        (
            one.id,
            one.group,
            one.log_likelihood,
            one.rank,
            one.distance_rank,
            one.area_rank,
            *([] if learnt_from is None else [one.id in learnt_from]),
        )
        for one in ranks
    )
    return Table(columns, rows, note=_NOTE)


def rank_lines(ranked: Ranking) -> list[str]:
    """The demonstrations that fit badly, those that were not ranked, and ranks that say nothing about the fit."""
    ranks, left_out, unlike = ranked.ranks, ranked.not_ranked, ranked.unlike
    lines = [_bad(one) for one in ranked.bad]
    if lines:
        # every demonstration has one lower end by log-likelihood, and two ends by distance and by area
        like = [one for one in ranks if one.group not in unlike]
        chance = sum(RARE + 2 * EXTREME * (1 + (one.distance_rank is not None)) for one in like)
        lines.append(
            f"by chance alone, at most {chance:.2g} of {counted(len(like), 'demonstration')} would fit as badly"
        )
    if unlike:
        lines.append(f"the reward was not learnt from {' / '.join(unlike)}: ranks there do not show how well it fits")
    if ranks and ranked.trained is None:
        lines.append(
            "it is unknown from which groups the reward was learnt: ranks of other groups do not show how well it fits"
        )
    if left_out:
        names = ", ".join(f"{group} ({count})" for group, count in left_out.items())
        lines.append(f"not ranked, because the reward was not learnt from such trials: {names}")
    return lines


def _bad(one: Rank) -> str:
    """What is unusual about a demonstration."""
    shares = [f"{_percent(one.rank)} of the policy's own paths are less likely"]
    if one.distance_rank is not None:
        shares.append(f"{_percent(one.distance_rank)} pass people nearer")
    shares.append(f"{_percent(one.area_rank)} have a smaller area")
    return f"this reward fits {one.id} ({one.group}) badly: {', '.join(shares)}"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
