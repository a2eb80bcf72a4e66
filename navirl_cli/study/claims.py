"""The paper's claims about its paths, tested with the participants at hand: differences with intervals."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from navirl_cli.evaluation.compare import DRIVEN, ON_GRID
from navirl_cli.evaluation.groups import Measured, by_participant
from navirl_cli.evaluation.lines import LEAVES_M
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.evaluation.paired import Paired, paired
from navirl_cli.study.learning import Learnt
from navirl_cli.study.measures import with_people

SECOND_CYCLE, JOYSTICK, REPLAY = "force, cycle 2", "joystick", "replay of the learnt policy"
#: Groups of a robot that only avoids obstacles: as an imported study names them, and without a set in the log.
AVOIDANCE = ("obstacle avoidance", "autonomous")


class Verdict(StrEnum):
    """What the differences show of a claim."""

    HOLDS = "holds"
    FAILS = "does not hold"
    OPEN = "not settled"


@dataclass(frozen=True)
class Difference:
    """A paired difference between two types of paths, over participants."""

    quantity: str
    unit: str
    paired: Paired
    #: For closeness: how far a participant's own second-cycle paths scatter, within which paths count as close.
    margin: float | None = None

    @property
    def against(self) -> list[str]:
        """Participants whose own difference contradicts the claim."""
        if self.margin is None:
            return [name for name, value in self.paired.differences.items() if value <= 0]
        return [name for name, value in self.paired.differences.items() if abs(value) >= self.margin]

    @property
    def verdict(self) -> Verdict:
        """Close: the interval within the margin, or beyond it. Larger: the interval above 0, or below it."""
        low, high = (0.0, np.inf) if self.margin is None else (-self.margin, self.margin)
        lower, upper = self.paired.student
        if not np.isfinite([lower, upper]).all():
            return Verdict.OPEN
        if low < lower and upper < high:
            return Verdict.HOLDS
        return Verdict.FAILS if upper < low or lower > high else Verdict.OPEN


@dataclass(frozen=True)
class Claim:
    """One claim and the differences that decide it."""

    #: In a few words.
    title: str
    text: str
    #: Which difference was tested.
    question: str
    differences: tuple[Difference, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst of the differences' verdicts: failing before open before holding."""
        verdicts = {difference.verdict for difference in self.differences}
        return next(verdict for verdict in (Verdict.FAILS, Verdict.OPEN, Verdict.HOLDS) if verdict in verdicts)


def claims_of(rows: Sequence[Measured], learnt: Sequence[Learnt]) -> list[Claim]:
    """The paper's claims that the data at hand can decide on.

    Args:
        rows: Measured paths.
        learnt: Fits by participant; a pooled one is ignored.
    """
    rows = with_people(rows)  # as in the tables
    groups = {row.group for row in rows}
    avoidance = next((group for group in AVOIDANCE if group in groups), None)
    claims = [
        _replays(rows),
        _expected(rows, learnt, own=True),
        _expected(rows, learnt, own=False),
        _joystick(rows),
    ]
    if avoidance is not None:
        claims += [_latest(rows, avoidance), _smallest(rows, avoidance, sorted(groups - {avoidance}))]
    return [claim for claim in claims if claim.differences]


def _difference(
    quantity: str, unit: str, one: Mapping[str, float], other: Mapping[str, float], margin: float | None = None
) -> Difference | None:
    """One minus the other; None where no participant has both."""
    found = paired(one, other)
    return Difference(quantity, unit, found, margin) if found.n else None


def _kept(differences: Sequence[Difference | None]) -> tuple[Difference, ...]:
    return tuple(difference for difference in differences if difference is not None)


def _of(rows: Sequence[Measured], group: str, name: str, path_type: str = DRIVEN) -> Mapping[str, float]:
    """A metric in a group, by participant."""
    return by_participant([row for row in rows if row.group == group], path_type, name)


