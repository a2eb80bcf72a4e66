"""``navirl evaluate``: metrics, groups, pairs, ranks and formats."""

import csv
import io
import json
import re
import subprocess
import sys
from pathlib import Path

import factories as make
import numpy as np
import pytest
from click.testing import CliRunner
from scipy import stats

from navirl_cli.artefacts.demonstrations import demonstrations_document, read_demonstrations
from navirl_cli.artefacts.metrics import read_metrics
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.cli import cli
from navirl_cli.evaluation.metrics import METRICS

LOGS = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """Demonstrations of the sample logs and a reward learnt from their second cycles."""
    folder = tmp_path_factory.mktemp("evaluate")
    for words in (
        ["extract", *LOGS, "-o", folder / "demos.json"],
        ["fit", folder / "demos.json", "--cycle", 2, "--intervals", "wald", "-o", folder / "learnt.json"],
        ["fit", folder / "demos.json", "--cycle", 1, "--intervals", "wald", "-o", folder / "first.json"],
    ):
        assert CliRunner().invoke(cli, [str(word) for word in words]).exit_code == 0
    return folder


def test_all_metrics_are_listed_without_a_file(navirl):
    text = navirl("evaluate", "--list-metrics").stdout
    for metric in METRICS:
        needs = ", ".join(metric.needs) or "-"
        assert re.search(rf"^{metric.name} +{re.escape(metric.unit)} +{metric.paths} +{needs} ", text, re.MULTILINE)
        assert metric.definition in text
    shown = json.loads(navirl("evaluate", "--list-metrics", "--json").stdout)
    assert [one["name"] for one in shown["metrics"]] == [metric.name for metric in METRICS]
    assert navirl("evaluate", "--list-metrics", "--format", "markdown").stdout.startswith("| name ")


