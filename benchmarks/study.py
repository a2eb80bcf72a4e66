"""Measure the work on the published study: rasterisation, sampled paths and their metrics, import, evaluation.

python benchmarks/study.py [--quick] [--json]. Needs the published data (environment variable NAVIRL_STUDY_DIR: the
unpacked runs, or the archive). Each row ends with its bar; exit 0 only where every bar holds. The bars are for four
participants. For more data the times are divided by the number of participants and multiplied by four.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rows import Row, median_seconds, report

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.rasterize import rasterize
from navirl_cli.evaluation.metrics import METRICS
from navirl_cli.evaluation.policy_paths import PolicyLines, Steps
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import SampledPaths, sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.published.participant import participant_of
from navirl_cli.published.runs import runs_in
from navirl_cli.study.pipeline import PUBLISHED_THETA

BIN = Path(sys.executable).parent
FOUR = 4


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one run of each")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    where = Path(os.environ.get("NAVIRL_STUDY_DIR") or Path(__file__).parents[2] / "shared" / "study")
    if not where.exists():
        print(f"the published study's data are not available in {where}; set NAVIRL_STUDY_DIR", file=sys.stderr)
        return 2
    runs = 1 if options.quick else 5
    return report([*paths(where, runs), *drawn(where, runs), *commands(where, runs)], as_json=options.json)


def paths(where: Path, runs: int) -> list[Row]:
    """Rasterise every published path, and count the paths with the published cells."""
    found = [participant_of(run) for run in runs_in(where)[0]]
    every = [(path, one.grid) for one in found for path in one.paths]
    times = [median_seconds(lambda p=path, g=grid: rasterize(p.xy_m, g), 3 * runs) for path, grid in every]
    same = sum(rasterize(path.xy_m, grid).tolist() == path.cells.tolist() for path, grid in every)
    return [
        Row.at_least(f"cells as published, of {len(every)} paths", same, "", len(every)),
        Row.at_most("rasterising a path, median", 1e3 * sorted(times)[len(times) // 2], "ms", 10.0),
        Row.at_most("rasterising a path, slowest", 1e3 * max(times), "ms", 10.0),
    ]


def drawn(where: Path, runs: int) -> list[Row]:
    """Ten thousand paths of the published policy on the study's map."""
    one = participant_of(runs_in(where)[0][0])
    passed = next(path for path in one.paths if path.part.cycle == 2)
    scene = Scene.on(one.grid, passed.cells[0], passed.cells[-1], one.grid.centres_of(passed.people))
    policy = policy_of(Reward.named(PUBLISHED_THETA), scene)
    steps, nominal = Steps(scene.lattice, scene.people_m, 0.4), scene.nominal_line_m()

    def draw() -> SampledPaths:
        return sample_paths(policy, scene.start, 10_000, np.random.default_rng(0))

    paths = draw()

    def measure() -> list[FloatArray]:
        lines = PolicyLines.of(steps, paths, nominal)
        return [metric.lines(lines) for metric in METRICS if metric.lines is not None]

    return [
        Row.at_most("sampling 10,000 paths", median_seconds(draw, runs), "s", 3.0),
        Row.at_most("metrics of 10,000 paths", median_seconds(measure, runs), "s", 10.0),
    ]


def commands(where: Path, runs: int) -> list[Row]:
    """The two commands as processes."""
    imported, studied = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(runs):
            logs, out = Path(folder) / f"logs{number}", Path(folder) / f"out{number}"
            imported.append(seconds("import-study", where, "-o", logs))
            files = sorted(logs.glob("*.mcap"))
            studied.append(seconds("study", *files, "-o", out))
        scale = FOUR / len(files)
    return [
        Row.at_most("navirl import-study, four participants", scale * sorted(imported)[runs // 2], "s", 5.0),
        Row.at_most("navirl study, four participants", scale * sorted(studied)[runs // 2], "s", 20.0),
    ]


def seconds(*words: object) -> float:
    """Wall time of a navirl command, s."""
    begun = time.perf_counter()
    subprocess.run([str(BIN / "navirl"), *map(str, words)], check=True, capture_output=True)  # noqa: S603
    return time.perf_counter() - begun


if __name__ == "__main__":
    sys.exit(main())
