"""What `make demo` says at its end follows from the files that it wrote."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
OLD = Path(__file__).parent / "version1"


def summary_of(folder):
    words = [sys.executable, str(ROOT / "sample_logs" / "demo_summary.py"), folder.name]
    return subprocess.run(words, cwd=folder.parent, capture_output=True, text=True, check=True).stdout


def test_the_summary_holds_the_numbers_of_the_run(navirl, tmp_path):
    demo = tmp_path / "demo"
    demo.mkdir()
    logs = [str(ROOT / "sample_logs" / f"p0{number}.mcap") for number in (1, 2)]
    navirl("extract", *logs, "-o", "demo/demos.json")
    chosen = ("--condition", "force", "--cycle", "2", "--cross-validate", "participant")
    navirl("fit", "demo/demos.json", *chosen, "-o", "demo/reward.json")
    navirl("evaluate", "demo/demos.json", "--reward", "demo/reward.json", "--samples", "20", "-o", "demo/metrics.json")
    (demo / "study").mkdir()
    shutil.copy(OLD / "study.json", demo / "study" / "summary.json")
    text = summary_of(demo)
    assert "1. extract found 14 trials in 2 logs; in 8 of them" in text
    reward = json.loads((demo / "reward.json").read_text())
    assert f"costs {-reward['parameters'][2]['value']:.1f}," in text
    assert f"{reward['cross_validation']['models']['learnt']['log_likelihood_per_step']:.3f} nats per step" in text
    assert "5. study tested 2 claims of the paper with 2 participants: 0 supported, 2 not settled." in text
    assert text.endswith("\nLook first at demo/policy.png, then open demo/study/report.html.\n")


def test_the_demo_ends_with_it():
    assert (ROOT / "sample_logs" / "demo.sh").read_text().endswith("\npython3 sample_logs/demo_summary.py demo\n")
