"""Measure learning a reward against the paper's own algorithm, on a scene of the study's size.

python benchmarks/fit.py [--quick] [--json]. Each row ends with its bar; exit 0 only where every bar holds. The baseline
(value_iteration.py) is the paper's algorithm, written for speed in numpy. Both learn from the same demonstrations,
sampled from the policy of the published parameters. The baseline runs with log-sum-exps as in the paper, and with
exponentials of the values, which is faster and fails on larger maps. Log-likelihoods are exact and exclude the
regularisers of both fits. Everything runs on one thread. --quick runs the paper's algorithm on 2
demonstrations only, the whole benchmark on 26 too.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded; commands that run from here have it too

from rows import Row, median_seconds, report
from scenes import PUBLISHED, RESOLUTION_M, hallway
from value_iteration import ExpDomain, LogDomain, learn

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import likelihood, log_likelihood, value_and_gradient
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from factories import drawn

SEED = 3
#: Demonstrations of the study's second cycle, by all participants and by one.
ALL, FEW = 26, 2
START = Reward.named({})


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the paper's algorithm on 2 demonstrations only")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    scene = hallway()
    rows = ours(drawn(scene, PUBLISHED, ALL, SEED))
    for count in (FEW,) if options.quick else (ALL, FEW):
        rows += against_paper(scene, drawn(scene, PUBLISHED, count, SEED))
    return report(rows, as_json=options.json)


def ours(demonstrations: list[Demonstration]) -> list[Row]:
    """Rows of the times of navirl alone: derivatives, a fit, a fit from file to file."""
    evidence = evidence_of(demonstrations)
    gradient_s = median_seconds(lambda: value_and_gradient(evidence, PUBLISHED), 25)
    hessian_s = median_seconds(lambda: likelihood(evidence, PUBLISHED), 25)
    # With a new scene, as for every file of demonstrations.
    fit_s = median_seconds(lambda: fit(evidence_of(demonstrations), START), 9)
    with tempfile.TemporaryDirectory() as folder:
        demos, reward = Path(folder) / "demos.json", Path(folder) / "reward.json"
        write_json(demos, "demonstrations", demonstrations_document(demonstrations, [], {}), force=False)
        words = [str(Path(sys.executable).parent / "navirl"), "fit", str(demos), "-o", str(reward), "--force"]
        command_s = median_seconds(lambda: subprocess.run(words, check=True, capture_output=True), 5)  # noqa: S603
    count = f"{len(demonstrations)} demonstrations"
    return [
        Row.at_most("value and gradient", 1e3 * gradient_s, "ms", 15),
        Row("value, gradient and Hessian", 1e3 * hessian_s, "ms"),
        Row.at_most(f"fit of {count} in process", fit_s, "s", 0.35),
        Row.at_most(f"navirl fit of {count}", command_s, "s", 1.5),
    ]


def against_paper(scene: Scene, demonstrations: list[Demonstration]) -> list[Row]:
    """Rows of time and likelihood of the paper's algorithm and of navirl in one scene."""
    paths = [scene.lattice.states_of(one.cells) for one in demonstrations]
    evidence = evidence_of(demonstrations)
    log_s = median_seconds(lambda: learn(scene, paths, LogDomain), 1, warm_up=0)
    exp_s = median_seconds(lambda: learn(scene, paths, ExpDomain), 3)
    fit_s = median_seconds(lambda: fit(evidence, START), 9)
    theirs, learnt = learn(scene, paths, ExpDomain), fit(evidence, START).reward
    their_value, value = (log_likelihood(evidence, one) for one in (theirs.reward(RESOLUTION_M), learnt))
    count = f"{len(demonstrations)} demonstrations:"
    return [
        Row(f"{count} paper's algorithm, log-sum-exp", log_s, "s"),
        Row(f"{count} paper's algorithm, exponentials", exp_s, "s"),
        Row(f"{count} navirl", fit_s, "s"),
        Row.at_least(f"{count} time of log-sum-exp / time of navirl", log_s / fit_s, "", 200),
        Row(f"{count} time of exponentials / time of navirl", exp_s / fit_s, ""),
        Row(f"{count} log-likelihood, paper's algorithm in {theirs.steps} steps", their_value, "nats"),
        Row(f"{count} log-likelihood, navirl", value, "nats", "the paper's", value >= their_value),
    ]


if __name__ == "__main__":
    sys.exit(main())
