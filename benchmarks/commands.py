"""CPU time of the commands as a user runs them, in multiples of `python -c "import numpy"`.

python benchmarks/commands.py [--quick] [--json]. CPU time is the user and system time of the process and its children.
Baseline and commands run alternately, and medians are compared. The commands run on one sample log and its
demonstrations; evaluate and report also on the demonstrations of the published study, if its data are available
(NAVIRL_STUDY_DIR, or ../shared/study). One row compares a fit from Python with as many threads of BLAS as numpy starts
by itself to the same with one, as on the command line. Rows end with their bar; exit 0 only where every bar holds.
--quick leaves out the study and the demo.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory

from rows import Row, report

ROOT = Path(__file__).parent.parent
STUDY = Path(os.environ.get("NAVIRL_STUDY_DIR") or ROOT.parent / "shared" / "study")
#: Demonstrations of the published study that the bars are for.
STUDY_DEMONSTRATIONS = 130
BASELINE = (sys.executable, "-c", "import numpy")
NAVIRL = (sys.executable, "-m", "navirl_cli")
UNIT = "x numpy"
#: A fit as in a notebook, and the number of threads of BLAS in the environment: unset, one.
FIT = (sys.executable, "-c", "import navirl_cli; navirl_cli.fit('demos.json', condition='force', cycle=2)")
FREE, ONE = ("env", "-u", "OPENBLAS_NUM_THREADS", *FIT), ("env", "OPENBLAS_NUM_THREADS=1", *FIT)


@dataclass(frozen=True)
class Job:
    """A command and the multiple of the baseline that it may take."""

    what: str
    words: Sequence[object]
    bar: float


def environment() -> dict[str, str]:
    """Environment of the commands: navirl of this checkout, and the programs of this Python."""
    paths = {"PATH": str(Path(sys.executable).parent), "PYTHONPATH": str(ROOT)}
    return {**os.environ, **{name: os.pathsep.join([first, os.environ.get(name, "")]) for name, first in paths.items()}}


def cpu_s(words: Iterable[object], folder: Path) -> float:
    """CPU time of a command and its children, s."""
    before = getrusage(RUSAGE_CHILDREN)
    done = subprocess.run(  # noqa: S603
        [*map(str, words)], cwd=folder, env=environment(), capture_output=True, text=True, check=False
    )
    if done.returncode not in {0, 3}:  # 3: done, but some trials were skipped
        sys.exit(f"{' '.join(map(str, words))}: exit code {done.returncode}\n{done.stderr}")
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def navirl(folder: Path, *words: object) -> None:
    """Make a file that the commands need, and ignore the output."""
    cpu_s((*NAVIRL, *words), folder)


def sample_jobs(folder: Path) -> list[Job]:
    """The commands on one sample log."""
    log = ROOT / "sample_logs" / "p01.mcap"
    chosen = ("--condition", "force", "--cycle", "2")
    navirl(folder, "extract", log, "-o", "demos.json")
    navirl(folder, "fit", "demos.json", *chosen, "-o", "reward.json")
    learnt = ("demos.json", "--reward", "reward.json")
    return [
        Job("navirl --help", (*NAVIRL, "--help"), 0.8),
        Job("inspect", (*NAVIRL, "inspect", log), 3.5),
        Job("extract", (*NAVIRL, "extract", log, "-o", "new.json", "--force"), 5.5),
        Job("fit", (*NAVIRL, "fit", "demos.json", *chosen, "-o", "new.json", "--force"), 4.5),
        Job("evaluate", (*NAVIRL, "evaluate", *learnt), 8.0),
        Job("plot policy", (*NAVIRL, "plot", "policy", *learnt, "-o", "policy.png", "--force"), 10.0),
    ]


def study_jobs(folder: Path) -> list[Job]:
    """The commands on the demonstrations of the published study."""
    navirl(folder, "import-study", STUDY, "-o", "logs")
    navirl(folder, "extract", "logs", "--no-wrench", "-o", "study.json")
    navirl(folder, "fit", "study.json", "--condition", "force", "--cycle", "2", "-o", "study_reward.json")
    count = len(json.loads((folder / "study.json").read_text(encoding="utf-8"))["demonstrations"])
    among = f"{count} demonstrations" + ("" if count == STUDY_DEMONSTRATIONS else f" of {STUDY_DEMONSTRATIONS}")
    page = ("-o", "report.html", "--force")
    return [
        Job(f"evaluate, {among}", (*NAVIRL, "evaluate", "study.json", "--reward", "study_reward.json"), 15.0),
        Job(f"report, {among}", (*NAVIRL, "report", "study.json", "study_reward.json", *page), 45.0),
    ]


def measured(jobs: Sequence[Job], runs: int, folder: Path) -> list[Row]:
    """Run baseline and commands alternately; give the medians as multiples."""
    baseline: list[float] = []
    times: dict[str, list[float]] = {job.what: [] for job in jobs}
    for _ in range(runs):
        for job in jobs:
            baseline.append(cpu_s(BASELINE, folder))
            times[job.what].append(cpu_s(job.words, folder))
    unit_s = statistics.median(baseline)
    return [Row.at_most(job.what, statistics.median(times[job.what]) / unit_s, UNIT, job.bar) for job in jobs]


def threads_row(runs: int, folder: Path) -> Row:
    """CPU time of a fit from Python, by what one thread of BLAS takes."""
    times: dict[tuple[str, ...], list[float]] = {FREE: [], ONE: []}
    for _ in range(runs):
        for words, own in times.items():
            own.append(cpu_s(words, folder))
    ratio = statistics.median(times[FREE]) / statistics.median(times[ONE])
    return Row(f"fit from Python, BLAS threads of {os.cpu_count()} cores", ratio, "x one thread")


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="three runs of the commands on the sample log alone")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        runs = 3 if options.quick else 9
        rows = [*measured(sample_jobs(folder), runs, folder), threads_row(runs, folder)]
        if not options.quick:
            if STUDY.is_dir():
                rows += measured(study_jobs(folder), 3, folder)
            else:
                print(f"the published study is not available in {STUDY}; set NAVIRL_STUDY_DIR", file=sys.stderr)
            # 25 s of CPU where importing numpy takes 0.2 s
            rows += measured([Job("make demo, installed", ("sh", ROOT / "sample_logs" / "demo.sh"), 125.0)], 1, folder)
    return report(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
