"""The page of ``navirl report``: its words and tables."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli import __version__
from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Picture, Report
from navirl_cli.documents.tables import Table
from navirl_cli.evaluation.compare import Comparison
from navirl_cli.evaluation.lines import center_distance_m
from navirl_cli.evaluation.meaning import Meaning, meanings
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS
from navirl_cli.evaluation.ranks import Rank
from navirl_cli.irl.status import Status
from navirl_cli.reports.evaluation import group_table, uniform_line
from navirl_cli.reports.extraction import FORMATS, trial_row

#: Half the width of a 95 % interval of a normal estimate, in standard errors.
_WIDTH = 1.96
_CAPTIONS = {
    "paths": "All driven paths by condition; thicker where the person pushed.",
    "policy": "Where the learnt policy leads, as expected visits of every cell, and the reward of every cell.",
    "properties": "Driven and learnt paths by group: mean and standard deviation.",
    "profile": "Profile likelihoods: how sure a parameter is, and how lopsided.",
}
#: Beside the paper's three, where they are known.
METRICS = [*PAPER_METRICS, *(BY_NAME[name] for name in ("compliance", "personal_share"))]


def report_of(
    demonstrations: Sequence[Demonstration],
    learnt: LearntReward,
    document: Mapping[str, Any],
    result: Comparison,
    ranks: Sequence[Rank],
    figures: Mapping[str, Path],
    made_from: Sequence[Mapping[str, str]],
    seed: int,
) -> Report:
    """Compose the page.

    Args:
        demonstrations: All.
        learnt: The reward.
        document: Its file.
        result: Metrics.
        ranks: Of the demonstrations among the policy's paths.
        figures: Files by name.
        made_from: Files and hashes.
        seed: Of the intervals.
    """
    everyone = _people(len({one.participant for one in demonstrations}))
    fit = f"learnt from {len(learnt.demonstrations)} of them, of {_people(len(document['participants']))}"
    notes = [f"{one.id}: {note}" for one in demonstrations for note in one.notes]
    blocks: list[Block] = [
        Paragraph(f"{len(demonstrations)} demonstrations of {everyone}, and a navigation reward {fit}."),
        Heading("What was learnt"),
        _parameters(document),
        Paragraph(
            f"Log-likelihood {document['log_likelihood']:.3f} nats over {document['steps']} steps, "
            f"{document['log_likelihood'] / document['steps']:.4f} per step; equally likely moves have "
            f"{document['log_likelihood_uniform'] / document['steps']:.4f}. Status: **{learnt.status.value}**, "
            f"{learnt.status.advice}."
        ),
        Heading("What it means"),
        Bullets(tuple(map(_sentence, _said(demonstrations, learnt, seed)))),
        *_warnings(learnt, document, ranks),
        Heading("Where it leads"),
        *_pictures(figures, "policy", "profile"),
        Heading("Paths"),
        group_table(result, METRICS),
        *_pictures(figures, "properties", "paths"),
        Heading("How typical the demonstrations are"),
        Paragraph(f"R{uniform_line(ranks)[1:]}. Those it was learnt from are counted too."),
        _ranks(learnt, ranks),
        *_held_out(document),
        Heading("What the logs held"),
        _trials(demonstrations),
        *([Bullets(tuple(notes))] if notes else []),
        Heading("Made from"),
        Table.of_texts(
            ("file", "SHA-256"), tuple((one["file"], one["sha256"]) for one in made_from), "Files and their hashes."
        ),
    ]
    return Report("Learnt navigation reward", tuple(blocks), f"navirl {__version__}")


def _said(demonstrations: Sequence[Demonstration], learnt: LearntReward, seed: int) -> list[Meaning]:
    """What the reward means where people were passed."""
    seen = [center_distance_m(one.xy_m, one.people_m) for one in demonstrations if one.id in learnt.demonstrations]
    seen = [distance for distance in seen if isfinite(distance)]
    passed = float(np.mean(seen)) if seen else float("nan")
    return meanings(learnt.reward, learnt.covariance, learnt.resolution_m, passed, np.random.default_rng(seed))


def _ranks(learnt: LearntReward, ranks: Sequence[Rank]) -> Table:
    """Rank by demonstration."""
    rows = [
        (
            one.id,
            one.group,
            f"{one.log_likelihood:.2f}",
            f"{one.rank:.3f}",
            "yes" if one.id in learnt.demonstrations else "no",
        )
        for one in ranks
    ]
    header = ("demonstration", "group", "log-likelihood", "rank", "learnt from")
    return Table.of_texts(header, tuple(rows), "Share of the policy's paths that are less likely.")


def _people(count: int) -> str:
    return f"{count} participant{'' if count == 1 else 's'}"


def _parameters(document: Mapping[str, Any]) -> Table:
    """Estimates with errors and intervals."""
    rows = []
    for one in document["parameters"]:
        value, error = one["value"], one["standard_error"]
        interval = "-" if error is None else f"{value - _WIDTH * error:.4g} to {value + _WIDTH * error:.4g}"
        clustered = one["standard_error_clustered"]
        state = "on its bound" if one["on_bound"] else "" if one["identified"] else "not identified"
        rows.append(
            (
                one["name"],
                f"{value:.4g}",
                one["unit"] or "1",
                "-" if error is None else f"{error:.2g}",
                interval,
                "-" if clustered is None else f"{clustered:.2g}",
                state or "identified",
            )
        )
    header = ("parameter", "value", "unit", "std. error", "95 % interval", "std. error by participant", "state")
    return Table.of_texts(
        header, tuple(rows), "r(s, a) = c0 |s - s'| + a_g d(s)^2 + sum over people of a_p exp(-sigma_p |s - s_p|^2)."
    )


def _sentence(one: Meaning) -> str:
    """A meaning with its interval."""
    interval = f" ({one.lower:.3g} to {one.upper:.3g})" if isfinite(one.lower) else ""
    return f"{one.text} **{one.value:.3g}{' ' + one.unit if one.unit else ''}**{interval}."


def _held_out(document: Mapping[str, Any]) -> list[Block]:
    """How well each participant is foretold from the others, where that was asked for."""
    found = document["cross_validation"]
    if found is None:
        return [
            Paragraph("How well it foretells people that it has not seen: fit with `--cross-validate participant`.")
        ]
    rows = tuple(
        (model, *("-" if value is None else f"{value:.3f}" for value in (one["per_step"], *one["log_likelihood"])))
        for model, one in found["models"].items()
    )
    header = ("model", "per step", *found["left_out"])
    return [Table.of_texts(header, rows, "Log-likelihood of each participant under a fit of the others, nats.")]


def _warnings(learnt: LearntReward, document: Mapping[str, Any], ranks: Sequence[Rank]) -> list[Block]:
    """What should make a reader careful."""
    lines = []
    if learnt.status is not Status.CONVERGED:
        lines.append(f"The fit is {learnt.status.value}: {learnt.status.advice}.")
    for one in document["parameters"]:
        error = one["standard_error"]
        if error is not None and error > abs(one["value"]) / 2:
            lines.append(f"{one['name']} rests on little: its standard error exceeds half of its value.")
    if len(document["participants"]) < 10:
        lines.append("Errors by participant are rough below ten participants.")
    if any(one.rank < 0.01 for one in ranks):
        odd = ", ".join(one.id for one in ranks if one.rank < 0.01)
        lines.append(f"The policy hardly ever takes paths like those of {odd}.")
    return [Heading("Warnings"), Bullets(tuple(lines))] if lines else []


def _trials(demonstrations: Sequence[Demonstration]) -> Table:
    """The table of extract."""
    rows = [trial_row(one) for one in demonstrations]
    shown = [["-" if row[name] is None else format(row[name], FORMATS[name]) for name in FORMATS] for row in rows]
    return Table.of_texts(tuple(FORMATS), tuple(tuple(row) for row in shown), "Trials as extracted.")


def _pictures(figures: Mapping[str, Path], *names: str) -> list[Block]:
    return [Picture(figures[name], _CAPTIONS[name]) for name in names if name in figures]
