"""The published study from end to end: imported as logs, extracted, and held against independent results."""

import json

import numpy as np
import pytest
import study_data

from navirl_cli.artefacts.store import read_json
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.evaluation.compare import DRIVEN
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import likelihood
from navirl_cli.irl.reward import Reward
from navirl_cli.logs.load import Forces, LoadOptions, load_recording
from navirl_cli.study.measures import rows_of

PRESENT = (study_data.ROOT / "expected.json").is_file()
pytestmark = pytest.mark.skipif(not PRESENT, reason=study_data.REASON)
EXPECTED = study_data.expected() if PRESENT else {"runs": {}}
RUNS = sorted(EXPECTED["runs"])
VECTORS = {"published": "theta_published_si", "study_initial": "theta_study_initial_si"}
#: Groups by the published files' lists.
GROUPS = {
    "force_demos/passing_1": "force, cycle 1",
    "force_demos/passing_2": "force, cycle 2",
    "force_demos/replay": "replay of the learnt policy",
    "joystick_demos/passing": "joystick",
    "joystick_demos/replay": "replay of the joystick",
    "obs_avoidance_demos/replay": "obstacle avoidance",
    "force_demos/obstacle_course": "force, obstacle course",
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folders of the imported logs and of the study made from them, without its figures."""
    from click.testing import CliRunner

    from navirl_cli.cli import cli

    folder = tmp_path_factory.mktemp("study")
    logs, out = folder / "logs", folder / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("navirl_cli.figures.study.draw_study", lambda *_, **__: {})
        for words in (["import-study", study_data.ROOT, "-o", logs], ["study", logs, "-o", out]):
            result = CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)
            assert result.exit_code == 0, result.output
    return logs, out


@pytest.fixture(scope="module")
def extracted(written):
    """Extractions of the imported logs by participant."""
    logs, _ = written
    options = LoadOptions(forces=Forces.IGNORED)
    return {run: extract(load_recording(logs / f"{run}.mcap", options), ExtractSettings()) for run in RUNS}


@pytest.fixture(scope="module")
def summary(written):
    return read_json(written[1] / "summary.json", "study")


def of(extraction, name):
    """The demonstrations of one of the published lists."""
    from navirl_cli.evaluation.groups import group_of

    return [one for one in extraction.demonstrations if group_of(one) == GROUPS[name]]


def test_every_path_has_the_published_cells(extracted, summary):
    same = {f"{run}/{name}": equal for run, one in extracted.items() for name, equal in one.published.items()}
    assert len(same) == 10 * len(RUNS)
    assert set(same.values()) == {True}
    assert summary["published"]["cells_equal"] == summary["published"]["paths"] == len(same)


@pytest.mark.parametrize("run", RUNS)
def test_likelihood_and_gradient_of_what_the_logs_hold(extracted, run):
    checked = 0
    for name, results in EXPECTED["runs"][run].items():
        for vector, parameters in VECTORS.items():
            if vector in results:
                found = likelihood(evidence_of(of(extracted[run], name)), Reward.named(EXPECTED[parameters]))
                assert found.value == pytest.approx(results[vector]["log_likelihood"], rel=1e-6)
                assert found.gradient == pytest.approx(results[vector]["gradient"], rel=1e-6)
                checked += 1
    assert checked == 6


@pytest.mark.parametrize("run", RUNS)
def test_path_properties_of_what_the_logs_hold(extracted, run):
    for name, results in EXPECTED["runs"][run].items():
        rows = rows_of(of(extracted[run], name))
        metrics = results["metrics"]
        assert len(metrics) in {0, len(rows)}
        for row, expected in zip(rows, metrics, strict=False):
            assert row.values[DRIVEN]["length_m"] == pytest.approx(expected["length_m"], rel=1e-6)
            assert row.values[DRIVEN]["min_center_distance_m"] == pytest.approx(
                expected["min_center_distance_m"], rel=1e-6
            )
            assert row.values[DRIVEN]["area_m2"] == pytest.approx(expected["area_under_path_m2"], rel=1e-2)


def test_the_summary_holds_the_same_means(summary):
    for name, group in GROUPS.items():
        metrics = [one for run in RUNS for one in EXPECTED["runs"][run][name]["metrics"]]
        if not metrics:
            continue
        driven = summary["metrics"][group]["driven"]
        for ours, theirs, rel in (
            ("length_m", "length_m", 1e-6),
            ("min_center_distance_m", "min_center_distance_m", 1e-6),
            ("area_m2", "area_under_path_m2", 1e-2),
        ):
            values = np.array([one[theirs] for one in metrics])
            assert driven[ours]["mean"] == pytest.approx(values.mean(), rel=rel)
            assert driven[ours]["standard_deviation"] == pytest.approx(values.std(ddof=1), rel=10 * rel)


def test_the_log_likelihood_at_the_published_parameters(summary):
    expected = sum(EXPECTED["runs"][run]["force_demos/passing_2"]["published"]["log_likelihood"] for run in RUNS)
    published = summary["published"]
    assert published["log_likelihood_at_theta"] == pytest.approx(expected, rel=1e-6)
    assert list(published["theta"].values()) == pytest.approx(list(EXPECTED["theta_published_si"].values()), rel=1e-9)
    # The pooled fit is the maximum of just these paths.
    assert summary["pooled"]["log_likelihood"] > expected


@pytest.mark.skipif(RUNS != ["2316", "2346", "3930", "7180"], reason="the README shows four participants")
def test_the_pooled_fit_is_as_the_readme_has_it(summary):
    pooled = summary["pooled"]
    assert list(pooled["theta"].values()) == pytest.approx([-53.62, -0.9838, -4.952, 1.608], rel=1e-3)
    assert list(pooled["standard_errors"].values()) == pytest.approx([3.2, 0.31, 0.83, 0.39], rel=0.02)


def test_completion_times_are_the_published_ones(summary):
    for modality in ("force", "joystick"):
        for run in RUNS:
            text = (study_data.ROOT / "runs" / run / f"{modality}_parcours_times.txt").read_text()
            assert summary["completion_s"][modality][run] == [float(text)]


def test_verdicts_are_in_the_report(summary, written):
    verdicts = {claim["claim"]: claim["verdict"] for claim in summary["claims"]}
    assert len(verdicts) == 6
    assert verdicts["Obstacle avoidance leaves the nominal path later than people wish."] == "holds"
    text = (written[1] / "report.md").read_text()
    assert f"**{10 * len(RUNS)} of {10 * len(RUNS)} paths**" in text
    for claim, verdict in verdicts.items():
        assert f"**{verdict}**: {claim}" in text


def test_times_and_forces_are_not_invented(written, extracted):
    for run in RUNS:
        (path,) = [path for path in written[0].iterdir() if path.stem == run]
        assert load_recording(path, LoadOptions(forces=Forces.OPTIONAL)).wrench is None
        assert {one.laid_out_m_s for one in extracted[run].demonstrations} == {0.4}
        assert {one.contacts for one in extracted[run].demonstrations} == {None}
    assert json.loads((written[1] / "demos.json").read_text())["demonstrations"][0]["contacts"] is None


@pytest.mark.slow
def test_all_figures_are_drawn(written, tmp_path, navirl):
    navirl("study", written[0], "-o", tmp_path / "out")
    drawn = {path.stem for path in (tmp_path / "out" / "figures").iterdir()}
    assert {"fig2_completion_times", "fig3_paths", "fig5_replays", "fig7_properties"} <= drawn
