"""Demonstrations files name the command lines that made them: run again, these give the same file."""

import json
import shlex
import shutil
from pathlib import Path

import pytest
from factories import demonstration, open_grid
from fleet_logs import SAMPLES

import navirl_cli as navirl_python
from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.steps import Step, names_of, steps_of
from navirl_cli.artefacts.store import read_json, write_json


def lines_of(name):
    return [one.line for one in steps_of([name], [read_json(Path(name), "demonstrations")])]


def without_version(name):
    return {key: value for key, value in json.loads(Path(name).read_text()).items() if key != "navirl"}


def written(name, participant, **settings):
    """A file of four trials, as if extracted from a log of the participant."""
    Path(name).parent.mkdir(exist_ok=True)
    path = [[0, 1], [1, 1], [2, 2]]
    ones = [demonstration(open_grid(8, 4), path, participant=participant, number=n, cycle=n) for n in (1, 2, 3, 4)]
    document = demonstrations_document(ones, [], settings)
    document["inputs"] = [{"file": f"{participant}.mcap", "sha256": "0" * 64}]
    write_json(Path(name), "demonstrations", document, force=False)


def test_the_lines_of_a_file_give_the_same_file_again(navirl, tmp_path):
    for log in SAMPLES[:2]:
        shutil.copy(log, tmp_path)
    navirl("extract", "p01.mcap", "--contact-force", "4", "-o", "monday.json")
    navirl("extract", "p02.mcap", "-o", "other name.json")
    shutil.move("other name.json", "tuesday.json")
    Path("t.csv").write_text(navirl("inspect", "p01.mcap", "--trials").stdout.replace(",force,1,", ",force,7,"))
    navirl("relabel", "monday.json", "--trials", "t.csv", "-o", "labelled.json")
    navirl("merge", "labelled.json", "tuesday.json", "-o", "both.json")
    navirl("select", "both.json", "--cycle", "7", "--cycle", "2", "-o", "some.json")
    lines = lines_of("some.json")
    assert lines == [
        "navirl extract p01.mcap --contact-force 4 -o monday.json",
        "navirl relabel monday.json --trials t.csv -o labelled.json",
        "navirl extract p02.mcap -o tuesday.json",
        "navirl merge labelled.json tuesday.json -o both.json",
        "navirl select both.json --cycle 7 --cycle 2 -o some.json",
    ]
    before = without_version("some.json")
    assert {one["file"] for one in before["inputs"]} == {"p01.mcap", "p02.mcap", "t.csv"}
    for made in Path().glob("*.json"):
        made.unlink()
    for line in lines:
        navirl(*shlex.split(line)[1:])
    assert without_version("some.json") == before


@pytest.mark.slow
def test_a_report_shows_the_lines_in_order(navirl):
    written("a.json", "p", split="stop")
    written("b.json", "q")
    navirl("select", "a.json", "--cycle", "1", "--cycle", "2", "-o", "some.json")
    navirl("fit", "some.json", "b.json", "--terms", "length", "--intervals", "wald", "-o", "r.json")
    navirl("report", "some.json", "b.json", "r.json", "--samples", "2", "-o", "r.html")
    page = Path("r.html").read_text().replace("<wbr>", "")
    made = page[page.index("The same by command lines:") :]
    lines = [
        "navirl extract p.mcap --split stop -o a.json",
        "navirl select a.json --cycle 1 --cycle 2 -o some.json",
        "navirl extract q.mcap -o b.json",
        "navirl fit some.json b.json --intervals wald --terms length -o r.json",
        "navirl report some.json b.json r.json --samples 2 -o report.html",
    ]
    places = [made.index(f"<code>{line}</code>") for line in lines]
    assert places == sorted(places)
    assert "navirl select a.json --cycle 1 --cycle 2 -o some.json" in navirl("info", "some.json").stdout


def test_files_of_one_origin_name_it_once_and_files_of_one_name_are_kept_apart(navirl):
    written("all.json", "p")
    navirl("select", "all.json", "--cycle", "1", "-o", "one.json")
    navirl("select", "all.json", "--cycle", "2", "-o", "two.json")
    navirl("merge", "two.json", "one.json", "-o", "both.json")
    assert [line.split()[1] for line in lines_of("both.json")] == ["extract", "select", "select", "merge"]
    written("monday/demos.json", "q")
    written("tuesday/demos.json", "r")
    navirl("merge", "monday/demos.json", "tuesday/demos.json", "-o", "days.json")
    assert lines_of("days.json")[-1] == "navirl merge monday/demos.json tuesday/demos.json -o days.json"
    assert names_of([Path("monday/demos.json"), Path("one.json")]) == ["demos.json", "one.json"]


def test_a_step_is_named_again_where_its_files_were_written_in_between():
    def head(*steps):
        return {"steps": [vars(one) for one in steps]}

    first, other = (Step("extract", (name,), (), "demos.json") for name in ("a.mcap", "b.mcap"))
    one, two, three = (Step("select", ("demos.json",), ("--cycle", str(n)), f"{n}.json") for n in (1, 2, 3))
    found = steps_of(["1.json", "2.json", "3.json"], [head(first, one), head(other, two), head(first, three)])
    assert found == [first, one, other, two, first, three]
    found = steps_of(["1.json", "3.json", "2.json"], [head(first, one), head(first, three), head(other, two)])
    assert found == [first, one, three, other, two]


def test_files_that_an_older_navirl_merged_name_no_extraction(navirl):
    written("a.json", "p", split=None)
    assert lines_of("a.json") == []
    navirl("select", "a.json", "--cycle", "1", "-o", "b.json")
    assert lines_of("b.json") == ["navirl select a.json --cycle 1 -o b.json"]


def test_python_names_the_same_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written("a.json", "p")
    written("b.json", "q")
    both = navirl_python.read_demonstrations("a.json", "b.json")
    both.write("all.json")
    assert lines_of("all.json")[-1] == "navirl merge a.json b.json -o all.json"
    both.select(cycle=(1, 2)).select(participant="p").write("some.json")
    assert lines_of("some.json")[-1] == "navirl select a.json b.json --trial p/1 --trial p/2 -o some.json"
    both.select(cycle=2).write("second.json")
    assert lines_of("second.json")[-1] == "navirl select a.json b.json --cycle 2 -o second.json"
    again = navirl_python.read_demonstrations("second.json")
    again.write("renamed.json")
    renamed = [line.replace("second.json", "renamed.json") for line in lines_of("second.json")]
    assert lines_of("renamed.json") == renamed
    navirl_python.read_demonstrations("a.json").write("copy.json")
    assert "steps" not in read_json(Path("copy.json"), "demonstrations")


@pytest.mark.parametrize("change", [{"steps": []}, {"steps": [{"command": "select"}]}, {"steps": ["select"]}])
def test_broken_steps_are_refused(tmp_path, monkeypatch, change):
    monkeypatch.chdir(tmp_path)
    written("a.json", "p")
    Path("b.json").write_text(json.dumps(json.loads(Path("a.json").read_text()) | change))
    with pytest.raises(navirl_python.NavirlError, match=r"b\.json.* at steps"):
        read_json(Path("b.json"), "demonstrations")


def test_a_file_of_version_1_is_edited_and_names_its_extraction(navirl):
    shutil.copy(Path(__file__).parent / "version1" / "demonstrations.json", "old.json")
    navirl("select", "old.json", "--cycle", "2", "-o", "second.json")
    assert lines_of("second.json") == [
        "navirl extract a.mcap b.mcap --gain --resolution 0.2 -o old.json",
        "navirl select old.json --cycle 2 -o second.json",
    ]
