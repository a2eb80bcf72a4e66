"""The page of ``navirl report``."""

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli import __version__
from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Report
from navirl_cli.documents.numbers import evenly
from navirl_cli.documents.tables import Column, Table
from navirl_cli.errors import counted
from navirl_cli.evaluation.compare import Comparison
from navirl_cli.evaluation.lines import center_distance_m
from navirl_cli.evaluation.meaning import Meaning, meanings
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS
from navirl_cli.evaluation.ranks import Ranking
from navirl_cli.planning.problem import problem_of
from navirl_cli.reports.evaluation import group_table
from navirl_cli.reports.evidence import reach_line
from navirl_cli.reports.extraction import trial_table
from navirl_cli.reports.fit import (
    bootstrap_line,
    correlation_table,
    formula,
    interval_notes,
    likelihood_table,
    meanings_of_parameters,
    parameter_table,
    people,
    profile_table,
    validation_tables,
)
from navirl_cli.reports.fit_remarks import cannot_learn, remarks, warnings
from navirl_cli.reports.made import Made, made_blocks
from navirl_cli.reports.persons import ended, person_blocks
from navirl_cli.reports.pictures import pictures
from navirl_cli.reports.ranks import group_ranks_table, rank_lines, rank_table
from navirl_cli.reports.recommendation import recommendation_blocks
from navirl_cli.reports.repeated import repeated

_CAPTIONS = {
    "paths": "Driven paths by condition; the line is thicker where the person pushed.",
    "policy": "Expected visits of every cell under the learnt policy, and the reward of every cell.",
    "properties": "Properties of driven and learnt paths by group: mean, its 95 % interval and standard deviation.",
    "profile": "Profile likelihoods: how fast the likelihood falls on both sides of the estimate.",
}
#: A lower end this many times smaller than a positive quantity does not bound it.
NOTHING = 1e-3
#: The metrics of the paper and two more.
METRICS = [*PAPER_METRICS, *(BY_NAME[name] for name in ("compliance", "personal_share"))]


def report_of(
    demonstrations: Sequence[Demonstration],
    learnt: LearntReward,
    content: Mapping[str, Any],
    result: Comparison,
    ranked: Ranking,
    figures: Mapping[str, Path],
    made: Made,
) -> Report:
    """Compose the page.

    Args:
        demonstrations: All.
        learnt: The reward.
        content: Of its file.
        result: Metrics.
        ranked: Ranks of the demonstrations among the policy's paths.
        figures: Files by name.
        made: How it was made; its seed is that of the intervals.
    """
    notes, seed = repeated(demonstrations), made.seed
    blocks: list[Block] = [
        Paragraph(_summary(demonstrations, learnt, content)),
        *_recommendation(demonstrations, learnt, seed),
        *_warnings(made.everyone, learnt, content, ranked),
        Heading("Parameters"),
        formula(learnt.reward.terms),
        parameter_table(content),
        *interval_notes(content),
        *person_blocks(content),
        meanings_of_parameters(content),
        *bootstrap_line(content),
        *profile_table(content),
        *pictures(figures, _CAPTIONS, "profile"),
        *correlation_table(content),
        likelihood_table(content),
        *reach_line(content),
        *_meanings(demonstrations, learnt, seed),
        Heading("Learnt policy"),
        *pictures(figures, _CAPTIONS, "policy"),
        Heading("Path metrics"),
        group_table(result.groups, METRICS, "Mean ± standard deviation."),
        *pictures(figures, _CAPTIONS, "properties", "paths"),
        Heading("Ranks of the demonstrations"),
        *_rank_blocks(learnt, ranked),
        Heading("Prediction of participants left out"),
        *(validation_tables(content) or [Paragraph("Not computed; `navirl fit --cross-validate participant` does.")]),
        Heading("Trials"),
        trial_table(demonstrations),
        *([Bullets(tuple(notes))] if notes else []),
        *made_blocks(content, made),
        Heading("Sources"),
        Table((Column("file"), Column("sha256", "SHA-256")), tuple((one.file, one.sha256) for one in made.files)),
    ]
    return Report("Learnt navigation reward", tuple(blocks), f"navirl {__version__}")


