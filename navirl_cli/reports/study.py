"""The report of a study, in words, tables and figures."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from navirl_cli import __version__
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Report
from navirl_cli.errors import Number, counted
from navirl_cli.evaluation.compare import DRIVEN
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.irl.fit import PAPER_L2
from navirl_cli.irl.reward import parameters_of
from navirl_cli.reports.evaluation import group_table
from navirl_cli.reports.fit import formula
from navirl_cli.reports.pictures import pictures
from navirl_cli.reports.study_tables import (
    answers_table,
    claims_table,
    closeness_table,
    completion_table,
    intervals_table,
    is_weak,
    rewards_table,
)
from navirl_cli.study.claims import Claim
from navirl_cli.study.learning import FIRST, SECOND
from navirl_cli.study.measures import STUDY_METRICS
from navirl_cli.study.pipeline import PUBLISHED_PARTICIPANTS, Study
from navirl_cli.study.questionnaire import Answer, Shares

#: Figures that a report can hold: name of the file and caption. The numbers are the paper's.
FIGURES: Mapping[str, str] = {
    "fig2_completion_times": "Completion times of the obstacle course by modality: median, quartiles, whiskers to 1.5 "
    "interquartile ranges, and every participant (as the paper's Fig. 2).",
    "fig3_paths": "Paths that a person influenced, by condition (as the paper's Fig. 3).",
    "fig4_answers": "Answers to the questionnaire (as the paper's Figs. 4 and 6).",
    "fig5_replays": "Paths that the robot drove autonomously (as the paper's Fig. 5).",
    "fig7_properties": "Path properties by condition: mean, its 95 % interval, and standard deviation over paths "
    "(as the paper's Fig. 7).",
    "fig8_pooled": "The reward learnt from all second cycles, in their scene: propagated policy and state reward (as "
    "the paper's Fig. 8).",
    "fig9_unseen": "The same reward in scenes without demonstrations: two people in the hallway; a person beside a "
    "large obstacle (as the paper's Fig. 9).",
}
_INTRODUCTION = (
    "The method is that of Kollmitz, Koller, Boedecker and Burgard, Learning Human-Aware Robot Navigation from "
    "Physical Interaction via Inverse Reinforcement Learning, IROS 2020."
)
_VERDICTS = (
    "Differences are paired by participant. Each participant counts with the mean over their trials. The intervals "
    "are Student's 95 % intervals. Paths count as close if the whole interval lies within the scatter (standard "
    "deviation) of a participant's own second-cycle paths, and as not close if it lies outside. A claim is not "
    "settled if the interval does not decide it. This is no evidence against the claim: there are too few "
    "participants. Goodness of fit is no prediction, because the policy was learnt from the same paths. It is "
    "therefore tested only on properties that are not features of the reward."
)
_UNIDENTIFIED = (
    "Two demonstrations do not always determine four parameters. A parameter that is not identified, or is on its "
    "bound, has no standard error. The data barely determine a parameter whose standard error exceeds half of its "
    "value. In these cases the small regulariser keeps the value from growing without limit."
)
_ON_GRID = (
    "A path through cells is up to 8 % longer than the driven line. These lengths are therefore not comparable with "
    "those of the driven paths above. Expected lengths are exact. Distances and areas are means over sampled paths. "
    "Length is a feature of the reward: a policy expects the mean length of the paths that it was learnt from. The "
    "policy of cycle 1 was not learnt from the paths of cycle 2."
)
_ERRORS = (
    "Standard errors come from the observed information, which treats all participants as alike. For all participants"
    " together a second row gives them from the scatter between participants."
)


@dataclass(frozen=True, eq=False)
class StudyContext:
    """What a report states beside the study's numbers."""

    #: Names of the logs.
    logs: Sequence[str]
    #: What is unusual, skipped or lost, in words.
    notes: Sequence[str]
    #: Published paths, and whether our cells are the same.
    cells: Sequence[tuple[str, bool]]
    #: Figures drawn, by name; with those for other screens, as :func:`navirl_cli.reports.pictures.pictures` takes them.
    figures: Mapping[str, Path]
    #: Answers to the questionnaire.
    answers: Sequence[Shares]
    samples: int
    seed: int


