"""The published study: likelihoods, paths and cells against independent results, where the data are at hand."""

import io
import pickle
from dataclasses import replace

import factories as make
import numpy as np
import pytest
import study_data

from navirl_cli.demos.rasterize import rasterize
from navirl_cli.evaluation.metrics import path_metrics
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import evidence_of, likelihood, log_likelihood
from navirl_cli.irl.reward import Reward

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
        found = path_metrics(one.xy_m, np.array([[first, 0.05], [last, 0.05]]), one.people_m, 0.0)
        assert found.length_m == pytest.approx(result["length_m"], rel=1e-6)
        assert found.min_distance_m == pytest.approx(result["min_center_distance_m"], rel=1e-6)
        assert found.area_m2 == pytest.approx(result["area_under_path_m2"], rel=1e-2)
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


@pytest.mark.parametrize(("module", "name"), [("os", "system"), ("builtins", "eval"), ("numpy", "load")])
def test_pickles_that_name_anything_else_are_refused(module, name):
    forged = f"c{module}\n{name}\n(S'true'\ntR.".encode()
    with pytest.raises(pickle.UnpicklingError, match=f"refused to resolve {module}.{name}"):
        study_data.Reader(io.BytesIO(forged), encoding="latin-1").load()


def test_a_pickle_of_objects_in_an_array_is_refused():
    dtype = study_data.Kept("O8", 0, 1)
    with pytest.raises(pickle.UnpicklingError, match="no numbers: O8"):
        study_data.scalar(dtype, "x")