def _recommendation(demonstrations: Sequence[Demonstration], learnt: LearntReward, seed: int) -> list[Block]:
    """How to drive by the reward, on open ground and in the scene of the first demonstration that it is from."""
    shown = next((one for one in demonstrations if one.id in learnt.demonstrations), demonstrations[0])
    return recommendation_blocks(learnt, problem_of(shown), shown.id, seed)


def _summary(demonstrations: Sequence[Demonstration], learnt: LearntReward, content: Mapping[str, Any]) -> str:
    """The data, and how the fit ended."""
    everyone = people({"participants": {one.participant for one in demonstrations}})
    return (
        f"{counted(len(demonstrations), 'demonstration')} of {everyone}, and a navigation reward learnt from "
        f"{len(learnt.demonstrations)} of them, of {people(content)}. "
        f"The fit ended with the status **{learnt.status.value}**: {ended(content)}."
    )


def _meanings(demonstrations: Sequence[Demonstration], learnt: LearntReward, seed: int) -> list[Block]:
    """The parameters in metres; nothing for a reward without parameters that have such a meaning."""
    lines = tuple(map(_sentence, _in_metres(demonstrations, learnt, seed)))
    return [Heading("Meaning of the parameters in metres"), Bullets(lines)] if lines else []


def _in_metres(demonstrations: Sequence[Demonstration], learnt: LearntReward, seed: int) -> list[Meaning]:
    """The meaning of the reward at the mean distance of passing."""
    seen = [center_distance_m(one.xy_m, one.people_m) for one in demonstrations if one.id in learnt.demonstrations]
    seen = [distance for distance in seen if isfinite(distance)]
    passed = float(np.mean(seen)) if seen else float("nan")
    front = learnt.intervals[0] if learnt.intervals else None
    rng = np.random.default_rng(seed)
    return meanings(learnt.reward, learnt.covariance, learnt.resolution_m, passed, rng, front)


def _sentence(one: Meaning) -> str:
    """A quantity with its interval."""
    value, interval = evenly([one.value, *_ends(one.lower, one.upper, one.value)])[0], ""
    if isfinite(one.lower) or isfinite(one.upper):
        interval = f" ({in_words(one.lower, one.upper, one.value)})"
    return f"{one.text} **{value}{' ' + one.unit if one.unit else ''}**{interval}."


def in_words(lower: float, upper: float, value: float) -> str:
    """An interval in words; an open end is infinite, and one far below the value is none."""
    lower, upper = _ends(lower, upper, value)
    _, low, high = evenly([value, lower, upper])
    if not (isfinite(lower) or isfinite(upper)):
        return "the demonstrations set no range"
    if not isfinite(lower):
        return f"less than {high}"
    return f"{low} to {high}" if isfinite(upper) else f"more than {low}"


def _ends(lower: float, upper: float, value: float) -> tuple[float, float]:
    """The ends of an interval; one far below the value is none."""
    return (-inf if 0 <= lower < NOTHING * value else lower), upper


def _rank_blocks(learnt: LearntReward, ranked: Ranking) -> list[Block]:
    """Ranks by group and by demonstration, and which demonstrations fit badly."""
    lines = tuple(f"{line[0].upper()}{line[1:]}." for line in rank_lines(ranked))
    if not ranked.ranks:
        return [Paragraph(lines[0])]
    tables = [group_ranks_table(ranked.ranks), rank_table(ranked.ranks, learnt.demonstrations)]
    return [*tables, *([Bullets(lines)] if lines else [])]


def _warnings(
    demonstrations: Sequence[Demonstration], learnt: LearntReward, content: Mapping[str, Any], ranked: Ranking
) -> list[Block]:
    """What a reader should know before trusting the numbers."""
    taught = [one for one in demonstrations if one.id in learnt.demonstrations]
    conditions = {one.condition.value for one in taught}
    chosen_by = tuple(conditions) if len(conditions) == 1 else ()
    said = [
        *cannot_learn(taught),
        *remarks(taught, None, chosen_by=chosen_by, everyone=demonstrations),
        *warnings(content),
    ]
    lines = [f"{line[0].upper()}{line[1:]}." if line.split()[0].isalpha() else f"{line}." for line in said]
    bad = ", ".join(one.id for one in ranked.bad)
    if bad:
        lines.append(f"The policy rarely takes paths like those of {bad}; see the ranks.")
    return [Heading("Warnings"), Bullets(tuple(lines))] if lines else []
