"""The published study: likelihoods, paths and cells against independent results, where the data are at hand."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest
import study_data
from path_values import line_values
from scipy.optimize import minimize

from navirl_cli.demos.rasterize import rasterize
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import likelihood, log_likelihood, value_and_gradient
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.irl.status import Status

PRESENT = (study_data.ROOT / "expected.json").is_file()
needs_study = pytest.mark.skipif(not PRESENT, reason=study_data.REASON)
EXPECTED = study_data.expected() if PRESENT else {"runs": {}}
RUNS = sorted(EXPECTED["runs"])
CASES = [(run, name) for run in RUNS for name in sorted(EXPECTED["runs"][run])]
VECTORS = {"published": "theta_published_si", "study_initial": "theta_study_initial_si"}


@pytest.fixture(scope="module")
def study():
    return {run: study_data.published(run) for run in RUNS}


def evidence(published):
    return evidence_of(
        [make.demonstration(one.grid, one.cells, one.people_m, number=i) for i, one in enumerate(published)]
    )


@needs_study
@pytest.mark.parametrize("run", RUNS)
def test_likelihood_and_gradient(study, run):
    checked = 0
    for name, results in EXPECTED["runs"][run].items():
        for vector, parameters in VECTORS.items():
            if vector not in results:
                continue
            demonstrated = evidence(study[run][name])
            assert demonstrated.count == results[vector]["demonstrations"]
            found = likelihood(demonstrated, Reward.named(EXPECTED[parameters]))
            assert found.value == pytest.approx(results[vector]["log_likelihood"], rel=1e-6)
            assert found.gradient == pytest.approx(results[vector]["gradient"], rel=1e-6)
            checked += 1
    assert checked == 6


@needs_study
@pytest.mark.parametrize(("run", "name"), CASES)
def test_path_properties(study, run, name):
    metrics = EXPECTED["runs"][run][name]["metrics"]
    for one, result in zip(study[run][name], metrics, strict=False):
        first, last = one.xy_m[0, 0], one.xy_m[-1, 0]
        found = line_values(one.xy_m, np.array([[first, 0.05], [last, 0.05]]), one.people_m, 0.0)
        assert found["length_m"] == pytest.approx(result["length_m"], rel=1e-6)
        assert found["min_distance_m"] == pytest.approx(result["min_center_distance_m"], rel=1e-6)
        assert found["area_m2"] == pytest.approx(result["area_under_path_m2"], rel=1e-2)
    assert len(metrics) == (0 if name.endswith("obstacle_course") else len(study[run][name]))


@needs_study
@pytest.mark.parametrize("run", RUNS)
def test_poses_become_the_published_cells(study, run):
    for name, published in study[run].items():
        for one in published:
            assert rasterize(one.xy_m, one.grid).tolist() == one.cells.tolist(), name


@needs_study
def test_a_fit_climbs_past_the_bound_at_which_plain_newton_sticks(study):
    # From the study's start run 3930 sticks at a_g = 0, about 20 nats below the optimum.
    demonstrated = evidence(study["3930"]["force_demos/passing_1"] + study["3930"]["force_demos/passing_2"])
    start = Reward.named(EXPECTED["theta_study_initial_si"])
    found = fit(demonstrated, start)
    stuck = fit(demonstrated, replace(start, theta=(start.theta[0], 0.0, *start.theta[2:])))
    assert found.reward.theta[1] < -0.05
    assert stuck.log_likelihood == pytest.approx(found.log_likelihood, abs=1e-3)
    assert found.log_likelihood > log_likelihood(demonstrated, Reward.named(EXPECTED["theta_published_si"]))


def climbed(demonstrated, l2, starts, seed):
    """Objectives that L-BFGS-B reaches from random starts, the highest first."""
    scale = np.array([10.0, 1.0, 1.0, 1.0])
    bounds = [(parameter.lower, parameter.upper) for parameter in Reward.named({}).parameters]
    lower, upper = np.transpose(bounds)

    def downhill(x):
        theta = np.clip(x * scale, lower, upper)
        try:
            value, gradient = value_and_gradient(demonstrated, Reward(tuple(theta.tolist())))
        except InfinitePartitionError:
            return 1e4, np.zeros(4)
        return l2 / 2 * float(x @ x) - value, l2 * x - gradient * scale

    rng = np.random.default_rng(seed)
    reached = []
    for _ in range(starts):
        start = [rng.uniform(-10, -2.5), rng.uniform(-5, 0), rng.uniform(-20, 2), 10 ** rng.uniform(-1, 1)]
        options = {"maxiter": 500, "ftol": 1e-13, "gtol": 1e-7}
        in_units = list(zip(lower / scale, upper / scale, strict=True))
        reached.append(-minimize(downhill, start, jac=True, method="L-BFGS-B", bounds=in_units, options=options).fun)
    return sorted(reached, reverse=True)


SECOND, BOTH = ("force_demos/passing_2",), ("force_demos/passing_1", "force_demos/passing_2")


def check_best(study, names, l2, starts):
    demonstrated = evidence([one for name in names for one in study["3930"][name]])
    found = fit(demonstrated, Reward.named(EXPECTED["theta_study_initial_si"]), l2)
    assert found.status is Status.CONVERGED
    reached = climbed(demonstrated, l2, starts, seed=0)
    assert found.objective > reached[0] - 1e-4
    assert found.objective == pytest.approx(reached[0], abs=1e-3), "and the other method comes as high"
    return found


@needs_study
@pytest.mark.parametrize(
    ("names", "starts", "value"), [(SECOND, 6, -56.5135), (BOTH, 2, -107.8381)], ids=["second", "both"]
)
def test_no_random_start_of_another_method_ends_higher(study, names, starts, value):
    assert check_best(study, names, 1e-3, starts).objective == pytest.approx(value, abs=1e-3)


@pytest.mark.slow
@needs_study
@pytest.mark.parametrize("l2", [1e-3, 0.0])
@pytest.mark.parametrize("names", [SECOND, BOTH], ids=["second", "both"])
def test_none_of_fifty_random_starts_of_another_method_ends_higher(study, names, l2):
    check_best(study, names, l2, 50)
