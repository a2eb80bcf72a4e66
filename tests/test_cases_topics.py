"""Small logs of situations that people report in public threads: topics, payloads, units and reasons."""

import os
from pathlib import Path

import pytest

CASES = Path(os.environ.get("NAVIRL_CASES_DIR", Path(__file__).resolve().parent.parent.parent / "shared" / "cases"))
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason=f"no {CASES}: set NAVIRL_CASES_DIR to the folder of cases")
#: What a sound extraction of the scene prints: length, cells, contacts, share of contact, peak, impulse, direction.
SOUND = "18.8      7.37     72         1         11    20.7         39.9            122"

#: By log: options of extract, what extract prints (a row, or the beginning of an error), and a hint.
READ = {
    "base": ((), SOUND, ""),
    "one_topic_two_types": ((), SOUND, "/odom holds messages of several types"),
    "wrench_z_nan": ((), SOUND, "force z of /ft is never finite, so it is missing"),
    "tf_only_no_wrench": (("--no-wrench",), "18.8      7.37     72", "poses are those of 'base_link' in tf"),
    "force_kilonewton": (("--force-scale", "1000"), SOUND, ""),
}
REFUSED = {
    "empty_schemas": "none of its 6 topics has a definition of its messages, so that nothing can be decoded",
    "goal_frame_unknown": "no goal is left: 1 message on /goal_pose left out: transform from 'world' to 'map'",
    "two_publishers_odom": "poses jump to and fro between two tracks 0.3",
}


@pytest.fixture
def run(navirl, tmp_path):
    def extracted(name, *options, code=0):
        return navirl("extract", CASES / f"{name}.mcap", "-o", tmp_path / "demos.json", *options, code=code)

    return extracted


@pytest.mark.parametrize("name", READ)
def test_the_trial_comes_out_and_what_is_unusual_is_told(run, name):
    options, row, hint = READ[name]
    result = run(name, *options)
    assert row in result.stdout
    assert hint in result.stderr


@pytest.mark.parametrize("name", REFUSED)
def test_inspect_gives_the_reason_for_which_extract_refuses(run, navirl, name):
    result = run(name, code=1)
    view = navirl("inspect", CASES / f"{name}.mcap", code=3 if name == "goal_frame_unknown" else 0)
    assert REFUSED[name] in result.stderr
    assert REFUSED[name] in view.stdout
    assert "extract has what it needs" not in view.stdout


def test_forces_in_kilonewtons_are_hinted_at(run):
    result = run("force_kilonewton")
    assert "if its unit is kN, give --force-scale 1000" in result.stderr


def test_both_types_of_a_topic_are_listed(navirl):
    lines = navirl("inspect", CASES / "one_topic_two_types.mcap").stdout.splitlines()
    rows = [line.split()[:3] for line in lines if line.startswith("/odom ")]
    assert rows == [["/odom", "geometry_msgs/PoseStamped", "300"], ["/odom", "nav_msgs/Odometry", "210"]]
