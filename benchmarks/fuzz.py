"""Break small logs in many ways and read them: never a traceback, a hang, much memory, or a silently shortened result.

python benchmarks/fuzz.py [--count N] [--seed S] [--keep FOLDER] [--quick] [--json]. Each row ends with its bar; exit 0
only where every bar holds. What may come of a broken log stands in tests/verdicts.py; what never may is printed with
the number by which tests/mutations.py breaks the same log again, and the file is kept where a folder is given. Memory
is that of a whole process, with the tests' own share. --quick takes 1,000 logs in place of 100,000.
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
from fuzzing import MOST_S, Tally, judged

from navirl_cli.parallel import cores

COUNT, QUICK, AT_ONCE = 100_000, 1000, 200
MOST_MB = 500
#: A process that hangs where no signal reaches it says where and ends, s.
HANGS_S = 120.0


def main() -> int:
    """Break, read, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, help=f"how many logs; by default {COUNT}")
    parser.add_argument("--seed", type=int, default=0, help="another seed breaks them otherwise")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep broken logs that are read as they never may")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} logs")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    if options.keep is not None:
        options.keep.mkdir(parents=True, exist_ok=True)
    count = options.count or (QUICK if options.quick else COUNT)
    begun = time.perf_counter()
    tally = Tally()
    for done, part in enumerate(judged_by_all(count, options.seed, options.keep), start=1):
        tally.add(part)
        if sys.stderr.isatty():
            print(f"\r{min(done * AT_ONCE, count)} of {count}", end="", file=sys.stderr)
    rows = rows_of(tally, count, time.perf_counter() - begun)
    if options.json:
        print(json.dumps({"bars": [asdict(row) for row in rows], "forbidden": tally.forbidden}))
        return 0 if all(row.holds for row in rows) else 1
    for number, words in sorted(tally.forbidden.items()):
        print(f"{number}: {words}")
    print(f"slowest: {tally.slowest[1]}")
    return report(rows, as_json=False)


def judged_by_all(count: int, seed: int, keep: Path | None) -> Iterator[Tally]:
    """Judge logs in as many processes as there are cores, some at once."""
    parts = [range(first, min(first + AT_ONCE, count)) for first in range(0, count, AT_ONCE)]
    with ProcessPoolExecutor(cores()) as pool:
        yield from pool.map(partial(watched, seed=seed, keep=keep), parts)


def watched(numbers: range, seed: int, keep: Path | None) -> Tally:
    """Judge logs, one by one, so that a hang has an end."""
    tally = Tally()
    for number in numbers:
        faulthandler.dump_traceback_later(HANGS_S, exit=True)
        tally.add(judged([number], seed, keep))
    faulthandler.cancel_dump_traceback_later()
    return tally


def rows_of(tally: Tally, count: int, seconds: float) -> list[Row]:
    """The table."""
    return [
        Row("broken logs", sum(tally.kinds.values()), "", f">= {count}", sum(tally.kinds.values()) >= count),
        Row("broken logs a second", count / seconds, "/s"),
        *(Row(f"outcome: {kind}", found, "") for kind, found in tally.kinds.most_common()),
        Row.at_most("what never may come out", len(tally.forbidden), "", 0),
        Row.at_most("slowest call", tally.slowest[0], "s", MOST_S),
        Row.at_most("memory of a process, at most", tally.peak_mb, "MB", MOST_MB),
    ]


if __name__ == "__main__":
    sys.exit(main())
