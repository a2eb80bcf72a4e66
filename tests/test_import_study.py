"""navirl import-study: archives and folders in, logs out, and losses are reported."""

import json
import shutil

import numpy as np
import published_factory as forge
import pytest
import study_data

from navirl_cli.logs.messages.writer import message_type
from navirl_cli.logs.recording import Occupancy
from navirl_cli.published.log import ring_m

# What is loaded here is not loaded again by each of the workers that are forked from here.
message_type("nav_msgs/msg/Odometry")
ring_m(Occupancy(np.array([[99, 100]], dtype=np.int8), 0.1, (0.0, 0.0)))


def write(folder, files):
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)


@pytest.fixture
def study(tmp_path):
    """Two participants, in an archive too."""
    files = forge.participant()
    for name in ("p1", "p2"):
        write(tmp_path / "runs" / name, files | {"params.pkl": b"cos\nsystem\n"})
    (tmp_path / "runs.tar.gz").write_bytes(
        forge.archive({f"runs/{name}/{file}": data for name in ("p1", "p2") for file, data in files.items()})
    )
    return tmp_path


def test_an_archive_and_a_folder_give_the_same_logs(navirl, study):
    result = navirl("import-study", "runs.tar.gz", "-o", "logs")
    assert result.stderr == (
        "navirl: the study has no forces: extract needs --no-wrench for these logs; navirl study logs evaluates them\n"
    )
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["log", "trials", "course", "completed", "in", "size", "MB"]
    assert [line.split()[:2] for line in lines[1:]] == [["logs/p1.mcap", "10"], ["logs/p2.mcap", "10"]]
    assert "force 18.8 s, joystick 17.0 s" in lines[1]
    navirl("import-study", ".", "-o", "again")
    for name in ("p1.mcap", "p2.mcap"):
        assert (study / "again" / name).read_bytes() == (study / "logs" / name).read_bytes()
    assert sorted(path.name for path in (study / "again").iterdir()) == ["p1.mcap", "p2.mcap"]


def test_one_participants_folder_and_json(navirl, study):
    shown = json.loads(navirl("import-study", "runs/p2", "-o", "logs", "--json").stdout)
    assert shown == {
        "logs": [
            {
                "log": "logs/p2.mcap",
                "participant": "p2",
                "trials": 10,
                "completion_s": {"force": [18.7999985218], "joystick": [16.9999983311]},
                "size_bytes": (study / "logs" / "p2.mcap").stat().st_size,
            }
        ],
        "lost": [],
    }


def test_what_is_lost_is_reported_and_the_rest_is_written(navirl, study):
    (study / "runs" / "p1" / "joystick_demos.pkl").write_bytes(b"cos\nsystem\n(S'true'\ntR.")
    write(study / "runs" / "p3", {"force_demos.pkl": b"hello"})
    (study / "runs" / "p2" / "force_parcours_times.txt").unlink()
    (study / "runs" / "p2" / "joystick_parcours_times.txt").unlink()
    result = navirl("import-study", "runs", "-o", "logs", code=3)
    assert sorted(path.name for path in (study / "logs").iterdir()) == ["p1.mcap", "p2.mcap"]
    said, broken, missing, nothing = result.stderr.splitlines()
    assert said.startswith("navirl: the study has no forces")
    assert broken == (
        "navirl: runs/p1/joystick_demos.pkl: expected only names that the published study needs, found os.system "
        "before byte 11; no code was run; download the file from its authors again"
    )
    assert missing == (
        "navirl: runs/p2: expected force_parcours_times.txt, joystick_parcours_times.txt too, found no such files; "
        "their data are left out"
    )
    assert nothing == (
        "navirl: runs/p3: expected demonstrations and a map, found none: runs/p3/force_demos.pkl: expected a pickle of "
        "protocol 0, as the study is published, found operation 'h' before byte 1 of 5; download the file from its "
        "authors again (and 1 more)"
    )
    assert "p2.mcap      10  unknown" in result.stdout


def test_no_usable_data_is_an_expected_error(navirl, study):
    shutil.rmtree(study / "runs")
    write(study / "runs" / "p3", {"force_demos.pkl": b"hello"})
    result = navirl("import-study", "runs", "-o", "logs", code=1)
    assert result.stderr.splitlines()[-1] == (
        "navirl: runs: expected published files of the study, found none that can be used; fetch them again"
    )
    assert "navirl: runs/p3: expected demonstrations and a map, found none" in result.stderr
    assert not (study / "logs").exists()


def test_logs_are_not_overwritten_unless_forced(navirl, study):
    write(study / "logs", {"p2.mcap": b"mine"})
    result = navirl("import-study", "runs", "-o", "logs", code=1)
    assert result.stderr == "navirl: logs/p2.mcap: exists already; choose another name, or replace it with --force\n"
    assert [path.name for path in (study / "logs").iterdir()] == ["p2.mcap"]
    navirl("import-study", "runs", "-o", "logs", "--force")
    assert (study / "logs" / "p2.mcap").stat().st_size > 10_000


@pytest.mark.usefixtures("study")
def test_a_folder_that_cannot_be_made_is_reported(navirl):
    result = navirl("import-study", "runs", "-o", "runs.tar.gz", code=1)
    assert result.stderr == "navirl: runs.tar.gz: cannot be made a folder: File exists; choose another --output\n"


def test_a_damaged_archive_is_refused(navirl, study):
    whole = (study / "runs.tar.gz").read_bytes()
    (study / "runs.tar.gz").write_bytes(whole[: len(whole) // 2])
    result = navirl("import-study", "runs.tar.gz", "-o", "logs", code=1)
    assert result.stderr.startswith(
        "navirl: runs.tar.gz: expected an intact tar archive of the study (runs.tar.gz), found "
    )


def test_extract_takes_the_logs_and_finds_the_published_cells(navirl, study):
    navirl("import-study", "runs/p1", "-o", "logs")
    result = navirl("extract", "logs/p1.mcap", "--no-wrench", "-o", "demos.json")
    assert "p1.mcap: cells equal to those published with it: 10 of 10 paths" in result.stderr
    demonstrations = json.loads((study / "demos.json").read_text())["demonstrations"]
    assert {one["set"] for one in demonstrations} >= {None, "obstacle course", "obstacle avoidance"}


@pytest.mark.skipif(not study_data.ROOT.is_dir(), reason=study_data.REASON)
def test_the_published_study(navirl, tmp_path):
    result = navirl("import-study", study_data.ROOT, "-o", "logs")
    names = sorted(folder.name for folder in (study_data.ROOT / "runs").iterdir())
    assert [line.split()[1] for line in result.stdout.splitlines()[1:]] == ["10"] * len(names)
    assert sorted(path.stem for path in (tmp_path / "logs").iterdir()) == names
