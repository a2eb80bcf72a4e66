"""Worker processes end with their parent, however it ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SAMPLES = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))
PROC = Path("/proc")
pytestmark = pytest.mark.skipif(not PROC.is_dir(), reason="needs /proc to find the workers")


def children(parent):
    """The processes that a process has begun and that run."""
    found = set()
    for stat in PROC.glob("[0-9]*/stat"):
        try:
            _, _, rest = stat.read_text().rpartition(") ")
        except OSError:
            continue
        state, above = rest.split()[:2]
        if int(above) == parent and state != "Z":
            found.add(int(stat.parent.name))
    return found


def wait_for(condition, seconds=30):
    """Wait until a condition holds; whether it did."""
    for _ in range(seconds * 50):
        if condition():
            return True
        time.sleep(0.02)
    return False


EXTRACT = ("extract", *SAMPLES, *SAMPLES, "-o", "demos.json")
SIMULATE = ("simulate", "--participants", "6", "-o", "logs")


@pytest.mark.parametrize(
    ("words", "number"),
    [
        pytest.param(EXTRACT, signal.SIGKILL, id="extract killed"),
        pytest.param(SIMULATE, signal.SIGTERM, id="simulate terminated"),
        pytest.param(EXTRACT, signal.SIGTERM, id="extract terminated", marks=pytest.mark.slow),
        pytest.param(SIMULATE, signal.SIGKILL, id="simulate killed", marks=pytest.mark.slow),
    ],
)
def test_workers_end_with_their_parent(tmp_path, words, number):
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}
    command = subprocess.Popen(
        [sys.executable, "-m", "navirl_cli", *map(str, words)],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    assert wait_for(lambda: len(children(command.pid)) >= 2 or command.poll() is not None)
    workers = children(command.pid)
    assert len(workers) >= 2, "ended before it had workers"
    command.send_signal(number)
    command.wait(30)
    assert command.returncode == (143 if number == signal.SIGTERM else -signal.SIGKILL)
    assert wait_for(lambda: not any(running(worker) for worker in workers))
    if number == signal.SIGTERM:
        assert [path for path in tmp_path.rglob("*") if path.name.endswith(".tmp")] == []


def running(process):
    """Whether a process runs; one that waits to be reaped does not."""
    try:
        return (PROC / str(process) / "stat").read_text().rpartition(") ")[2].split()[0] != "Z"
    except OSError:
        return False
