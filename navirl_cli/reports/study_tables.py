"""The tables of a study's report."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import median

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.documents.tables import Cell, Column, Interval, Spread, Table
from navirl_cli.evaluation.groups import mean_and_spread
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.intervals import Errors
from navirl_cli.irl.reward import parameters_of
from navirl_cli.irl.status import Status
from navirl_cli.reports.evaluation import DECIMALS
from navirl_cli.reports.fit import interval_cell, roughness
from navirl_cli.study.claims import Claim
from navirl_cli.study.learning import FIRST, SECOND, CycleFit, Learnt
from navirl_cli.study.pipeline import PUBLISHED_DEMONSTRATIONS, PUBLISHED_PARTICIPANTS, PUBLISHED_THETA, Study
from navirl_cli.study.questionnaire import Shares


def claims_table(claims: Iterable[Claim]) -> Table:
    """The differences that the verdicts rest on."""
    columns = (
        Column("claim"),
        Column("quantity"),
        Column("unit"),
        Column("mean_difference", "mean difference", DECIMALS, sign=True),
        Column("interval", "95 % interval", DECIMALS, sign=True),
        Column("n"),
        Column("margin", "close within ±", DECIMALS),
        Column("participants_against", "participants against"),
        Column("verdict"),
    )
    rows = tuple(
        (
            claim.title,
            one.quantity,
            one.unit,
            one.paired.mean,
            Interval(*one.paired.student),
            one.paired.n,
            one.margin,
            ", ".join(one.against) or "none",
            one.verdict.value,
        )
        for claim in claims
        for one in claim.differences
    )
    notes = ["Claims of a larger value have no margin."]
    if any(row[5] == 1 for row in rows):
        notes.append("One participant has no interval.")
    if any(one.margin is not None and np.isnan(one.margin) for claim in claims for one in claim.differences):
        notes.append("A margin needs a participant with two second-cycle paths.")
    return Table(columns, rows, "Paired differences over participants.", " ".join(notes))


def completion_table(completion_s: Mapping[str, Mapping[str, tuple[float, ...]]]) -> Table:
    """Completion times by modality."""
    columns = (
        Column("modality"),
        Column("n"),
        Column("median_s", "median s", 1),
        Column("time_s", "mean ± standard deviation s", 1),
    )
    every = {modality: [time for own in known.values() for time in own] for modality, known in completion_s.items()}
    rows = tuple(
        (modality, len(times), median(times), Spread(*mean_and_spread(times))) for modality, times in every.items()
    )
    return Table(columns, rows, "Completion times.")


def answers_table(bars: Sequence[Shares]) -> Table:
    """Answers by question and modality."""
    levels = len(bars[0].counts) if bars else 0
    columns = tuple(map(Column, ("question", "modality", "n")))
    columns += (Column("median", decimals=1),)
    columns += tuple(Column(f"answers_{level}", f"answers {level}") for level in range(1, levels + 1))
    rows = tuple((one.question, one.modality, one.count, one.median, *one.counts.tolist()) for one in bars)
    return Table(columns, rows, "Answers to the questionnaire.")


def rewards_table(study: Study) -> Table:
    """Parameters by participant and cycle, pooled, and as published."""
    parameters = parameters_of(study.terms)
    rows: list[tuple[Cell, ...]] = [
        _fit_row(name, found.fit, found.fit.standard_errors) for name, found in cycles(study)
    ]
    pooled = study.pooled.second
    if pooled is not None and pooled.fit.clustered_errors is not None:
        rows.append(_fit_row("all, errors by participant", pooled.fit, pooled.fit.clustered_errors))
    note = ""
    if study.published_log_likelihood is not None:
        name = f"published, {PUBLISHED_PARTICIPANTS} participants"
        values = [Spread(PUBLISHED_THETA.get(parameter.name, float("nan")), float("nan")) for parameter in parameters]
        rows.append((name, PUBLISHED_DEMONSTRATIONS, *values, study.published_log_likelihood, "published"))
        note = "The log-likelihood of the published parameters is that of the second cycles here."
    columns = (
        Column("learnt_from", "learnt from"),
        Column("n"),
        *(Column(parameter.name, f"{parameter.name} {parameter.unit}".strip(), DECIMALS) for parameter in parameters),
        Column("log_likelihood", "log-likelihood", DECIMALS),
        Column("status"),
    )
    return Table(columns, tuple(rows), "Parameters ± standard errors, lengths in metres.", note)


def _fit_row(name: str, fit: Fit, errors: FloatArray) -> tuple[Cell, ...]:
    values = [Spread(value, error) for value, error in zip(fit.reward.theta, errors.tolist(), strict=True)]
    return name, fit.demonstrations, *values, fit.log_likelihood, fit.status.value


def cycles(study: Study) -> Iterator[tuple[str, CycleFit]]:
    """What was learnt, with the names of participant and cycle."""
    for one in (*study.participants, study.pooled):
        for cycle, found in ((FIRST, one.first), (SECOND, one.second)):
            if found is not None:
                yield f"{_whose(one)}, cycle {cycle}", found


def _whose(learnt: Learnt) -> str:
    return "all" if learnt.participant is None else learnt.participant


def is_weak(cycle: CycleFit) -> bool:
    """Whether a fit is unsure of a parameter: it did not converge, or a standard error exceeds half of its value."""
    values, errors = np.abs(cycle.fit.reward.theta), cycle.fit.standard_errors
    return cycle.fit.status is not Status.CONVERGED or bool((errors > values / 2).any())


def intervals_table(study: Study) -> Table:
    """The intervals of the parameters by participant and cycle; an open end has no number."""
    parameters = parameters_of(study.terms)
    rows: list[tuple[Cell, ...]] = []
    for name, found in cycles(study):
        if found.intervals:
            ends = {one.parameter: interval_cell(one) for one in found.intervals[0].ends}
            rows.append((name, *(ends.get(parameter.name) for parameter in parameters)))
    columns = (
        Column("learnt_from", "learnt from"),
        *(Column(parameter.name, f"{parameter.name} {parameter.unit}".strip(), DECIMALS) for parameter in parameters),
    )
    return Table(columns, tuple(rows), _note_on_intervals(study))


def _note_on_intervals(study: Study) -> str:
    """What the intervals come from, and where they are approximate."""
    sets = [(found.fit, found.intervals[0]) for _, found in cycles(study) if found.intervals]
    scattered = any(one.errors is Errors.PARTICIPANT for _, one in sets)
    text = f"95 % intervals{', of several participants from the scatter between them' if scattered else ''}."
    for whose, several in (("one participant", False), ("several", True)):
        rough = {
            roughness(one.kind, one.errors, fit.participants, fit.demonstrations)
            for fit, one in sets
            if (fit.participants > 1) is several
        }
        text += "".join(f" Those of {whose}: {why[0].lower()}{why[1:]}" for why in sorted(rough - {""}))
    return text


def closeness_table(study: Study) -> Table:
    """Expected properties beside demonstrated ones."""
    names = ("demonstrated", "expected")
    columns = tuple(Column(f"{m.name}_{name}", f"{m.heading}: {name}", 2) for m in PAPER_METRICS for name in names)
    rows: list[tuple[Cell, ...]] = []
    for name, found in cycles(study):
        if found.near is not None:
            both = (found.near.demonstrated, found.near.learnt)
            cells = (Spread(row.expected(m.name), row.std[m.name]) for m in PAPER_METRICS for row in both)
            rows.append((name, *cells))
    caption = (
        "Paths of the second cycle through the centres of their cells (mean ± standard deviation over paths), and the "
        "policy's expectation in their scenes (mean ± standard deviation of one path)."
    )
    return Table((Column("policy_of", "policy of"), *columns), tuple(rows), caption)
