"""Commands that take several files and folders of demonstrations."""

import json
from pathlib import Path

import pytest
from factories import demonstration, open_grid
from fleet_logs import SAMPLES

import navirl_cli
from navirl_cli.artefacts.demonstrations import demonstrations_document, read_demonstrations
from navirl_cli.artefacts.joined import read_content, read_joined
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.errors import ArgumentError, DemonstrationError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of the sample logs' demonstrations, one file of all of them, and a reward."""
    from navirl_cli.artefacts.many import Folder
    from navirl_cli.logs.load import LoadOptions
    from navirl_cli.parallel import Local

    where = tmp_path_factory.mktemp("joined")
    Folder(where / "all", ExtractSettings(), LoadOptions(), {}).extract(SAMPLES, executor=Local(1))
    one = read_demonstrations(where / "all")
    write_json(where / "one.json", "demonstrations", demonstrations_document(one, [], {}), force=True)
    return where


def test_files_are_read_in_their_order_as_a_folder_is(folder):
    files = [folder / "all" / f"p0{number}.json" for number in (1, 2, 3)]
    assert read_joined(files) == read_joined([folder / "all"]) == read_joined([folder / "one.json"])
    assert (
        read_content([folder / "all"])[0]["demonstrations"]
        == json.loads((folder / "one.json").read_text())["demonstrations"]
    )
    assert list(navirl_cli.read_demonstrations(*files)) == list(navirl_cli.read_demonstrations(folder / "all"))


def test_a_file_or_a_trial_twice_is_refused(folder):
    first = folder / "all" / "p01.json"
    with pytest.raises(ArgumentError, match=r"p01.json: expected different files .*, found this one twice"):
        read_joined([first, folder / "all" / ".." / "all" / "p01.json"])
    with pytest.raises(
        DemonstrationError, match=r"all: expected other trials than .*p01.json, found p01/1 in both.*folder"
    ):
        read_joined([first, folder / "all"])
    with pytest.raises(DemonstrationError, match="found p01/1 in both"):
        read_content([first, folder / "all"])


def test_trials_of_one_participant_are_numbered_through_a_folder(tmp_path):
    """Two logs of one participant, the first with a trial that was skipped."""
    from navirl_cli.artefacts.manifest import DONE, Entry, Part, write_manifest
    from navirl_cli.files import Input

    entries = []
    for name, trials in (("a", 3), ("b", 2)):
        made = [demonstration(open_grid(8, 4), [[0, 1], [1, 1], [2, 2]], number=number) for number in (1, 2)]
        path = tmp_path / f"{name}.json"
        write_json(path, "demonstrations", demonstrations_document(made, [], {}), force=True)
        part = Part(f"/logs/{name}.mcap", 1, "e", name * 64)
        digest = Input.of(path).sha256
        entries.append(
            Entry(f"{name}.mcap", (part,), "0" * 64, DONE, file=path.name, file_sha256=digest, trials=trials)
        )
    write_manifest(tmp_path, {}, entries)
    content, _ = read_content([tmp_path])
    assert [one["id"] for one in content["demonstrations"]] == ["p1/1", "p1/2", "p1/4", "p1/5"]
    assert [one.id for one in read_joined([tmp_path])] == ["p1/1", "p1/2", "p1/4", "p1/5"]
    assert [one["file"] for one in content["inputs"]] == ["a.mcap", "b.mcap"]


def test_commands_take_several_files_and_folders(folder, navirl):
    all_, (one, *others) = folder / "all", sorted((folder / "all").glob("p*.json"))
    navirl("fit", all_, "--cycle", 2, "--intervals", "wald", "-o", "a.json")
    navirl("fit", one, *others, "--cycle", 2, "--intervals", "wald", "-o", "b.json")
    first, second = (json.loads(Path(name).read_text()) for name in ("a.json", "b.json"))
    assert [len(one.pop("inputs")) for one in (first, second)] == [1, 3]
    assert first == second
    assert "demonstrations: 21" in navirl("info", all_).stdout
    assert "demonstrations: 14" in navirl("info", one, others[0]).stdout
    assert navirl("merge", all_, "-o", "m.json").stdout == "m.json: 21 demonstrations of 3 participants\n"
    assert read_demonstrations(Path("m.json")) == read_demonstrations(all_)
    assert "a folder" in navirl("merge", one, "-o", "n.json", code=2).stderr
    assert "6 of 21" in navirl("select", all_, "--cycle", 2, "-o", "s.json").stdout


@pytest.mark.slow
def test_figures_and_reports_take_several_files_and_folders(folder, navirl):
    all_, (one, *others) = folder / "all", sorted((folder / "all").glob("p*.json"))
    navirl("fit", all_, "--cycle", 2, "--intervals", "wald", "-o", "a.json")
    Path("trials.csv").write_text(navirl("inspect", SAMPLES[0], "--trials").stdout)
    navirl("relabel", all_, "--trials", "trials.csv", "-o", "l.json")
    assert len(read_demonstrations(Path("l.json"))) == 21
    navirl("plot", "paths", one, *others, "-o", "p.svg")
    navirl("report", one, *others, "a.json", "--samples", 2, "-o", "r.html")
    assert "navirl report p01.json p02.json p03.json a.json" in Path("r.html").read_text()
    navirl("report", all_, "a.json", "--samples", 2, "-o", "f.html")
    assert "-o all/" in Path("f.html").read_text()
