"""Forces whose unit cannot be the newton are hinted at."""

from dataclasses import replace

import pytest
from robot_log import Run, write_run

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.logs.load import LoadOptions, load_recording

#: A push of 12 N, from the front and from the side; several pushes.
ONE = Run()
SEVERAL = Run(pushes=((3.0, 3.4, 6.0, 0.0), (5.0, 7.0, 0.0, 25.0), (9.0, 9.3, 0.0, -4.0)))


@pytest.fixture
def hints(tmp_path):
    def found(run, scale):
        path = write_run(tmp_path / "run.mcap", run)
        notes = extract(load_recording(path, LoadOptions(force_scale=scale)), ExtractSettings()).notes
        return [note for note in notes if "force_scale" in note]

    return found


@pytest.mark.parametrize("run", [ONE, SEVERAL], ids=["one", "several"])
@pytest.mark.parametrize(("scale", "unit", "factor"), [(1e-3, "kN", "1000"), (1e3, "mN", "0.001")])
def test_pushes_in_another_unit(hints, run, scale, unit, factor):
    (hint,) = hints(run, scale)
    assert hint.startswith("run.mcap: the wrench rises to ")
    assert hint.endswith(
        f"in the shape of pushes, but no hand pushes so; if its unit is {unit}, give `force_scale` {factor}"
    )


@pytest.mark.parametrize("run", [ONE, SEVERAL, Run(pushes=())], ids=["one", "several", "none"])
def test_pushes_in_newtons_are_no_reason_for_a_hint(hints, run):
    assert hints(run, 1.0) == []


@pytest.mark.parametrize("scale", [1e-3, 1.0])
def test_noise_alone_is_none(hints, scale):
    quiet = replace(ONE, pushes=(), wrench_nan=0)
    assert hints(quiet, scale) == []
