"""``navirl evaluate``: metrics, groups, pairs, ranks and formats."""

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.store import read_json
from navirl_cli.cli import cli
from navirl_cli.evaluation.metrics import METRICS

LOGS = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """Demonstrations of the sample logs and a reward learnt from their second cycles."""
    folder = tmp_path_factory.mktemp("evaluate")
    for words in (
        ["extract", *LOGS, "-o", folder / "demos.json"],
        ["fit", folder / "demos.json", "--cycle", 2, "-o", folder / "learnt.json"],
        ["fit", folder / "demos.json", "--cycle", 1, "-o", folder / "first.json"],
    ):
        assert CliRunner().invoke(cli, [str(word) for word in words]).exit_code == 0
    return folder


def test_all_metrics_are_listed_without_a_file(navirl):
    text = navirl("evaluate", "--list-metrics").stdout
    for metric in METRICS:
        needs = ", ".join(metric.needs) or "-"
        assert re.search(rf"^{metric.name} +{re.escape(metric.unit)} +{metric.paths} +{needs} ", text, re.MULTILINE)
        assert metric.definition in text


def test_all_metrics_stand_below_each_other(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--metrics", "all", "--samples", "50")
    text = navirl(*words).stdout
    document = json.loads(navirl(*words, "--json").stdout)
    group = next(one for one in document["groups"] if (one["group"], one["paths"]) == ("force, cycle 2", "driven"))
    for name, label in (("work_j", "work J"), ("jerk_m_s3", "mean jerk m/s³"), ("compliance", "space compliance")):
        told = f"{group['mean'][name]:.3f} ± {group['standard_deviation'][name]:.3f}"
        assert re.search(rf"^{re.escape(label)} +{re.escape(told)}", text, re.MULTILINE)
    assert "force, cycle 2, n = 6" in text
    learnt = next(one for one in document["groups"] if (one["group"], one["paths"]) == ("force, cycle 2", "learnt"))
    assert {"exact", "error"} < set(learnt)
    assert learnt["mean"]["hausdorff_m"] >= learnt["mean"]["dissimilarity_m"] > 0


def test_chosen_metrics_in_their_order(navirl, work):
    text = navirl("evaluate", work / "demos.json", "--metrics", "jerk_m_s3,length_m").stdout
    assert text.splitlines()[0].split("  ")[-2:] == ["mean jerk m/s³", "path length m"]
    refused = navirl("evaluate", work / "demos.json", "--metrics", "length_m,speed", code=2).stderr
    assert "unknown metric 'speed'; navirl evaluate --list-metrics lists them" in " ".join(refused.split())


def test_pairs_are_compared_by_participant(navirl, work):
    words = ("evaluate", work / "demos.json", "--pair", "joystick", "force, cycle 2")
    document = json.loads(navirl(*words, "--json").stdout)
    (pair,) = document["pairs"]
    rows = {one["id"]: one["metrics"]["length_m"] for one in document["demonstrations"]}
    means = {}
    for one in read_demonstrations(work / "demos.json"):
        key = "joystick" if one.condition == "joystick" else f"cycle {one.cycle}"
        means.setdefault((one.participant, key), []).append(rows[one.id])
    expected = {p: np.mean(means[p, "joystick"]) - np.mean(means[p, "cycle 2"]) for p in ("p01", "p02", "p03")}
    found = pair["metrics"]["length_m"]
    assert found["by_participant"] == pytest.approx(expected)
    assert (found["n"], found["lower"]) == (3, None)
    assert found["p_value"] == pytest.approx(stats.wilcoxon(list(expected.values())).pvalue)
    text = navirl(*words).stdout
    assert "joystick less force, cycle 2, driven paths, paired by participant" in text
    assert re.search(
        rf"^path length m +{found['mean_difference']:+.3f} +- +3 +{found['p_value']:.3g} ", text, re.MULTILINE
    )
    refused = navirl("evaluate", work / "demos.json", "--pair", "joystick", "force", code=1).stderr
    assert "expected the names of two groups, found 'force'; there are 'force, cycle 1', 'force, cycle 2'" in refused


def test_groups_by_participant(navirl, work):
    document = json.loads(navirl("evaluate", work / "demos.json", "--by", "participant", "--json").stdout)
    assert {one["group"] for one in document["groups"]} == {"p01", "p02", "p03"}
    assert {one["count"] for one in document["groups"]} == {7}


def test_ranks_are_told_with_their_test(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--ranks", "--samples", "200")
    document = json.loads(navirl(*words, "-o", "m.json", "--json").stdout)
    ranks = document["ranks"]
    assert read_json(Path("m.json"), "metrics")["ranks"] == ranks
    assert len(ranks["demonstrations"]) == 21
    found = stats.kstest([one["rank"] for one in ranks["demonstrations"]], "uniform")
    assert (ranks["statistic"], ranks["p_value"]) == pytest.approx((found.statistic, found.pvalue))
    assert "ranks of 21 demonstrations among the policy's paths" in navirl(*words).stdout
    assert "--ranks needs one --reward" in navirl("evaluate", work / "demos.json", "--ranks", code=2).stderr


def test_two_rewards_stand_side_by_side(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--reward", work / "first.json")
    document = json.loads(navirl(*words, "--samples", "20", "--json").stdout)
    assert {one["paths"] for one in document["groups"]} >= {"learnt, learnt", "learnt, first"}
    again = navirl(*words[:2], *words[2:4], *words[2:4], code=1).stderr
    assert "another --reward is called 'learnt' too; rename one of the files" in again


def test_a_precision_is_kept(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--precision", "0.02")
    document = json.loads(navirl(*words, "--samples", "50", "--json").stdout)
    for one in document["groups"]:
        if one["paths"] == "learnt":
            for name, error in one["error"].items():
                assert error <= 0.025 * max(abs(one["mean"][name]), one["standard_deviation"][name])


def test_formats_hold_the_same_numbers(navirl, work):
    words = ("evaluate", work / "demos.json")
    rows = list(csv.DictReader(io.StringIO(navirl(*words, "--format", "csv").stdout)))
    cell = f"{float(rows[0]['length_m_mean']):.3f} ± {float(rows[0]['length_m_std']):.3f}"
    assert cell in navirl(*words).stdout
    assert f"| {cell}" in navirl(*words, "--format", "markdown").stdout
    latex = navirl(*words, "--format", "latex", "-o", "table.tex").stdout
    assert cell.replace("±", r"$\pm$") in latex
    assert Path("table.tex").read_text() == latex
    assert "area under path m$^2$" in latex
