"""Measure 10,000 demonstrations over 5,000 scenes: written, read, and learnt from.

python benchmarks/thousands.py [--scenes N] [--json]. Every scene has a place of the person, a start and a goal of its
own, on one of 50 hallways of 100 x 52 cells, and two paths drawn from the policy of the published reward: some 60
cells, in 300 poses with forces. The file is written and read in this process; `navirl fit` runs as a process of its
own, with one worker and with two, whose rewards must be the same. Memory is the largest sum over its processes, read
four times a second. On idle cores it takes some 25 minutes.
"""

import argparse
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ["OMP_NUM_THREADS"] = "1"  # as the command sets it

import numpy as np
from rows import Row, report, shown
from scenes import PUBLISHED, hallway

from navirl_cli.artefacts.demonstrations import demonstrations_document, read_demonstrations
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.demonstration import Contact, Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import likelihood
from navirl_cli.irl.scene import Scene

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from factories import drawn

SEED = 7
MAPS, PEOPLE, POSES = 50, 100, 300


def floors() -> list[Grid]:
    """Hallways that differ in the place of a pillar."""
    plain = hallway().lattice.grid
    grids = []
    for number in range(MAPS):
        occupied = plain.occupied.copy()
        occupied[14 : 14 + 1 + number // 10, 40 + 2 * (number % 10) : 44 + 2 * (number % 10)] = True
        grids.append(Grid(occupied, plain.resolution_m, plain.origin_m))
    return grids


def demonstrations(scenes: int) -> list[Demonstration]:
    """Two of each scene."""
    rng = np.random.default_rng(SEED)
    grids, made = floors(), []
    for number in range(scenes):
        start, goal = np.array([18, 26]) + rng.integers(-4, 5, 2), np.array([82, 27]) + rng.integers(-4, 5, 2)
        person = np.array([[rng.uniform(3.0, 7.0), rng.uniform(1.6, 3.8)]])
        scene = Scene.on(grids[number % MAPS], start, goal, person)
        for one in drawn(scene, PUBLISHED, 2, int(rng.integers(1 << 30))):
            name = f"p{len(made) % PEOPLE:03d}"
            made.append(_measured(replace(one, id=f"{name}/{len(made) // PEOPLE + 1}", participant=name), rng))
    return made


def _measured(one: Demonstration, rng: np.random.Generator) -> Demonstration:
    """The trial as sensors see it: poses at a steady rate, and forces."""
    t_s = np.linspace(0.0, one.t_s[-1], POSES)
    xy_m = np.stack([np.interp(t_s, one.t_s, side) for side in one.xy_m.T], axis=1)
    yaw_rad = np.unwrap(np.arctan2(*np.gradient(xy_m, axis=0).T[::-1]))
    nearest = t_s[np.hypot(*(xy_m - one.people_m[0]).T).argmin()]
    contact = Contact(max(nearest - 1.0, 0.0), min(nearest + 0.5, t_s[-1]), 12.0, (0.0, 6.0))
    forces = rng.normal(0, 2, (POSES, 2))
    return replace(one, t_s=t_s, xy_m=xy_m, yaw_rad=yaw_rad, force_n=forces, contacts=(contact,))


def resident_gb(process: int) -> float:
    """Memory of a process and its children, GB; what they share counts once."""
    proc = Path("/proc") / str(process)
    try:
        own = next(line for line in (proc / "smaps_rollup").read_text().splitlines() if line.startswith("Pss:"))
        children = [int(word) for task in (proc / "task").iterdir() for word in (task / "children").read_text().split()]
    except (OSError, StopIteration):  # it has ended
        return 0.0
    return int(own.split()[1]) / 1e6 + sum(map(resident_gb, children))


def fitted(demos: Path, workers: int) -> tuple[float, float, bytes]:
    """Seconds of a fit as a process, its largest memory, GB, and the reward's file."""
    reward = demos.with_name(f"reward{workers}.json")
    words = ["-m", "navirl_cli", "fit", str(demos), "-o", str(reward), "--workers", str(workers), "--quiet"]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}
    begin, most = time.perf_counter(), 0.0
    with subprocess.Popen([sys.executable, *words], env=environment, stdout=subprocess.DEVNULL) as running:  # noqa: S603
        while running.poll() is None:
            most = max(most, resident_gb(running.pid))
            time.sleep(0.25)
    if running.returncode:
        raise SystemExit(f"navirl {' '.join(words[2:])} ended with {running.returncode}")
    return time.perf_counter() - begin, most, reward.read_bytes()


def evaluation_ms(demonstrations: Sequence[Demonstration]) -> float:
    """CPU of one evaluation of the likelihood with its derivatives, ms a scene, when the scenes are built."""
    evidence = evidence_of(demonstrations)
    likelihood(evidence, PUBLISHED)
    begin = time.process_time()
    likelihood(evidence, PUBLISHED)
    return 1e3 * (time.process_time() - begin) / len(evidence.scenes)


def rows(scenes: int) -> Iterator[Row]:
    """All measurements."""
    made = demonstrations(scenes)
    print(f"{len(made)} demonstrations drawn", file=sys.stderr)
    with TemporaryDirectory() as name:
        path = Path(name) / "demos.json"
        begin, used = time.perf_counter(), time.process_time()
        write_json(path, "demonstrations", demonstrations_document(made, [], {}), force=True)
        yield Row("written", time.perf_counter() - begin, "s")
        yield Row("written, CPU", time.process_time() - used, "s")
        yield Row("file", path.stat().st_size / 1e6, "MB")
        begin, used = time.perf_counter(), time.process_time()
        found = read_demonstrations(path)
        yield Row("read", time.perf_counter() - begin, "s")
        yield Row("read, CPU", time.process_time() - used, "s")
        assert len(found) == len(made)  # noqa: S101
        yield Row("memory of this process", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, "GB")
        yield Row("an evaluation of the likelihood, a scene", evaluation_ms(found[:200]), "ms")
        del found, made
        one, memory, first = fitted(path, 1)
        yield Row("fit, one process", one, "s")
        yield Row.at_most("memory of the fit, one process", memory, "GB", 4)
        two, memory, second = fitted(path, 2)
        yield Row("fit, two processes", two, "s")
        yield Row.at_most("memory of the fit, two processes", memory, "GB", 4)
        yield Row("one process over two", one / two, "")
        yield Row.at_least("rewards of one and of two processes are the same", float(first == second), "", 1)


def main() -> int:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=5000, help="number of scenes, with two demonstrations each")
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    return report(shown(rows(given.scenes)), as_json=given.json)


if __name__ == "__main__":
    sys.exit(main())
