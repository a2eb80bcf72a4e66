"""Read small logs that are broken at random: no traceback, hang, large memory or silently shortened result is allowed.

python benchmarks/fuzz.py [--count N] [--seed S] [--keep FOLDER] [--quick] [--json]. Each row ends with its bar; the
exit code is 0 only where every bar holds. tests/verdicts.py states the allowed outcomes of a broken log. A forbidden
outcome is printed with the number from which tests/mutations.py makes the same broken log again. --keep keeps the log.
Memory is that of the process, including the test code. --quick takes 1,000 logs instead of 100,000.
"""

import argparse
import faulthandler
import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

from rows import Row, report

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from fuzzing import MOST_READ, Tally, judge_logs

from navirl_cli.parallel import cores

COUNT, QUICK, AT_ONCE = 100_000, 1000, 50
MOST_S, MOST_MB = 10.0, 500
#: A process that hangs and handles no signal prints its stack and ends after this time, s.
HANGS_S = 240.0


def main() -> int:
    """Break, read, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, help=f"number of logs; by default {COUNT}")
    parser.add_argument("--seed", type=int, default=0, help="seed of the mutations")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the logs with a forbidden outcome")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} logs")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    if options.keep is not None:
        options.keep.mkdir(parents=True, exist_ok=True)
    count = options.count or (QUICK if options.quick else COUNT)
    begun = time.perf_counter()
    tally = Tally()
    for done, part in enumerate(judge_all(count, options.seed, options.keep), start=1):
        tally.add(part)
        if sys.stderr.isatty():
            print(f"\r{min(done * AT_ONCE, count)} of {count}", end="", file=sys.stderr)
    rows = rows_of(tally, count, time.perf_counter() - begun)
    if options.json:
        print(json.dumps({"bars": [asdict(row) for row in rows], "forbidden": tally.forbidden}))
        return 0 if all(row.holds for row in rows) else 1
    for number, words in sorted(tally.forbidden.items()):
        print(f"{number}: {words}")
    print(f"slowest: {tally.slowest[1]}; reads most: {tally.most_read[1]}")
    return report(rows, as_json=False)


def judge_all(count: int, seed: int, keep: Path | None) -> Iterator[Tally]:
    """Judge logs in as many processes as there are cores, and yield the tallies of some at a time."""
    parts = [range(first, min(first + AT_ONCE, count)) for first in range(0, count, AT_ONCE)]
    with ProcessPoolExecutor(cores()) as pool:
        yield from pool.map(partial(watched, seed=seed, keep=keep), parts)


def watched(numbers: range, seed: int, keep: Path | None) -> Tally:
    """Judge logs one after the other; a process that hangs ends."""
    faulthandler.dump_traceback_later(HANGS_S, exit=True)
    tally = judge_logs(numbers, seed, keep)
    faulthandler.cancel_dump_traceback_later()
    return tally


def rows_of(tally: Tally, count: int, seconds: float) -> list[Row]:
    """The table."""
    return [
        Row("broken logs", sum(tally.outcomes.values()), "", f">= {count}", sum(tally.outcomes.values()) >= count),
        Row("broken logs per second", count / seconds, "/s"),
        *(Row(f"outcome: {outcome}", found, "") for outcome, found in tally.outcomes.most_common()),
        Row.at_most("forbidden outcomes", len(tally.forbidden), "", 0),
        Row.at_most("slowest call", tally.slowest[0], "s", MOST_S),
        Row.at_most("most bytes read by a call, for each byte of the log", tally.most_read[0], "", MOST_READ),
        Row.at_most("memory of a process, at most", tally.peak_mb, "MB", MOST_MB),
    ]


if __name__ == "__main__":
    sys.exit(main())
