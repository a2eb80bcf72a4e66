"""Measure the time from a finished log to the next paths under navirl watch, and the CPU time of waiting (Linux).

python benchmarks/watch.py [--json]. The sample logs are copied into a watched folder one after the other. Unlike the
time that passes, CPU time of the process does not depend on other work of the machine.
"""

import argparse
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from rows import Row, report

LOGS = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))
#: Bars: from a log to paths, s; share of a processor while nothing happens, %.
MOST_S, MOST_PERCENT = 3.0, 1.0
IDLE_S = 20.0
#: CPU time of the start, at least, s.
STARTED_S = 0.3


def cpu_s(process: int) -> float:
    """CPU time of a running process, s (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100


def idle(process: int, quiet_s: float = 2.0) -> None:
    """Wait until a process has started and does nothing."""
    before = -1.0
    while (now := cpu_s(process)) < STARTED_S or now - before > 0.02:
        before = now
        time.sleep(quiet_s)


def changed(path: Path, before: int) -> None:
    """Wait until a file is newer."""
    while not path.exists() or path.stat().st_mtime_ns <= before:
        time.sleep(0.01)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "logs").mkdir()
        words = ["watch", "logs", "--condition", "force", "-o", "visit"]
        command = [sys.executable, "-m", "navirl_cli", *words]
        watch = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)  # noqa: S603
        try:
            rows = measured(watch.pid, folder)
        finally:
            watch.send_signal(signal.SIGINT)
            watch.wait()
    return report(rows, as_json=given.json)


def measured(process: int, folder: Path) -> list[Row]:
    """The rows of the table, of a running watch."""
    rows = []
    idle(process)
    for log in LOGS:
        path, before = folder / "visit" / "path_1.csv", time.time_ns()
        used, began = cpu_s(process), time.monotonic()
        shutil.copy(log, folder / "logs" / log.name)
        changed(path, before)
        wall, cpu = time.monotonic() - began, cpu_s(process) - used
        rows.append(Row.at_most(f"{log.name}: from the log to the paths", wall, "s", MOST_S))
        rows.append(Row.at_most(f"{log.name}: of this, CPU time", cpu, "s", MOST_S))
        idle(process)
    used = cpu_s(process)
    time.sleep(IDLE_S)
    share = 100 * (cpu_s(process) - used) / IDLE_S
    return [*rows, Row.at_most("waiting", share, "% of a processor", MOST_PERCENT)]


if __name__ == "__main__":
    sys.exit(main())
