"""What counts as evidence where people reach only so far: the table of the docs page "Limits of the method".

python benchmarks/reach.py [--quick] [--json]. Simulated people of one true reward push the robot within a limited
reach, in the two cycles of the study. They come in groups; each group gives a fit for every rule of what counts. A
figure is the least distance to the person of the learnt policy minus that of the true one, from a central start: mean
and standard error over groups. "The wanted cells" are the paths that the people wanted, which no log holds.

The least distance of a policy is the mean over its drawn paths, between the centres of robot and person. --quick takes
2 groups. The last rows of each behaviour compare the joystick with force: with a free joystick people must pass farther
away, as in the study (0.91 against 0.74 m). People of the third behaviour reach far, but intervene only where the
robot's path displeases them by more than a tolerance.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded: the processes are many enough

import numpy as np

sys.path.append(str(Path(__file__).parent.parent / "tests"))
from rows import Row, report

from navirl_cli.demos.contact import PushSettings, hysteresis
from navirl_cli.demos.demonstration import Condition, Contact, Demonstration
from navirl_cli.demos.rasterize import rasterize
from navirl_cli.evaluation.lines import Lines
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps, with_steps
from navirl_cli.simulation.behaviour import Behaviour, Joystick
from navirl_cli.simulation.driving import GAIN_S_KG, STEP_S
from navirl_cli.simulation.hallway import LANE_Y_M, Hallway
from navirl_cli.simulation.person import PUBLISHED
from navirl_cli.simulation.protocol import Pass, Session, as_demonstration, scene_of, session

SEED = 2020
TRUTH = Reward(PUBLISHED)
#: 36 people of each behaviour.
GROUPS, QUICK_GROUPS, PEOPLE = 9, 2, 4
#: By name.
BEHAVIOURS = {
    name: replace(behaviour, scatter=0.0, joystick=Joystick.FREE)
    for name, behaviour in {
        "reach 1.2 m": Behaviour(reach_m=1.2),
        "reach 2.4 m": Behaviour(reach_m=2.4),
        "reach 2.4 m, tolerance 5 nats": Behaviour(reach_m=2.4, tolerance_nats=5.0),
    }.items()
}
SAMPLES = 4000
#: The reach of the last rule is that of the contacts.
RULES = ("the wanted cells", "all", "contact", "reachable, reach known", "reachable, reach by contacts")


def as_extracted(hallway: Hallway, one: Pass, name: str) -> Demonstration:
    """A pass as demonstration with its contacts, as `navirl extract` would find them in a log without noise."""
    made = as_demonstration(hallway, one, name)
    force = np.hypot(*one.steering.T) / GAIN_S_KG
    begins = PushSettings().begins_n
    spans = hysteresis(force, begins, begins / 2)
    last = made.t_s[-1]
    contacts = [Contact(a * STEP_S, min(b * STEP_S, last), float(force[a : b + 1].max()), (0.0, 0.0)) for a, b in spans]
    return replace(made, contacts=tuple(one for one in contacts if one.end_s > one.start_s))


def as_wanted(hallway: Hallway, one: Pass, name: str) -> Demonstration:
    """The path that the person wanted, as demonstration."""
    made, line = as_demonstration(hallway, one, name), one.wanted.xy_m
    cells = rasterize(line, hallway.free)
    t_s = np.arange(len(line)) * 0.1
    zeros = np.zeros(len(line))
    return replace(made, t_s=t_s, xy_m=line, yaw_rad=zeros, cells=cells, grid=hallway.free.freed(cells))


def least_distance_m(reward: Reward) -> float:
    """Mean least distance between the centres on paths of a policy from a central start, m."""
    rng = np.random.default_rng(SEED)
    hallway = replace(Hallway.with_person(rng), person_m=np.array([0.1, LANE_Y_M]))
    scene = scene_of(hallway, 0.0)
    paths = sample_paths(policy_of(reward, scene), scene.start, SAMPLES, rng)
    lines = Lines(scene.lattice.xy_m[paths.states], scene.lattice.xy_m[[scene.start]], scene.people_m, 0.0)
    return float(lines.min_distance_m.mean())


def learnt(rule: str, people: Sequence[Session], cycle: int, reach_m: float) -> float:
    """Least distance of the policy learnt from a group's passes in a cycle under a rule, m."""
    make: Callable[[Hallway, Pass, str], Demonstration] = as_wanted if rule == RULES[0] else as_extracted
    demonstrations = [
        make(one.hallway, own, f"{one.name}/{number}")
        for one in people
        for number, own in enumerate(one.passes)
        if own.condition is Condition.FORCE and own.cycle == cycle
    ]
    steps = Steps.ALL if rule == RULES[0] else Steps(rule.split(",", maxsplit=1)[0])
    selected = with_steps(demonstrations, steps, reach_m if rule.endswith("known") else None)
    return least_distance_m(fit(selected.evidence, Reward.named({})).reward)


def group(number: int, behaviour: Behaviour) -> tuple[np.ndarray, np.ndarray]:
    """Of one group the (rules, 2) least distances by rule and cycle, m, and (2,) of paths by force and joystick, m."""
    people = [session(number * PEOPLE + k + 1, SEED, behaviour) for k in range(PEOPLE)]
    found = [[learnt(rule, people, cycle, behaviour.reach_m) for cycle in (1, 2)] for rule in RULES]
    driven = [
        np.mean(
            [
                np.hypot(*(own.drive.xy_m - one.hallway.person_m).T).min()
                for one in people
                for own in one.passes
                if own.condition is condition and own.cycle == cycle
            ]
        )
        for condition, cycle in ((Condition.FORCE, 2), (Condition.JOYSTICK, None))
    ]
    return np.array(found), np.array(driven)


def rows(groups: int) -> list[Row]:
    """The table."""
    true = least_distance_m(TRUTH)
    found = [Row("true policy: least distance", true, "m")]
    with ProcessPoolExecutor(2) as pool:
        for name, behaviour in BEHAVIOURS.items():
            done = list(pool.map(partial(group, behaviour=behaviour), range(groups)))
            distances, driven = (np.array(part) for part in zip(*done, strict=True))
            away = distances - true
            error = away.std(axis=0, ddof=1) / np.sqrt(groups)
            for r, rule in enumerate(RULES):
                for c, cycle in enumerate((1, 2)):
                    what = f"{name}, cycle {cycle}, {rule} (± {error[r, c]:.3f})"
                    found.append(Row(what, float(away[:, r, c].mean()), "m"))
            found.append(Row(f"{name}, driven by force, cycle 2: least distance", float(driven[:, 0].mean()), "m"))
            farther = driven[:, 1] - driven[:, 0]
            spread = farther.std(ddof=1) / np.sqrt(groups)
            what = f"{name}, driven by a free joystick, minus by force (± {spread:.3f})"
            found.append(Row.at_least(what, float(farther.mean()), "m", 0.0))
    return found


def main() -> int:
    """Measure, print, compare with the bar."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="2 groups")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    return report(rows(QUICK_GROUPS if options.quick else GROUPS), as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
