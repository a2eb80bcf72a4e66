"""Measure random effects over participants: on simulated people whose truth is known, and on the published study.

python benchmarks/persons.py [--part simulated|study] [--sets N] [--first N] [--quick] [--json]. Simulated: sets of 36
people with two paths each, whose parameters are scattered by 10 to 25 % around a typical person. Each set is fitted as
one person and with random effects; counted is whose 95 % intervals cover the typical person. Study (environment
variable NAVIRL_STUDY_DIR: the unpacked runs): each path is left out and predicted by the person's own other path, by
the other people, by all together as one person, and by random effects. Exit 0 only where every bar holds. --quick takes
one set of 18 people, --first other sets than the first ones.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded: the processes are many enough

import numpy as np
from rows import Row, report
from scenes import hallway

import navirl_cli
from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.irl.evidence import Evidence, evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.intervals import Kind, intervals
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.population import population
from navirl_cli.irl.reward import Reward
from navirl_cli.parallel import Local, map_in_order

sys.path.append(str(Path(__file__).parent.parent / "tests"))
from factories import drawn

#: The typical person, c0, a_g, a_p, sigma_p, and how people are scattered around: standard deviations of logarithms.
TYPICAL = np.array([-50.0, -0.9, -5.07, 1.60])
SCATTER = np.array([0.10, 0.25, 0.20, 0.20])
NAMES = ("c0", "a_g", "a_p", "sigma_p")
PEOPLE, QUICK_PEOPLE, SETS = 36, 18, 8
#: Least share of intervals that cover, and the most seconds of a fit of 13 people.
COVERING, SECONDS = 0.85, 20.0


@dataclass(frozen=True)
class Fitted:
    """One set: (4,) estimates and whether their intervals cover the typical person, pooled and typical."""

    pooled: FloatArray
    typical: FloatArray
    pooled_covers: FloatArray
    typical_covers: FloatArray
    #: (4,) scatters, and whether their intervals cover; share of the people's intervals that cover; CPU time, s.
    scatter: FloatArray
    scatter_covers: FloatArray
    persons_cover: float
    cpu_s: float


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=("simulated", "study"), help="one part alone")
    parser.add_argument("--sets", type=int, default=SETS, help="simulated sets")
    parser.add_argument("--first", type=int, default=0, help="seed of the first simulated set")
    parser.add_argument("--quick", action="store_true", help="one set of 18 people")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    rows: list[Row] = []
    if options.part != "study":
        count, sets = (QUICK_PEOPLE, 1) if options.quick else (PEOPLE, options.sets)
        rows += simulated(count, range(options.first, options.first + sets))
    if options.part != "simulated":
        where = Path(os.environ.get("NAVIRL_STUDY_DIR") or Path(__file__).parents[2] / "shared" / "study")
        if where.exists():
            rows += study(where)
        else:
            print(f"the published study's data are not available in {where}; set NAVIRL_STUDY_DIR", file=sys.stderr)
            if options.part == "study":
                return 2
    return report(rows, as_json=options.json)


def people(count: int, seed: int) -> tuple[list[Demonstration], FloatArray]:
    """Two paths of each person, and the (count, 4) logarithms of their parameters' magnitudes."""
    rng, scene = np.random.default_rng(seed), hallway()
    demonstrations, own = [], []
    for number in range(count):
        theta = TYPICAL * np.exp(SCATTER * rng.standard_normal(4))
        own.append(np.log(np.abs(theta)))
        demonstrations += [
            replace(one, participant=f"p{number:02d}", id=f"p{number:02d}/{k}")
            for k, one in enumerate(drawn(scene, Reward(tuple(theta)), 2, int(rng.integers(2**31))))
        ]
    return demonstrations, np.array(own)


def fitted(seed: int, count: int) -> Fitted:
    """One set."""
    demonstrations, own = people(count, seed)
    evidence = evidence_of(demonstrations)
    pooled = fit(evidence, Reward.named({}))
    begun = time.process_time()
    typical, found, ends = population(evidence, pooled, executor=Local(1))
    cpu_s = time.process_time() - begun
    of_pooled, of_typical = (
        {one.parameter: one for one in some.ends} for some in (intervals(evidence, pooled, Kind.WALD)[0], ends)
    )
    covers = [
        np.array([one[name].lower <= truth <= one[name].upper for name, truth in zip(NAMES, TYPICAL, strict=True)])
        for one in (of_pooled, of_typical)
    ]
    low, high = (np.log(np.abs([getattr(one, side) for one in found.persons])) for side in ("lower", "upper"))
    inside = (np.minimum(low, high) <= own) & (own <= np.maximum(low, high))
    scattered = (found.scatter_lower <= SCATTER) & (found.scatter_upper >= SCATTER)
    theta = [np.array(one.reward.theta) for one in (pooled, typical)]
    return Fitted(*theta, *covers, found.scatter, scattered, float(inside.mean()), cpu_s)


