"""``navirl study`` on the sample logs: what is written, and that all of it agrees."""

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner
from robot_log import Run, write_run

from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.store import read_json
from navirl_cli.artefacts.study import read_study
from navirl_cli.cli import cli
from navirl_cli.evaluation.compare import DRIVEN, compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward
from navirl_cli.reports.study import FIGURES

LOGS = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))
ANSWERS = "participant,question,modality,answer\n" + "".join(
    f"p{k:02d},The robot was easy to guide,{modality},{1 + (k + shift) % 5}\n"
    for k in range(1, 7)
    for shift, modality in enumerate(("force", "joystick"))
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a study, and what the command printed."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "answers.csv").write_text(ANSWERS)
    out = folder / "out"
    words = ["study", *LOGS, "-o", out, "--samples", 200, "--questionnaire", folder / "answers.csv"]
    result = CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return out, result


@pytest.fixture(scope="module")
def summary(written):
    return read_study(written[0] / "summary.json")


@pytest.fixture(scope="module")
def demos(written):
    return read_demonstrations(written[0] / "demos.json")


def test_all_is_written_and_no_more(written):
    out, _ = written
    figures = {name for name in FIGURES if name != "fig2_completion_times"}  # the sample logs hold no obstacle course
    expected = {"report.md", "report.html", "summary.json", "demos.json", "figures"}
    expected |= {f"figures/{name}.{extension}" for name in figures for extension in ("png", "pdf")}
    assert {str(path.relative_to(out)) for path in out.rglob("*")} == expected


def test_the_page_has_every_figure_for_dark_and_for_narrow_screens(written):
    page = (written[0] / "report.html").read_text()
    pictures = re.findall(r"<picture>.*?</picture>", page, re.DOTALL)
    assert len(pictures) == len(FIGURES) - 1  # the sample logs hold no obstacle course
    narrow, dark = "(max-width: 599px)", "(prefers-color-scheme: dark)"
    for one in pictures:
        assert re.findall(r'media="([^"]*)"', one) == [
            f"screen and {narrow} and {dark}",
            f"screen and {narrow}",
            f"screen and {dark}",
        ]
        assert len(set(re.findall(r"base64,[^\"]*", one))) == 4


def test_participants_are_fitted_cycle_by_cycle(summary, demos):
    for name in ("p01", "p02", "p03"):
        own = [one for one in demos if one.participant == name]
        first = fit(evidence_of([one for one in own if one.cycle == 1]), Reward.named({}))
        second = fit(evidence_of([one for one in own if one.cycle == 2]), first.reward)
        found = summary["participants"][name]
        for fitted, learnt in ((first, found["first_cycle"]), (second, found)):
            assert list(learnt["theta"].values()) == pytest.approx(fitted.reward.theta, rel=1e-4)
            assert list(learnt["standard_errors"].values()) == pytest.approx(fitted.standard_errors, rel=1e-2)
            assert learnt["log_likelihood"] == pytest.approx(fitted.log_likelihood, abs=1e-4)
            assert learnt["status"] in {fitted.status.value, "open interval"}


def test_the_pooled_fit_is_that_of_all_second_cycles(summary, demos):
    fitted = fit(evidence_of([one for one in demos if one.cycle == 2]), Reward.named({}))
    assert summary["pooled"]["theta"]["a_p"] == pytest.approx(fitted.reward.theta[2], rel=1e-4)
    assert summary["pooled"]["log_likelihood"] == pytest.approx(fitted.log_likelihood, abs=1e-4)
    assert summary["pooled"]["first_cycle"]["theta"] is None
    assert summary["pooled"]["demonstrations"] == 6


def test_metrics_by_condition_are_those_of_evaluate(summary, demos):
    rows = {row.group: row for row in compare(demos, {}, Precision(), None).groups if row.path_type == DRIVEN}
    assert set(summary["metrics"]) == set(rows) == {"force, cycle 1", "force, cycle 2", "joystick", "autonomous"}
    for group, row in rows.items():
        driven = summary["metrics"][group]["driven"]
        for name in ("length_m", "min_distance_m", "area_m2"):
            # demos.json rounds positions to a micrometre
            assert driven[name]["mean"] == pytest.approx(row.mean[name], rel=1e-4)
            assert driven[name]["standard_deviation"] == pytest.approx(row.std[name], rel=1e-3, abs=1e-6)
        assert driven["min_center_distance_m"]["mean"] == pytest.approx(row.mean["min_distance_m"] + 0.3, rel=1e-4)


def cells_of(text, first):
    """The cells of the first table's row by its first cell."""
    row = re.findall(rf"^\| {re.escape(first)} +\|(.*)\|$", text, re.MULTILINE)[0]
    return [cell.strip() for cell in row.split("|")]


def test_the_report_holds_the_summarys_numbers(written, summary):
    out, result = written
    page, text = (out / "report.html").read_text(), (out / "report.md").read_text()
    learnt = text[text.index("## Learnt rewards") :]
    learnt = learnt[: learnt.index("## Learnt policies")]
    for name in ("p01", "p02", "p03"):
        found = summary["participants"][name]
        cells = cells_of(learnt, f"{name}, cycle 2")
        numbers = [[float(number) for number in cell.split(" ± ")] for cell in cells[1:5]]
        for shown, (parameter, value) in zip(numbers, found["theta"].items(), strict=True):
            expected = [one for one in (value, found["standard_errors"][parameter]) if one is not None]
            assert shown == pytest.approx(expected, abs=0.01)
        assert cells[5] == f"{found['log_likelihood']:.3f}"
        assert cells[1].replace("-", "\N{MINUS SIGN}") in page
        assert cells[1] in result.stdout
    for group, row in summary["metrics"].items():
        area = row["driven"]["area_m2"]
        shown = cells_of(text[text.index("## Path properties") :].split("\n\n- ")[0], group)
        assert shown[4] == f"{area['mean']:.3f} ± {area['standard_deviation']:.3f}"
    assert len(summary["claims"]) == 5
    for claim in summary["claims"]:
        assert claim["claim"] in text
        assert f"{claim['verdict']}: {claim['claim']}" in result.stdout


def test_the_report_shows_every_figure(written):
    out, _ = written
    linked = re.findall(r"!\[.*?\]\((.*?)\)", (out / "report.md").read_text())
    assert sorted(linked) == sorted(f"figures/{path.name}" for path in (out / "figures").glob("*.png"))
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 4 * len(linked)  # dark, narrow, and both
    assert "://" not in re.sub(r"data:image/png;base64,[^\"]+", "", page)


@pytest.mark.slow
def test_without_a_terminal_each_fit_has_a_line(written):
    lines = [line for line in written[1].stderr.splitlines() if line.startswith("navirl: fit ")]
    assert lines[0].startswith("navirl: fit 1 of ")
    assert lines[-1].endswith(f"{len(lines)} of {len(lines)}: all")


@pytest.mark.slow
def test_the_same_seed_writes_the_same_bytes(written, tmp_path):
    out, _ = written
    words = [
        "study",
        *LOGS,
        "-o",
        tmp_path / "out",
        "--samples",
        200,
        "--questionnaire",
        out.parent / "answers.csv",
        "--json",
    ]
    result = CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)
    for path in out.rglob("*"):
        if path.is_file():
            assert (tmp_path / "out" / path.relative_to(out)).read_bytes() == path.read_bytes(), path
    printed, summary = json.loads(result.stdout), json.loads((out / "summary.json").read_text())
    assert printed == {key: value for key, value in summary.items() if key not in {"format", "version", "navirl"}}