def _close(
    rows: Sequence[Measured], path_type: str, one: Callable[[str], Mapping[str, float]], metrics: Sequence[Metric]
) -> tuple[Difference, ...]:
    """Each metric's values minus the second cycle's, with the scatter within participants as the margin."""
    return _kept(
        [
            _difference(
                metric.label,
                metric.unit,
                one(metric.name),
                _of(rows, SECOND_CYCLE, metric.name, path_type),
                scatter_within(rows, path_type, metric.name),
            )
            for metric in metrics
        ]
    )


def scatter_within(rows: Sequence[Measured], path_type: str, name: str) -> float:
    """Pooled standard deviation of a participant's second-cycle paths about their own mean; NaN where all have one."""
    own: dict[str, list[float]] = {}
    for row in rows:
        if row.group == SECOND_CYCLE:
            own.setdefault(row.participant, []).append(row.values[path_type][name])
    squares = sum(float(np.var(values)) * len(values) for values in own.values())
    freedom = sum(len(values) - 1 for values in own.values())
    return float(np.sqrt(squares / freedom)) if freedom else float("nan")


def _replays(rows: Sequence[Measured]) -> Claim:
    """Replays that the robot drove by itself."""
    return Claim(
        "replays",
        "The learnt policy's paths are close to those of the second force cycle (replays that the robot drove).",
        f"Replay of the learnt policy - {SECOND_CYCLE}, driven paths",
        _close(rows, DRIVEN, lambda name: _of(rows, REPLAY, name), PAPER_METRICS),
    )


def _expected(rows: Sequence[Measured], learnt: Sequence[Learnt], *, own: bool) -> Claim:
    """What the policies learnt from the second cycle, or from the first, expect in the second cycle's scenes."""
    near = {}
    for one in learnt:
        of_cycle = one.second if own else one.first
        if one.participant is not None and of_cycle is not None and of_cycle.near is not None:
            near[one.participant] = of_cycle.near
    # Length is a feature of the reward: a policy expects the mean length of whatever it was learnt from.
    metrics = [metric for metric in PAPER_METRICS if not own or metric.name != "length_m"]
    expected = {m.name: {who: one.learnt.expected(m.name) for who, one in near.items()} for m in metrics}
    differences = _close(rows, ON_GRID, lambda name: expected[name], metrics)
    if own:
        title = "goodness of fit"
        text = "The learnt policy's paths are close to those of the second force cycle, from which it was learnt."
    else:
        title = "predicted from cycle 1"
        text = "The policy learnt from the first cycle predicts the second cycle's paths."
    return Claim(title, text, f"Expected under the policy - {SECOND_CYCLE}, paths through cells", differences)


def _joystick(rows: Sequence[Measured]) -> Claim:
    """The distances of joystick and force paths."""
    joystick, force = (_of(rows, group, "min_center_distance_m") for group in (JOYSTICK, SECOND_CYCLE))
    return Claim(
        "joystick",
        "Paths steered by joystick keep a larger distance to the person than paths of the second force cycle.",
        f"Joystick - {SECOND_CYCLE}, driven paths",
        _kept([_difference("min. distance", "m", joystick, force)]),
    )


def _who(avoidance: str) -> str:
    """The name of a robot that no person steers."""
    return "Obstacle avoidance" if avoidance == AVOIDANCE[0] else "The robot by itself (autonomous)"


def _latest(rows: Sequence[Measured], avoidance: str) -> Claim:
    """Where paths leave the nominal path."""
    wished, alone = (_of(rows, group, "onset_m") for group in (SECOND_CYCLE, avoidance))
    return Claim(
        "late avoidance",
        f"{_who(avoidance)} leaves the nominal path later than people wish.",
        f"Distance to the person where the path has left the nominal path by {LEAVES_M:g} m: "
        f"{SECOND_CYCLE} - {avoidance}",
        _kept([_difference("avoidance onset", "m", wished, alone)]),
    )


def _smallest(rows: Sequence[Measured], avoidance: str, others: Sequence[str]) -> Claim:
    """The areas under all paths."""
    least = _of(rows, avoidance, "area_m2")
    return Claim(
        "smallest area",
        f"{_who(avoidance)} takes the paths with the smallest area under them.",
        f"Each other group - {avoidance}, driven paths",
        _kept([_difference(f"area, {group}", "m²", _of(rows, group, "area_m2"), least) for group in others]),
    )
