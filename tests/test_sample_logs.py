"""From the sample logs to the truth of the simulation that wrote them."""

from pathlib import Path

import numpy as np
import pytest
from truth import read_truth

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.evaluation.compare import DRIVEN, LEARNT, compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import Status, fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.reward import Reward
from navirl_cli.logs.load import load_recording
from navirl_cli.simulation.log import write_log

LOGS = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))


@pytest.fixture(scope="module")
def pairs():
    """(demonstration, truth) of every trial, by log."""
    found = []
    for log in LOGS:
        extraction = extract(load_recording(log), ExtractSettings())
        assert extraction.skipped == ()
        assert extraction.damage == ()
        found.append((extraction.demonstrations, read_truth(log)))
    return found


@pytest.fixture(scope="module")
def second_cycles(pairs):
    return [d for demonstrations, _ in pairs for d in demonstrations if d.cycle == 2]


@pytest.fixture(scope="module")
def pooled(second_cycles):
    return fit(evidence_of(second_cycles), Reward.named({}))


def test_three_participants_of_at_most_6_mb():
    assert [log.name for log in LOGS] == ["p01.mcap", "p02.mcap", "p03.mcap"]
    assert sum(log.stat().st_size for log in LOGS) < 6e6


def test_exactly_the_true_trials_are_found(pairs):
    for demonstrations, truth in pairs:
        assert len(demonstrations) == len(truth.trials) == 7
        for d, true in zip(demonstrations, truth.trials, strict=True):
            assert (d.condition.value, d.cycle) == (true.condition, true.cycle)
            assert abs(d.start_ns - true.goal_t_ns) < 50e6
            end_ns = d.start_ns + d.t_s[-1] * 1e9
            assert abs(end_ns - true.t_ns[-1]) < 0.6e9
            assert d.corrected == (true.condition != "autonomous")


def test_positions_lie_within_2_cm_of_the_truth(pairs):
    for demonstrations, truth in pairs:
        for d, true in zip(demonstrations, truth.trials, strict=True):
            seconds = (true.t_ns - d.start_ns) / 1e9
            expected = np.stack([np.interp(d.t_s, seconds, axis) for axis in true.xy_m.T], axis=1)
            assert np.hypot(*(d.xy_m - expected).T).max() < 0.02, d.id


def test_contacts_hold_the_impulse_and_leave_out_the_rest(pairs):
    for demonstrations, truth in pairs:
        for d, true in zip(demonstrations, truth.trials, strict=True):
            seconds = (true.t_ns - d.start_ns) / 1e9
            size = np.hypot(*true.force_n.T)
            inside = np.zeros(len(size), dtype=bool)
            for contact in d.contacts:
                inside |= (seconds >= contact.start_s) & (seconds <= contact.end_s)
            free = size == 0
            assert (inside & free).sum() < 0.05 * free.sum(), d.id
            assert size[inside].sum() >= 0.95 * size.sum(), d.id
            if true.condition == "force":
                given = true.force_n.sum(axis=0) * 0.01
                felt = np.sum([contact.impulse_n_s for contact in d.contacts], axis=0)
                assert np.hypot(*(felt - given)) < 0.05 * size.sum() * 0.01, d.id


def test_forces_are_the_truth_without_bias_in_the_map_frame(pairs):
    for demonstrations, truth in pairs:
        for d, true in zip(demonstrations, truth.trials, strict=True):
            seconds = (true.t_ns - d.start_ns) / 1e9
            expected = np.stack([np.interp(d.t_s, seconds, axis, left=0, right=0) for axis in true.force_n.T], axis=1)
            assert np.abs(d.force_n - expected).mean() < 0.35, d.id


def test_the_fit_is_at_least_as_likely_as_any_truth(pairs, second_cycles, pooled):
    evidence = evidence_of(second_cycles)
    assert pooled.status is Status.CONVERGED
    for _, truth in pairs:
        assert pooled.log_likelihood >= log_likelihood(evidence, Reward(truth.theta))
    # Harder: one reward for all against each participant's own.
    own = sum(
        log_likelihood(evidence_of([d for d in demonstrations if d.cycle == 2]), Reward(truth.theta))
        for demonstrations, truth in pairs
    )
    assert pooled.log_likelihood >= own


def test_learnt_paths_keep_the_demonstrated_distance(second_cycles, pooled):
    result = compare(second_cycles, {"pooled": pooled.reward}, Precision(100), np.random.default_rng(0))
    rows = {row.path_type: row for row in result.groups}
    driven, learnt = rows[DRIVEN], rows[LEARNT]
    assert abs(learnt.mean["min_distance_m"] - driven.mean["min_distance_m"]) < driven.std["min_distance_m"]


def test_the_simulation_still_writes_the_sample_logs(pairs, tmp_path):
    # Not byte for byte: the last digits of a sine differ between machines.
    write_log(1, 2020, tmp_path / "p01.mcap", force=False)
    now, then = read_truth(tmp_path / "p01.mcap"), pairs[0][1]
    assert now.theta == pytest.approx(then.theta, rel=1e-9)
    for new, old in zip(now.trials, then.trials, strict=True):
        assert (new.goal_t_ns, new.condition, new.cycle) == (old.goal_t_ns, old.condition, old.cycle)
        assert new.xy_m == pytest.approx(old.xy_m, abs=0.002)
        assert new.force_n == pytest.approx(old.force_n, abs=0.1)