def report_of(study: Study, context: StudyContext) -> Report:
    """Compose the report.

    Args:
        study: The numbers.
        context: What else it states.
    """
    everyone = len({one.participant for one in study.demonstrations})
    people = counted(everyone, "participant")
    seconds = len(study.seconds)
    summary = f"{people}, {counted(len(study.demonstrations), 'trial')}, {seconds} of them in the second force cycle."
    blocks: list[Block] = [
        Paragraph(f"{summary} {_INTRODUCTION}"),
        Heading("The paper's claims, tested with these participants"),
        Bullets(tuple(_claims_lines(study.claims))),
        claims_table(study.claims),
        Paragraph(_VERDICTS),
        *_tasks(study, context),
        Heading("Paths"),
        *pictures(context.figures, FIGURES, "fig3_paths", "fig5_replays"),
        Heading("Path properties"),
        *_properties(study.groups),
        *pictures(context.figures, FIGURES, "fig7_properties"),
        Heading("Learnt rewards"),
        *_rewards(study),
        Heading("Learnt policies beside the second cycle"),
        closeness_table(study),
        Paragraph(_ON_GRID),
        *pictures(context.figures, FIGURES, "fig8_pooled", "fig9_unseen"),
        Heading("Logs"),
        *_logs(context),
        Heading("Method"),
        _method(study, context),
    ]
    return Report(f"User study with {people}", tuple(blocks), f"navirl {__version__}")


def overview_of(study: Study, context: StudyContext) -> list[Block]:
    """What the command prints: the learnt rewards, their intervals and the verdicts.

    Args:
        study: The numbers.
        context: What else the report states.
    """
    claims = Bullets(tuple(_claims_lines(study.claims)))
    blocks: list[Block] = [rewards_table(study), intervals_table(study), claims]
    if context.cells:
        same = sum(same for _, same in context.cells)
        blocks.append(Paragraph(f"cells as published: {same} of {counted(len(context.cells), 'path')}"))
    return blocks


def remarks(demonstrations: Sequence[Demonstration], answers: Iterable[Answer]) -> list[str]:
    """What a reader should know of all trials together.

    Args:
        demonstrations: Of the study.
        answers: To the questionnaire.
    """
    lines = []
    maps = {(one.grid.origin_m, one.grid.shape, one.grid.resolution_m) for one in demonstrations}
    if len(maps) > 1:
        lines.append(
            f"trials are on {len(maps)} maps: figures of paths draw them over each other; the figure of the learnt "
            "policy shows the scene of the first second-cycle trial"
        )
    radii = sorted({one.robot_radius_m for one in demonstrations})
    if len(radii) > 1:
        listed = ", ".join(f"{radius:g}" for radius in radii)
        lines.append(f"robots of radii {listed} m are combined: distances from their shells are not comparable")
    pushed = [one for one in demonstrations if one.condition is Condition.FORCE]
    others = sorted({one.cycle for one in pushed if one.cycle is not None and one.cycle not in {FIRST, SECOND}})
    if others:
        lines.append(f"cycle {', '.join(map(str, others))}: shown, but not fitted; only cycles 1 and 2 are fitted")
    unknown = sum(one.cycle is None and one.set is None for one in pushed)
    if unknown:
        lines.append(
            f"{unknown} trial{Number(unknown):|s} of the condition force {Number(unknown):has|have} neither "
            f"cycle nor set: {Number(unknown):it is|they are} not fitted"
        )
    aside = sorted({one.set for one in pushed if one.set is not None and one.cycle is not None})
    if aside:
        lines.append(
            f"trials of the condition force in the sets {', '.join(aside)} are not fitted, although they have a cycle"
        )
    people = {one.participant for one in demonstrations}
    strangers = sorted({one.participant for one in answers} - people)
    if strangers:
        lines.append(f"the questionnaire holds answers of participants without a log: {', '.join(strangers)}")
    return lines


