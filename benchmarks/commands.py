"""Time the commands as a user waits for them: `navirl --help` and the whole demo.

python benchmarks/commands.py [--quick] [--json]. Each row ends with its bar; exit 0 only where every bar holds. The
bars are seconds, not ratios, because what they hold to is a person's patience.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parent.parent
BIN = Path(sys.executable).parent


def seconds(words: list[str], runs: int) -> float:
    """Median wall time of a command, s."""
    env = {**os.environ, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        subprocess.run(words, cwd=ROOT, env=env, check=True, capture_output=True)  # noqa: S603
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one run of each")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    runs = 1 if options.quick else 5
    rows = [
        ("navirl --help", seconds(["navirl", "--help"], runs + 2), 0.25),
        ("make demo, installed", seconds(["sh", "sample_logs/demo.sh"], runs), 30.0),
    ]
    if options.json:
        print(json.dumps([{"what": what, "seconds": taken, "bar": bar} for what, taken, bar in rows]))
    else:
        for what, taken, bar in rows:
            print(f"{what:<22} {taken:7.3f} s   bar {bar:g} s   {'holds' if taken < bar else 'MISSED'}")
    return 0 if all(taken < bar for _, taken, bar in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
