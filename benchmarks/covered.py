"""How often the printed 95 % intervals cover what they are intervals of, by simulation.

Data sets of 2 demonstrations of one person, of 6 by three people and of 26 by thirteen people, in a passing task of a
quarter of the study's cells. People are alike, or every person's parameters differ by 20 % (a standard deviation of 0.2
of their logarithms). An interval of one person must cover that person's reward. An interval of several people must
cover what the fit tends to with ever more such people: for people who differ this is not the average person.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf
from pathlib import Path

import numpy as np
from rows import Row
from scenes import PUBLISHED, RESOLUTION_M

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.intervals import default_kind, intervals
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.status import Status
from navirl_cli.parallel import map_in_order

sys.path.append(str(Path(__file__).parent.parent / "tests"))
import factories as make

SEED = 95
#: People, and demonstrations of each.
DESIGNS = ((1, 2), (3, 2), (13, 2))
SCATTERS = (0.0, 0.2)
#: People of the pool whose fit stands for the limit.
LIMIT_PEOPLE = 1500
#: Share of right intervals below or above which an interval must call itself approximate.
BAR = (92.0, 98.0)


@cache
def scene() -> Scene:
    """A hallway of 5 m with the person on the middle of the nominal path."""
    grid = Grid(np.zeros((21, 52), dtype=bool), RESOLUTION_M, (0.0, 0.0))
    return Scene.on(grid, np.array([4, 10]), np.array([47, 10]), grid.centres_of(np.array([[26, 10]])))


@dataclass(frozen=True)
class Covered:
    """One data set: by parameter, whether the target is covered; NaN where there is no interval."""

    status: Status
    front: FloatArray
    behind: FloatArray
    #: Whether an end is open, in front.
    is_open: FloatArray


def drawn(people: int, each: int, scatter: float, seed: Sequence[int]) -> tuple[list[Demonstration], FloatArray]:
    """Demonstrations of people around the published reward, and the (people, k) rewards."""
    rng = np.random.default_rng(seed)
    truths = np.array(PUBLISHED.theta) * np.exp(scatter * rng.standard_normal((people, 4)))
    shown = []
    for number, truth in enumerate(truths.tolist()):
        own = make.drawn(scene(), Reward(tuple(truth)), each, int(rng.integers(2**31)))
        shown += [replace(one, participant=f"p{number:04d}", id=f"p{number:04d}/{k}") for k, one in enumerate(own)]
    return shown, truths


@cache
def limit(scatter: float) -> FloatArray:
    """(k,) what the fit tends to with ever more people."""
    if scatter == 0:
        return np.array(PUBLISHED.theta)
    shown, _ = drawn(LIMIT_PEOPLE, 2, scatter, (SEED,))
    return np.array(fit(evidence_of(shown), PUBLISHED, scan=False).reward.theta)


def covered(job: tuple[int, int, int, float, tuple[float, ...]]) -> Covered:
    """Fit one data set and see what its intervals cover."""
    number, people, each, scatter, target = job
    shown, truths = drawn(people, each, scatter, (SEED, people, int(100 * scatter), number))
    evidence = evidence_of(shown)
    found = fit(evidence, Reward.named({}))
    aim = truths[0] if people == 1 else np.array(target)
    sets = intervals(evidence, found, default_kind(found))
    names = [parameter.name for parameter in PUBLISHED.parameters]
    inside = np.full((2, 4), np.nan)
    opens = np.zeros(4)
    for own, one in zip(inside, sets, strict=False):
        for ends in one.ends:
            j = names.index(ends.parameter)
            low, high = (-inf if ends.lower is None else ends.lower), (inf if ends.upper is None else ends.upper)
            own[j] = low <= aim[j] <= high
            if one is sets[0]:
                opens[j] = ends.is_open
    return Covered(found.status, *inside, opens)


def rows(count: int) -> list[Row]:
    """Coverage by design, scatter, set of intervals and parameter.

    Only what does not call itself approximate has a bar.
    """
    found = []
    for people, each in DESIGNS:
        for scatter in SCATTERS:
            target = tuple(limit(scatter).tolist())
            jobs = [(number, people, each, scatter, target) for number in range(count)]
            done = list(map_in_order(covered, jobs))
            head = f"{people * each} demonstrations of {people}, scatter {100 * scatter:.0f} %"
            found += _rows(head, people, done)
    return found


def _rows(head: str, people: int, done: Sequence[Covered]) -> list[Row]:
    slack = 2 * 100 * np.sqrt(0.05 * 0.95 / len(done))
    low, high = BAR[0] - slack, min(100.0, BAR[1] + slack)
    # Fewer than ten demonstrations or people are called approximate.
    sets = [("as if one person", "front", False)] if people == 1 else [
        ("by participant", "front", people >= 10),
        ("as if one person", "behind", False),
    ]  # fmt: skip
    found = []
    for title, name, claims in sets:
        for j, parameter in enumerate(PUBLISHED.parameters):
            values = np.array([getattr(one, name)[j] for one in done])
            share = float(100 * np.nanmean(values))
            bar = f"{BAR[0]:g} to {BAR[1]:g} % ± 2 Monte Carlo errors" if claims else ""
            what = f"{head}, {title}: {parameter.name} covered"
            found.append(Row(what, share, "%", bar, not claims or low <= share <= high))
            if name == "front":
                found.append(Row(f"{what}, open", float(100 * np.mean([one.is_open[j] for one in done])), "%"))
    return found