def _claims_lines(claims: Sequence[Claim]) -> Iterator[str]:
    """Verdict, claim and numbers, one line each."""
    for claim in claims:
        numbers = "; ".join(f"{one.quantity} {one.paired.mean:+.3f} {one.unit}" for one in claim.differences)
        yield f"**{claim.verdict.value}**: {claim.text} ({claim.question}: {numbers}.)"


def _tasks(study: Study, context: StudyContext) -> list[Block]:
    """The obstacle course and the questionnaire, where there are any."""
    blocks: list[Block] = []
    if study.completion_s:
        blocks += [Heading("Obstacle course"), completion_table(study.completion_s)]
        blocks += pictures(context.figures, FIGURES, "fig2_completion_times")
    if "fig4_answers" in context.figures:
        blocks += [
            Heading("Questionnaire"),
            answers_table(context.answers),
            *pictures(context.figures, FIGURES, "fig4_answers"),
        ]
    return blocks


def _properties(groups: Sequence[GroupMetrics]) -> list[Block]:
    """Driven paths by group, and what the columns are."""
    driven = [row for row in groups if row.path_type == DRIVEN]
    caption = "Driven paths of trials with people, mean ± standard deviation over paths."
    definitions = Bullets(tuple(f"{metric.label}: {metric.definition}" for metric in STUDY_METRICS))
    return [group_table(driven, STUDY_METRICS, caption), definitions]


def _rewards(study: Study) -> list[Block]:
    """Parameters, and how far to rely on them."""
    blocks: list[Block] = [
        formula(study.terms),
        rewards_table(study),
        Paragraph(_ERRORS),
        intervals_table(study),
    ]
    pooled = study.pooled.second
    if pooled is not None and study.published_log_likelihood is not None:
        published, here = study.published_log_likelihood, len({one.participant for one in study.seconds})
        gain = pooled.fit.log_likelihood - published
        blocks.append(
            Paragraph(
                f"The published parameters were learnt from the second cycles of {PUBLISHED_PARTICIPANTS} people. "
                f"Under them the second cycles of the {counted(here, 'participant')} here have a log-likelihood of "
                f"{published:.4f} nats, under the pooled fit {pooled.fit.log_likelihood:.4f} nats: a difference of "
                f"{gain:+.3f} nats."
            )
        )
    both = [cycle for one in study.participants for cycle in (one.first, one.second) if cycle is not None]
    if any(is_weak(cycle) for cycle in both):
        blocks.append(Paragraph(_UNIDENTIFIED))
    return blocks


def _logs(context: StudyContext) -> list[Block]:
    """Logs, cells beside published ones, and notes."""
    logs = ", ".join(f"`{log}`" for log in context.logs)
    blocks: list[Block] = [Paragraph(f"{counted(len(context.logs), 'log')}: {logs}.")]
    if context.cells:
        other = sorted(name for name, same in context.cells if not same)
        extra = f"; others: {', '.join(other)}" if other else ""
        same = len(context.cells) - len(other)
        blocks.append(
            Paragraph(f"Cells equal to those published: **{same} of {counted(len(context.cells), 'path')}**{extra}.")
        )
    return [*blocks, Bullets(tuple(context.notes))] if context.notes else blocks


def _method(study: Study, context: StudyContext) -> Bullets:
    """Settings that the numbers depend on."""
    start = ", ".join(f"{p.name} = {p.initial:g} {p.unit}".strip() for p in parameters_of(study.terms))
    second = (
        "The second cycle is fitted from the first's result, all second cycles together from the same start as the "
        "first. Newton's method tries a second start of its own, so the result hardly depends on the start."
    )
    return Bullets(
        (
            f"The first cycle of each participant is fitted from {start}.",
            second,
            f"The paper's regulariser: {PAPER_L2 / 2:g} nats on the squares of the parameters, in units of 10 /m or 1.",
            f"{context.samples} paths were sampled from each policy in each scene, with seed {context.seed}.",
            "Cells of 10 cm, by the study's rule from poses to cells.",
        )
    )