def test_all_metrics_stand_below_each_other(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--metrics", "all", "--samples", "50")
    text = navirl(*words).stdout
    document = json.loads(navirl(*words, "--json").stdout)
    group = next(one for one in document["groups"] if (one["group"], one["path_type"]) == ("force, cycle 2", "driven"))
    for name, label in (("work_j", "work J"), ("jerk_m_s3", "mean jerk m/s³"), ("compliance", "space compliance")):
        cell = f"{group['mean'][name]:.3f} ± {group['standard_deviation'][name]:.3f}"
        assert re.search(rf"^{re.escape(label)} +{re.escape(cell)}", text, re.MULTILINE)
    assert "force, cycle 2, n = 6" in text
    learnt = next(one for one in document["groups"] if (one["group"], one["path_type"]) == ("force, cycle 2", "learnt"))
    assert {"exact", "monte_carlo_error"} < set(learnt)
    assert learnt["mean"]["hausdorff_m"] >= learnt["mean"]["dissimilarity_m"] > 0


def test_chosen_metrics_in_their_order(navirl, work):
    text = navirl("evaluate", work / "demos.json", "--metrics", "area_m2,length_m").stdout
    assert re.split(" {2,}", text.splitlines()[0])[-2:] == ["area under path m²", "path length m"]
    refused = navirl("evaluate", work / "demos.json", "--metrics", "length_m,speed", code=2).stderr
    assert "found 'speed'; did you mean 'speed_m_s'" in " ".join(refused.split())


def test_metrics_of_driven_paths_have_a_table_of_their_own(navirl, work):
    words = ("evaluate", work / "demos.json", "--metrics", "jerk_m_s3,length_m")
    first, second = navirl(*words).stdout.split("\n\n")[:2]
    assert "nominal" in first
    assert re.split(" {2,}", second.splitlines()[0])[-1] == "mean jerk m/s³"
    assert {re.split(" {2,}", line)[1] for line in second.splitlines()[1:]} == {"driven"}
    assert " -" not in second, "no value is shown as missing where the type of path has none"


def test_missing_values_have_reasons_in_every_format(navirl, tmp_path):
    grid = make.open_grid(40, 21)
    cells = [[column, 10] for column in range(1, 39)]
    trials = [
        make.demonstration(grid, cells, [[2.0, 0.5]], number=1),
        make.demonstration(grid, cells, number=2, laid_out_m_s=0.4),
    ]
    document = demonstrations_document(trials, [], {})
    write_json(tmp_path / "demos.json", "demonstrations", document, force=False)
    words = ("evaluate", tmp_path / "demos.json", "--metrics", "min_distance_m,duration_s,hausdorff_m")
    content = json.loads(navirl(*words, "-o", tmp_path / "m.json", "--json").stdout)
    assert read_metrics(tmp_path / "m.json")["groups"] == content["groups"]
    driven = next(one for one in content["groups"] if one["path_type"] == "driven")
    assert driven["missing"] == {
        "min_distance_m": {"no people in the scene": 1}, "duration_s": {"times not measured": 1}
    }  # fmt: skip
    assert content["demonstrations"][1]["missing"] == {
        "min_distance_m": "no people in the scene", "duration_s": "times not measured"
    }  # fmt: skip
    assert content["missing"] == {"hausdorff_m": "no learnt reward given"}
    for style in ("text", "markdown", "latex"):
        text = navirl(*words, "--format", style).stdout
        assert "Missing: min. distance (no people in the scene) in force: 1 of 2." in text
        assert "Missing: duration (times not measured) in force: 1 of 2." in text
        assert "Left out: mod. Hausdorff: no learnt reward given." in text
    rows = list(csv.DictReader(io.StringIO(navirl(*words, "--format", "csv").stdout)))
    assert rows[0]["missing"] == "min_distance_m: no people in the scene (1); duration_s: times not measured (1)"
    assert (rows[0]["duration_s_std"], rows[0]["hausdorff_m_mean"]) == ("", "")


def test_without_a_pair_no_statistics_are_imported(work):
    program = (
        "import sys; from navirl_cli.cli import cli; cli(sys.argv[1:], standalone_mode=False); "
        "sys.exit(', '.join(name for name in ('scipy.stats', 'scipy.signal') if name in sys.modules) or None)"
    )
    words = [
        sys.executable,
        "-c",
        program,
        "evaluate",
        str(work / "demos.json"),
        "--reward",
        str(work / "learnt.json"),
        "--all",
    ]
    found = subprocess.run([*words, "--metrics", "all", "--samples", "2"], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")


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
    values = np.array(list(expected.values()))
    low, high = found["student_lower"], found["student_upper"]
    assert (low, high) == pytest.approx(stats.t.interval(0.95, 2, values.mean(), stats.sem(values)))
    assert (found["n"], found["bootstrap_lower"]) == (3, None)
    assert found["wilcoxon_p"] == pytest.approx(stats.wilcoxon(values).pvalue)
    text = navirl(*words).stdout
    assert "joystick - force, cycle 2, driven paths, paired by participant" in text
    cells = [f"{found['mean_difference']:+.3f}", f"{low:+.3f} to {high:+.3f}", "-", "3", f"{found['wilcoxon_p']:.4f}"]
    table = text[text.index("joystick - force, cycle 2") :].splitlines()
    assert re.split(" {2,}", next(line for line in table if line.startswith("path length m")))[1:6] == cells
    assert "A bootstrap interval needs 4 participants, Student's interval 2." in text
    refused = navirl("evaluate", work / "demos.json", "--pair", "joystick", "force", code=1).stderr
    assert "--pair: expected one of 'force, cycle 1', 'force, cycle 2'" in refused


def test_groups_by_participant(navirl, work):
    document = json.loads(navirl("evaluate", work / "demos.json", "--by", "participant", "--json").stdout)
    assert {one["group"] for one in document["groups"]} == {"p01", "p02", "p03"}
    assert {one["count"] for one in document["groups"]} == {7}


def test_ranks_are_printed_with_their_test(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--ranks", "--samples", "200", "--all")
    document = json.loads(navirl(*words, "-o", "m.json", "--json").stdout)
    ranks = document["ranks"]
    assert read_json(Path("m.json"), "metrics")["ranks"] == ranks
    groups = {one["group"]: one for one in ranks["groups"]}
    for name, own in groups.items():
        shares = [one["rank"] for one in ranks["demonstrations"] if one["group"] == name]
        found = stats.kstest(shares, "uniform")
        assert (own["statistic"], own["p_value"]) == pytest.approx((found.statistic, found.pvalue))
        assert own["count"] == len(shares)
        assert own["held_out"] is False
    learnt = set(read_json(work / "learnt.json", "reward")["groups"])
    assert set(groups) == learnt, "conditions that were not learnt from are not ranked"
    assert sum(ranks["not_ranked"].values()) + len(ranks["demonstrations"]) == 21
    text = navirl(*words).stdout
    assert "Ranks of demonstrations among the policy's paths, by group" in text
    for name, count in ranks["not_ranked"].items():
        assert (
            f"{name} ({count})"
            in text[text.index("Not ranked, because the reward was not learnt from such trials: ") :]
        )
    assert "--ranks needs one --reward" in navirl("evaluate", work / "demos.json", "--ranks", code=2).stderr


def test_two_rewards_stand_side_by_side(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--reward", work / "first.json")
    document = json.loads(navirl(*words, "--samples", "20", "--json").stdout)
    assert {one["path_type"] for one in document["groups"]} >= {"learnt, learnt", "learnt, first"}


def test_a_precision_is_kept(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--precision", "0.02")
    document = json.loads(navirl(*words, "--samples", "50", "--json").stdout)
    for one in document["groups"]:
        if one["path_type"] == "learnt":
            for name in ("min_distance_m", "area_m2"):
                error = one["monte_carlo_error"][name]
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


def test_files_stand_in_one_table_and_their_groups_are_compared(navirl, work):
    for name, number in (("a", 1), ("b", 2)):
        navirl("select", work / "demos.json", "--condition", "force", "--cycle", number, "-o", f"{name}.json")
    for name, cycle in (("a", None), ("b", None)):  # the same group in both
        content = json.loads(Path(f"{name}.json").read_text())
        content["demonstrations"] = [{**one, "cycle": cycle} for one in content["demonstrations"]]
        Path(f"{name}.json").write_text(json.dumps(content))
    words = ("evaluate", "a.json", "b.json", "--metrics", "length_m,area_m2", "--quantiles", "0.25,0.5")
    document = json.loads(navirl(*words, "--json", "-o", "m.json", "--per-trial", "t.csv").stdout)
    assert read_json(Path("m.json"), "metrics")["pairs"] == document["pairs"]
    assert {one["group"] for one in document["groups"]} == {"a: force", "b: force"}
    (pair,) = document["pairs"]
    assert (pair["group"], pair["minus"]) == ("b: force", "a: force")
    for one in pair["metrics"].values():
        assert one["n"] == 3
        assert one["wilcoxon_p"] <= one["holm_p"] <= 1
    rows = list(csv.DictReader(io.StringIO(Path("t.csv").read_text())))
    driven = [row for row in rows if row["path_type"] == "driven" and row["metric"] == "length_m"]
    assert len(driven) == len(document["demonstrations"])
    own = [float(row["value"]) for row in driven if row["file"] == "a"]
    by_group = {(one["group"], one["path_type"]): one for one in document["groups"]}
    assert np.mean(own) == pytest.approx(by_group["a: force", "driven"]["mean"]["length_m"])
    quantiles = {(one["group"], one["path_type"], one["share"]): one["metrics"] for one in document["quantiles"]}
    for share in (0.25, 0.5):
        assert quantiles["a: force", "driven", share]["length_m"] == pytest.approx(np.quantile(own, share))
    text = navirl(*words).stdout
    assert "b: force - a: force, driven paths, paired by participant" in text
    assert "p (Holm) is corrected for all tests of these tables." in text
    assert "one twice" in navirl("evaluate", "a.json", "a.json", code=2).stderr
    words = ("evaluate", "a.json", "b.json", "--reward", work / "learnt.json", "--ranks")
    assert "--ranks needs one file of demonstrations" in navirl(*words, code=2).stderr
    assert "expected numbers from 0 to 1" in navirl("evaluate", "a.json", "--quantiles", "2", code=2).stderr


def test_a_parquet_table_has_the_types_and_values_of_the_csv_whatever_it_holds(navirl, work):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    for cycle in ("1", "2"):
        words = ("evaluate", work / "demos.json", "--cycle", cycle, "--metrics", "length_m,onset_m")
        navirl(*words, "--per-trial", f"{cycle}.parquet")
        navirl(*words, "--per-trial", f"{cycle}.csv")
    navirl("evaluate", work / "demos.json", "--condition", "joystick", "--per-trial", "j.parquet")
    tables = [parquet.read_table(f"{name}.parquet") for name in "12j"]
    assert len({str(one.schema) for one in tables}) == 1, "a column without values keeps its type"
    types = {field.name: str(field.type) for field in tables[0].schema}
    assert (types.pop("cycle"), types.pop("value")) == ("int64", "double")
    assert set(types.values()) == {"string"}
    assert tables[2].column("cycle").null_count == len(tables[2]), "joystick trials have no cycle"
    for name, table in zip("12", tables, strict=False):
        rows = list(csv.DictReader(io.StringIO(Path(f"{name}.csv").read_text())))
        assert [
            {k: "" if v is None else v for k, v in one.items() if k not in {"cycle", "value"}}
            for one in table.to_pylist()
        ] == [{k: v for k, v in one.items() if k not in {"cycle", "value"}} for one in rows]
        assert table.column("cycle").to_pylist() == [int(one["cycle"]) for one in rows]
        assert table.column("value").to_pylist() == [float(one["value"]) if one["value"] else None for one in rows]
    missing = [one for one in tables[0].to_pylist() if one["value"] is None]
    assert missing
    assert all(one["missing"] for one in missing)


def test_a_parquet_table_needs_pyarrow_and_says_so_before_the_work(navirl, work, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = navirl("evaluate", work / "demos.json", "--per-trial", "t.parquet", code=1)
    assert done.stdout == ""
    assert done.stderr == (
        "navirl: t.parquet: .parquet needs pyarrow, which is not installed; install it with: pip install "
        "'navirl[parquet]', or write .csv\n"
    )
    assert not list(Path().iterdir())


def test_learnt_paths_of_rewards_are_compared_in_each_group(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "learnt.json", "--reward", work / "first.json")
    words = (*words, "--cycle", "2", "--samples", "30", "--metrics", "length_m")
    document = json.loads(navirl(*words, "--json", "--per-trial", "t.csv").stdout)
    (pair,) = document["pairs"]
    assert (pair["group"], pair["minus"]) == ("force, cycle 2: learnt, first", "learnt, learnt")
    rows = list(csv.DictReader(io.StringIO(Path("t.csv").read_text())))
    means = {
        name: {
            person: np.mean([float(r["value"]) for r in rows if (r["path_type"], r["participant"]) == (name, person)])
            for person in ("p01", "p02", "p03")
        }
        for name in ("learnt, learnt", "learnt, first")
    }
    found = pair["metrics"]["length_m"]
    for person, value in found["by_participant"].items():
        assert value == pytest.approx(means["learnt, first"][person] - means["learnt, learnt"][person])
    assert "holm_p" not in found, "one test needs no correction"