@pytest.mark.slow
def test_demonstrations_can_stand_in_for_logs(navirl, written, summary, tmp_path):
    out, _ = written
    result = navirl("study", out / "demos.json", "-o", "again", "--samples", 50)
    again = read_json(tmp_path / "again" / "summary.json", "study")
    for name in ("p01", "p02", "p03"):
        assert again["participants"][name]["theta"] == pytest.approx(
            summary["participants"][name]["theta"], rel=1e-4
        )  # rounded to a micrometre
    assert again["published"] is None
    assert "cells as published" not in result.stdout


def test_answers_stand_in_numbers_too(written, summary):
    text = (written[0] / "report.md").read_text()
    assert len(summary["answers"]) == 2
    for one in summary["answers"]:
        assert (one["n"], sum(one["counts"])) == (6, 6)
        assert re.search(rf"\| {one['modality']} +\| +6 +\| +{one['median']:.1f} ", text)
    assert "participants without a log: p04, p05, p06" in written[1].stderr


def test_existing_files_are_kept_without_force(navirl, written):
    out, _ = written
    result = navirl("study", *LOGS, "-o", out, code=1)
    assert "exists already; choose another name, or replace it with --force" in result.stderr


def test_logs_without_cycles_are_refused(navirl, tmp_path):
    log = write_run(tmp_path / "run.mcap", Run(wrench_topics=()))
    result = navirl("study", log, "-o", "out", code=1)
    assert (
        "navirl: a study needs trials of the condition force in cycle 2 and without a set, found no trial of"
        in result.stderr
    )
    assert not (tmp_path / "out" / "summary.json").exists()


def test_a_bad_questionnaire_is_refused_before_the_work(navirl, tmp_path):
    (tmp_path / "answers.csv").write_text("who,what\nann,yes\n")
    result = navirl("study", *LOGS, "-o", "out", "--questionnaire", "answers.csv", code=1)
    assert "answers.csv" in result.stderr
    assert not (tmp_path / "out").exists()


def test_levels_without_answers_are_refused(navirl):
    stderr = navirl("study", *LOGS, "-o", "out", "--levels", 7, code=2).stderr
    assert "--levels goes with --questionnaire." in stderr
