"""The report of a study, in words, tables and figures."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navirl_cli import __version__
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph, Picture, Report
from navirl_cli.evaluation.lines import LEAVES_M
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.irl.fit import PAPER_L2
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status
from navirl_cli.reports.study_tables import (
    answers_table,
    claims_table,
    closeness_table,
    completion_table,
    properties_table,
    rewards_table,
    signed,
)
from navirl_cli.study.claims import Claim
from navirl_cli.study.learning import FIRST, SECOND, CycleFit
from navirl_cli.study.pipeline import PUBLISHED_PARTICIPANTS, Study
from navirl_cli.study.questionnaire import Answer, Shares

#: Figures that a report can hold: name of the file and caption. The numbers are the paper's.
FIGURES: Mapping[str, str] = {
    "fig2_completion_times": "Completion times of the obstacle course by modality: median, quartiles, whiskers to 1.5 "
    "interquartile ranges, and every participant (as the paper's Fig. 2).",
    "fig3_paths": "Paths of which a person had a say, by condition (as the paper's Fig. 3).",
    "fig4_answers": "Answers to the questionnaire (as the paper's Figs. 4 and 6).",
    "fig5_replays": "Paths that the robot drove by itself (as the paper's Fig. 5).",
    "fig7_properties": "Path properties by condition: mean and standard deviation over paths (as the paper's Fig. 7).",
    "fig8_pooled": "The reward learnt from all second cycles, in their scene: propagated policy and state reward (as "
    "the paper's Fig. 8).",
    "fig9_unseen": "The same reward in scenes that nobody demonstrated in: two people in the hallway; a person beside "
    "a large obstacle (as the paper's Fig. 9).",
}
_INTRODUCTION = (
    "The method is that of Kollmitz, Koller, Boedecker and Burgard, Learning Human-Aware Robot Navigation from "
    "Physical Interaction via Inverse Reinforcement Learning, IROS 2020."
)
_VERDICTS = (
    "Differences are paired by participant, each participant counting with the mean over the trials; intervals are "
    "Student's. Paths count as close where the whole interval lies within the scatter (standard deviation) of a "
    "participant's own second-cycle paths, and not close where it lies beyond: as near as the participant's paths are "
    "to each other. Goodness of fit is no foresight: the policy was learnt from these very paths, so that only what "
    "was not a feature of the reward is asked. What the interval does not decide is not settled by "
    "so many participants, which is no evidence against it. Participants whose own difference speaks against a claim "
    "stand under not so for."
)
_UNIDENTIFIED = (
    "Two demonstrations do not always tell four parameters. A parameter that is not identified, or on its bound, has "
    "no standard error; one whose standard error exceeds half of its value rests on little. There the small "
    "regulariser keeps the value from growing without end."
)
_ON_GRID = (
    "A path through cells is up to 8 % longer than the line that was driven, so that these lengths do not compare with "
    "those of the driven paths above. Expected lengths are exact; distances and areas are means over sampled paths. "
    "Length is a feature of the reward, so that a policy learnt from these very paths expects their mean length by "
    "construction; the policy of cycle 1 has not seen them."
)


@dataclass(frozen=True, eq=False)
class Told:
    """What a report tells beside the study's numbers."""

    #: Logs read.
    logs: Sequence[str]
    #: What was odd, skipped or lost, in words.
    notes: Sequence[str]
    #: Published paths, and whether our cells are the same.
    cells: Sequence[tuple[str, bool]]
    #: Figures drawn, by name.
    figures: Mapping[str, Path]
    #: Answers to the questionnaire.
    answers: Sequence[Shares]
    samples: int
    seed: int


def report_of(study: Study, told: Told) -> Report:
    """Compose the report.

    Args:
        study: The numbers.
        told: What else it tells.
    """
    everyone = len({one.participant for one in study.demonstrations})
    people = f"{everyone} participant{'s' if everyone > 1 else ''}"
    seconds = len(study.seconds)
    what = f"{people}, {len(study.demonstrations)} trials, {seconds} of them in the second force cycle."
    blocks: list[Block] = [
        Paragraph(f"{what} {_INTRODUCTION}"),
        Heading("The paper's claims, asked of these participants"),
        Bullets(tuple(claims_lines(study.claims, mark="**"))),
        claims_table(study.claims),
        Paragraph(_VERDICTS),
        *_tasks(study, told),
        Heading("Paths"),
        *_pictures(told, "fig3_paths", "fig5_replays"),
        Heading("Path properties"),
        properties_table(study.groups),
        _definitions(),
        *_pictures(told, "fig7_properties"),
        Heading("Learnt rewards"),
        *_rewards(study),
        Heading("Learnt policies beside the second cycle"),
        closeness_table(study),
        Paragraph(_ON_GRID),
        *_pictures(told, "fig8_pooled", "fig9_unseen"),
        Heading("What was read"),
        *_read(told),
        Heading("How it was computed"),
        _method(told),
    ]
    return Report(f"User study with {people}", tuple(blocks), f"navirl {__version__}")


def claims_lines(claims: Sequence[Claim], mark: str = "") -> list[str]:
    """Verdict, claim and numbers, one line each.

    Args:
        claims: The claims.
        mark: What stands on both sides of a verdict.
    """
    lines = []
    for claim in claims:
        said = "; ".join(f"{one.what} {signed(one.paired.mean, one.unit)}" for one in claim.differences)
        lines.append(f"{mark}{claim.verdict.value}{mark}: {claim.text} ({claim.asked}: {said}.)")
    return lines