def simulated(count: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Whose intervals cover the typical person."""
    found, sets = list(map_in_order(partial(fitted, count=count), list(seeds))), len(seeds)
    mean = {name: np.mean([getattr(one, name) for one in found], axis=0) for name in Fitted.__dataclass_fields__}
    for j, name in enumerate(NAMES):
        title = f"{name} {TYPICAL[j]:g}, {sets} sets of {count} people"
        yield Row(f"{title}: as one person", mean["pooled"][j], "")
        yield Row(f"{title}: typical", mean["typical"][j], "")
        yield Row(f"{title}: intervals as one person that cover", mean["pooled_covers"][j], "")
        yield Row(f"{title}: intervals of the typical person that cover", mean["typical_covers"][j], "")
        yield Row(f"{name}: people differ by {SCATTER[j]:g}, found", mean["scatter"][j], "")
    space = np.array([one.pooled_covers[2:] for one in found]).mean()
    yield Row.at_most("a_p and sigma_p as one person, share that covers", float(space), "", 0.5)
    share = float(mean["typical_covers"].mean())
    yield Row.at_least("typical person, share of all intervals that covers", share, "", COVERING if sets > 1 else 0.75)
    yield Row.at_least("scatter, share of intervals that covers", float(mean["scatter_covers"].mean()), "", 0.75)
    yield Row.at_least("single people, share of intervals that covers", float(mean["persons_cover"]), "", 0.9)
    yield Row.at_most("fit with random effects, CPU for 13 people", float(mean["cpu_s"]) * 13 / count, "s", SECONDS)


def study(where: Path) -> Iterator[Row]:
    """Predictions of the paths left out."""
    demonstrations = published(where / "runs" if (where / "runs").is_dir() else where)
    for name, chosen in (
        ("force, cycle 2", [one for one in demonstrations if one.condition is Condition.FORCE and one.cycle == 2]),
        ("joystick", [one for one in demonstrations if one.condition is Condition.JOYSTICK]),
    ):
        evidence = evidence_of(chosen)
        jobs = [(evidence, j) for j in range(len(chosen))]
        nats = np.array(list(map_in_order(predicted, jobs)))
        owners = np.array(evidence.participants)
        by_person = np.array([nats[owners == one].mean(axis=0) for one in evidence.people])
        title = f"{name}, {len(evidence.people)} people, nats a step"
        for column, what in enumerate(("the other people", "all as one person", "own other path", "typical person")):
            yield Row(f"{title}: {what}", float(by_person[:, column].mean()), "")
        own = by_person[:, -1]
        yield Row(f"{title}: random effects", float(own.mean()), "")
        for column, what in ((1, "all as one person"), (0, "the other people"), (2, "own other path")):
            away = own - by_person[:, column]
            error = float(away.std(ddof=1) / np.sqrt(len(away)))
            yield Row.at_least(f"{name}: random effects minus {what} (± {error:.3f})", float(away.mean()), "", 0.0)


def published(where: Path) -> Sequence[Demonstration]:
    """The demonstrations of the study."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "navirl_cli", "import-study", where, "-o", folder, "--force"]
        subprocess.run(command, check=True, capture_output=True)  # noqa: S603 - own command
        return navirl_cli.extract(*sorted(Path(folder).iterdir()), no_wrench=True)


def predicted(job: tuple[Evidence, int]) -> list[float]:
    """Log-likelihood a step of a path under what was learnt from the others, nats."""
    evidence, left_out = job
    start, count = Reward.named({}), evidence.count
    out = np.arange(count) == left_out
    own = np.array([one == evidence.participants[left_out] for one in evidence.participants])
    rest, test = evidence.repeated((~out).astype(int)), evidence.repeated(out.astype(int))
    pooled = fit(rest, start)
    typical, found, _ = population(rest, pooled, executor=Local(1))
    person = next(one for one in found.persons if one.name == evidence.participants[left_out])
    rewards = (
        fit(evidence.repeated((~own).astype(int)), start).reward,
        pooled.reward,
        fit(evidence.repeated((own & ~out).astype(int)), start).reward,
        typical.reward,
        person.reward,
    )
    return [log_likelihood(test, one) / test.steps for one in rewards]


if __name__ == "__main__":
    sys.exit(main())
