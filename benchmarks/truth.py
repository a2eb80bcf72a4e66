"""Compare the demonstrations extracted from the sample logs with the simulated truth.

python benchmarks/truth.py [--quick] [--json]. Each row ends with its bar; exit 0 only where every bar holds. Tests
check the same bars. This prints the figures in a few seconds. --quick changes nothing.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.logs.load import load_recording

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from truth import read_truth  # noqa: E402 the tests' own reader of the truth


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the same")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    off, held, false, missed = 0.0, 1.0, 0.0, 0
    for log in sorted((ROOT / "sample_logs").glob("*.mcap")):
        found, truth = extract(load_recording(log), ExtractSettings()).demonstrations, read_truth(log).trials
        missed += abs(len(found) - len(truth))
        for one, true in zip(found, truth, strict=False):
            seconds = (true.t_ns - one.start_ns) / 1e9
            expected = np.stack([np.interp(one.t_s, seconds, axis) for axis in true.xy_m.T], axis=1)
            off = max(off, float(np.hypot(*(one.xy_m - expected).T).max()))
            size = np.hypot(*true.force_n.T)
            inside = np.zeros(len(size), dtype=bool)
            for contact in one.contacts:
                inside |= (seconds >= contact.start_s) & (seconds <= contact.end_s)
            if size.any():
                held = min(held, float(size[inside].sum() / size.sum()))
            false = max(false, float((inside & (size == 0)).sum() / (size == 0).sum()))
    rows = [
        ("trials missed or too many", missed, "0", missed == 0),
        ("largest position error, m", off, "< 0.02", off < 0.02),
        ("smallest share of impulse in contacts", held, ">= 0.95", held >= 0.95),
        ("largest share of false contact", false, "< 0.05", false < 0.05),
    ]
    if options.json:
        print(json.dumps([{"what": what, "value": value, "bar": bar, "holds": ok} for what, value, bar, ok in rows]))
    else:
        for what, value, bar, ok in rows:
            print(f"{what:<42} {value:8.4f}   bar {bar:<8} {'holds' if ok else 'MISSED'}")
    return 0 if all(ok for *_, ok in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
