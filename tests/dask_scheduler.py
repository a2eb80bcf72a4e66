"""A Dask scheduler and its workers as processes on loopback."""

import os
import re
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

from navirl_cli.cluster import connected
from navirl_cli.errors import ArgumentError


@contextmanager
def scheduler(workers=2, folders=(), **environment):
    """Yield the address of a scheduler and its worker processes, and end them after the block."""
    words = ["--no-dashboard", "--host", "127.0.0.1"]
    path = os.pathsep.join([str(Path(__file__).parent), *folders, *filter(None, [os.environ.get("PYTHONPATH")])])
    env = {**os.environ, "PYTHONPATH": path, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1", **environment}
    first = started("dask_scheduler", *words, "--port", "0", env=env, stderr=subprocess.PIPE, text=True)
    others = []
    try:
        address = next(match[0] for line in first.stderr if (match := re.search(r"tcp://127\.0\.0\.1:\d+", line)))
        others += [
            started("dask_worker", address, *words, "--nthreads", "1", "--no-nanny", env=env) for _ in range(workers)
        ]
        wait_for(address)
        yield address, others
    finally:
        for one in (*others, first):
            one.kill()
            one.wait()
        first.stderr.close()


def started(name, *words, stderr=subprocess.DEVNULL, **options):
    return subprocess.Popen([sys.executable, "-m", f"distributed.cli.{name}", *words], stderr=stderr, **options)


def wait_for(address):
    """Wait for the first worker."""
    for _ in range(200):
        with suppress(ArgumentError), connected(address):
            return
        time.sleep(0.1)
    raise AssertionError(address)