def _pictures(told: Told, *names: str) -> list[Block]:
    return [Picture(told.figures[name], FIGURES[name]) for name in names if name in told.figures]


def _tasks(study: Study, told: Told) -> list[Block]:
    """The obstacle course and the questionnaire, where there are any."""
    blocks: list[Block] = []
    if study.completion_s:
        blocks += [Heading("Obstacle course"), completion_table(study.completion_s)]
        blocks += _pictures(told, "fig2_completion_times")
    if "fig4_answers" in told.figures:
        blocks += [Heading("Questionnaire"), answers_table(told.answers), *_pictures(told, "fig4_answers")]
    return blocks


def _definitions() -> Bullets:
    own = [f"{metric.label}: {metric.definition}" for metric in PAPER_METRICS]
    leaves = f"leaves before person: way left to the first person, along the nominal path, when {LEAVES_M:g} m off it"
    leaves += "; of the paths, counted in brackets, that start on it and leave it by as much"
    return Bullets((*own, "distance of centres: the least distance of the robot's centre from a person's", leaves))


def _rewards(study: Study) -> list[Block]:
    """Parameters, and what to think of them."""
    blocks: list[Block] = [rewards_table(study)]
    pooled = study.pooled.second
    if pooled is not None and study.published_log_likelihood is not None:
        published, here = study.published_log_likelihood, len({one.participant for one in study.seconds})
        gain = pooled.fit.log_likelihood - published
        blocks.append(
            Paragraph(
                f"The published parameters were learnt from the second cycles of {PUBLISHED_PARTICIPANTS} people. "
                f"Under them the second cycles of the {here} here have a log-likelihood of {published:.4f}, under the "
                f"pooled fit {pooled.fit.log_likelihood:.4f}: a difference of {signed(gain)} nats."
            )
        )
    cycles = [cycle for one in study.participants for cycle in (one.first, one.second) if cycle is not None]
    if any(_is_weak(cycle) for cycle in cycles):
        blocks.append(Paragraph(_UNIDENTIFIED))
    return blocks


def _is_weak(cycle: CycleFit) -> bool:
    """Whether a fit is unsure of a parameter: it did not converge, or a standard error exceeds half of its value."""
    values, errors = np.abs(cycle.fit.reward.theta), cycle.fit.standard_errors
    return cycle.fit.status is not Status.CONVERGED or bool((errors > values / 2).any())


def _read(told: Told) -> list[Block]:
    """Logs, cells beside published ones, and notes."""
    blocks: list[Block] = [Paragraph(f"{len(told.logs)} logs: {', '.join(f'`{log}`' for log in told.logs)}.")]
    if told.cells:
        other = sorted(name for name, same in told.cells if not same)
        extra = f"; others: {', '.join(other)}" if other else ""
        same = len(told.cells) - len(other)
        blocks.append(Paragraph(f"Cells equal to those published: **{same} of {len(told.cells)} paths**{extra}."))
    return [*blocks, Bullets(tuple(told.notes))] if told.notes else blocks


def _method(told: Told) -> Bullets:
    """Settings that the numbers depend on."""
    start = ", ".join(f"{p.name} = {p.initial:g} {p.unit}".strip() for p in Reward.named({}).parameters)
    second = (
        "The second cycle is fitted from the first's result, all second cycles together from the same start as the "
        "first. Newton's method tries a second start of its own, so that the start hardly matters."
    )
    return Bullets(
        (
            f"The first cycle of each participant is fitted from {start}.",
            second,
            f"The paper's regulariser: {PAPER_L2 / 2:g} nats on the squares of c0/(10 /m), a_g, a_p and sigma_p.",
            f"{told.samples} paths were sampled from each policy in each scene, with seed {told.seed}.",
            "Cells of 10 cm, by the study's rule from poses to cells.",
        )
    )


def remarks(demonstrations: Sequence[Demonstration], answers: Iterable[Answer]) -> list[str]:
    """Lines about all trials together.

    Args:
        demonstrations: Of the study.
        answers: To the questionnaire.
    """
    lines = []
    maps = {(one.grid.origin_m, one.grid.shape, one.grid.resolution_m) for one in demonstrations}
    if len(maps) > 1:
        lines.append(
            f"trials are on {len(maps)} maps: figures of paths lay them over each other, and that of the learnt policy "
            "shows the scene of the first second-cycle trial"
        )
    radii = sorted({one.robot_radius_m for one in demonstrations})
    if len(radii) > 1:
        listed = ", ".join(f"{radius:g}" for radius in radii)
        lines.append(f"robots of radii {listed} m are put together: distances from shells do not compare")
    pushed = [one for one in demonstrations if one.condition is Condition.FORCE]
    others = sorted({one.cycle for one in pushed if one.cycle is not None and one.cycle not in {FIRST, SECOND}})
    if others:
        lines.append(
            f"cycle {', '.join(map(str, others))}: shown, but nothing is fitted to it; fits are of cycles 1 and 2"
        )
    unsaid = sum(one.cycle is None and one.set is None for one in pushed)
    if unsaid:
        lines.append(f"{unsaid} trials of the condition force say neither cycle nor set: nothing is fitted to them")
    aside = sorted({one.set for one in pushed if one.set is not None and one.cycle is not None})
    if aside:
        lines.append(
            f"trials of the condition force in the sets {', '.join(aside)} are not fitted, though they say a cycle"
        )
    people = {one.participant for one in demonstrations}
    strangers = sorted({one.participant for one in answers} - people)
    if strangers:
        lines.append(f"the questionnaire holds answers of participants without a log: {', '.join(strangers)}")
    return lines
