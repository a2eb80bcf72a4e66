"""From the demonstrations of a visit to its reward, and to the paths of the next cycle.

The robot waits for the paths. So they come from the fit that climbs from the earlier reward; the search for other
maxima, profile intervals and the effect of reach follow (:func:`confirmed`). Each file is replaced as a whole; all
follow from the demonstrations alone, so that after a kill they are simply made again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from navirl_cli.artefacts.plans import Planned, plan_document, write_plan
from navirl_cli.artefacts.rewards import LearntReward, reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.reach import ReachEffect, reach_effect
from navirl_cli.figures.plan import draw_plans
from navirl_cli.files import Input
from navirl_cli.irl.analyses import Analyses, Questions, answers
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.newcomer import Others, newcomer
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward, starting
from navirl_cli.irl.selection import Selection, Steps, select
from navirl_cli.planning.certainty import Certainty, certainty, passing_m
from navirl_cli.planning.paths import Mode, Planner
from navirl_cli.planning.problem import problem_of
from navirl_cli.planning.smooth import Limits, smoothed
from navirl_cli.watching.visit import REWARD

#: The figure of the next paths.
FIGURE = "paths.png"
#: Endings of a path's files: all numbers, a table, and for Nav2.
ENDINGS: Final = (".json", ".csv", ".yaml")
#: Trials whose starts and goals lie within this distance repeat each other, m.
_SAME_M: Final = 0.25
#: Paths at most.
MOST_PATHS: Final = 6
#: A maximum that is higher by this is another one, nats.
_HIGHER: Final = 1e-3
#: A mean over rewards that passes people at a distance that differs by this is worth other paths, m.
_DIFFERS_M: Final = 0.01


@dataclass(frozen=True)
class Choice:
    """Which demonstrations count, and the earlier reward."""

    conditions: tuple[str, ...] = ()
    steps: Steps = Steps.ALL
    earlier: LearntReward | None = None
    #: The earlier reward's file.
    earlier_file: Path | None = None

    @property
    def others(self) -> Others | None:
        """Earlier people, where the earlier reward says how they differ."""
        return None if self.earlier is None else self.earlier.others

    @property
    def prior(self) -> Prior | None:
        """What is known before.

        Raises:
            RewardError: The earlier reward is no maximum.
        """
        if self.earlier is None:
            return None
        return self.earlier.as_prior() if self.others is None else self.others.prior()

    @property
    def start(self) -> Reward:
        """Where the fit starts."""
        return starting((), None, None if self.earlier is None else self.earlier.reward)


@dataclass(frozen=True, eq=False)
class Learnt:
    """What is learnt so far."""

    selection: Selection
    fit: Fit
    #: Of the confirmed fit.
    analyses: Analyses = field(default_factory=Analyses)
    reach: ReachEffect | None = None
    #: Errors of analyses that failed.
    lost: tuple[str, ...] = ()

    @property
    def certainty(self) -> Certainty:
        """How sure it is of the distance at which to pass people."""
        return certainty(self.fit, *self._robot)

    def passing_m(self, reward: Reward) -> float:
        """The distance at which another reward passes people, m."""
        return passing_m(reward, *self._robot)

    @property
    def _robot(self) -> tuple[float, float]:
        """Radius, and side of the cells, m."""
        return self.selection.demonstrations[-1].robot_radius_m, self.selection.resolution_m


def learn(demonstrations: Sequence[Demonstration], choice: Choice) -> Learnt:
    """Fit from the earlier reward, without a search for other maxima.

    Args:
        demonstrations: All of the visit.
        choice: Of the user.

    Raises:
        NavirlError: No demonstration is left, or the fit is impossible.
    """
    selected = select(demonstrations, Subset(choice.conditions), steps=choice.steps)
    if choice.others is not None:
        _one_participant(selected)
    return Learnt(selected, fit(selected.evidence, choice.start, prior=choice.prior, scan=False))


def _one_participant(selected: Selection) -> str:
    """The participant of whom all demonstrations are.

    Raises:
        DemonstrationError: They are of several.
    """
    names = sorted(set(selected.evidence.participants))
    if len(names) > 1:
        raise DemonstrationError(
            "`reward`: holds a reward for each person, from which the next person's is learnt: expected recordings of "
            f"one participant, found {', '.join(names)}; name the participant with `participant`"
        )
    return names[0]


def confirmed(learnt: Learnt, choice: Choice) -> tuple[Learnt, str]:
    """The same with the search for other maxima and with the analyses of ``navirl fit``.

    Returns:
        What is learnt, and why it differs; empty where the paths stay.
    """
    evidence, chosen = learnt.selection.evidence, learnt.selection.demonstrations
    if choice.others is not None:
        found, own = newcomer(evidence, choice.others, _one_participant(learnt.selection))
        found = replace(found, prior=learnt.fit.prior)
        differs = abs(learnt.passing_m(found.reward) - learnt.passing_m(learnt.fit.reward)) > _DIFFERS_M
        why = "refined by the mean over all rewards that the person may have" if differs else ""
        return Learnt(learnt.selection, found, Analyses((own,))), why
    found = fit(evidence, choice.start, prior=learnt.fit.prior)
    why = (
        "corrected, because the likelihood has a higher maximum"
        if found.objective > learnt.fit.objective + _HIGHER
        else ""
    )
    effect = reach_effect(chosen, found, choice.steps)
    found, analyses, lost = answers(evidence, found, Questions(), whole_paths=choice.steps is Steps.ALL)
    return Learnt(learnt.selection, found, analyses, effect, tuple(lost)), why


def write_reward(output: Path, learnt: Learnt, choice: Choice, demos: Path) -> None:
    """Write the reward file.

    Raises:
        ArtefactError: It cannot be written.
    """
    inputs = [Input.of(path) for path in (demos, choice.earlier_file) if path is not None]
    selected = learnt.selection
    document = reward_document(
        learnt.fit,
        selected.demonstrations,
        inputs,
        selected.resolution_m,
        learnt.analyses,
        choice.steps.value,
        learnt.reach,
    )
    write_json(output / REWARD, "reward", document, force=True)


@dataclass(frozen=True, eq=False)
class NextPath:
    """A path of the next cycle."""

    #: Id of the trial whose scene it is.
    trial: str
    planner: Planner
    planned: Planned


def next_paths(learnt: Learnt, limits: Limits) -> list[NextPath]:
    """The paths of the next cycle, along the ridge of the expected visits, smooth.

    Args:
        learnt: What is learnt.
        limits: Of the robot.

    Raises:
        NavirlError: People leave no path.
    """
    found = []
    for one in next_trials(learnt.selection.demonstrations):
        planner = Planner(problem_of(one), learnt.fit.reward)
        path = planner.plan(Mode.EXPECTED)[0]
        line = smoothed(planner.problem, path.line_m, learnt.selection.resolution_m, limits)
        found.append(NextPath(one.id, planner, Planned(path, line)))
    return found


def write_paths(output: Path, paths: Sequence[NextPath], inputs: Sequence[Path]) -> None:
    """Write path_1.csv, .json and .yaml, and so on; older paths with higher numbers are removed.

    Raises:
        ArtefactError: A file cannot be written.
    """
    made_from = [Input.of(path) for path in inputs]
    for number, one in enumerate(paths, 1):
        document = plan_document(one.planner, [one.planned], Mode.EXPECTED, 0, made_from)
        for ending in ENDINGS:
            write_plan(output / f"path_{number}{ending}", document, force=True)
    kept = {f"path_{number}" for number in range(1, len(paths) + 1)}
    for old in output.glob("path_*"):
        if old.suffix in ENDINGS and old.stem not in kept:
            old.unlink()


def draw_paths(output: Path, paths: Sequence[NextPath]) -> None:
    """Write the figure of the paths of the next cycle.

    Raises:
        ArtefactError: It cannot be written.
    """
    plans = [
        (f"path_{number}: scene of {one.trial}", one.planner, [one.planned.line_m])
        for number, one in enumerate(paths, 1)
    ]
    draw_plans(output / FIGURE, plans, force=True)


def next_trials(demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
    """Trials whose scenes the robot drives next: of the last recording, each place once, where people stood last."""
    last = [one for one in demonstrations if one.log == demonstrations[-1].log]
    found: list[Demonstration] = []
    for one in reversed(last):
        ends = one.xy_m[[0, -1]]
        if all(np.hypot(*(ends - other.xy_m[[0, -1]]).T).max() > _SAME_M for other in found):
            found.append(one)
    return found[:MOST_PATHS][::-1]
