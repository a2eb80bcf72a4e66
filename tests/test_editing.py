"""Files made from demonstrations files, and what ``navirl info`` says of a file."""

import json
from dataclasses import replace
from pathlib import Path

import factories as make
import numpy as np
import pytest

from navirl_cli.artefacts.demonstrations import demonstrations_document, read_demonstrations
from navirl_cli.artefacts.rewards import reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward

GRID = make.open_grid(8, 4)
CELLS = [[0, 1], [1, 1], [2, 2], [3, 2]]
#: Starts of three trials since the log's first pose, s.
STARTS_S = (2.0, 35.6, 70.1)


def trials(participant, count=3):
    return [
        replace(
            make.demonstration(GRID, CELLS, participant=participant, number=number, cycle=number),
            log=f"{participant}.mcap",
            start_ns=10**18 + int(start_s * 1e9),
        )
        for number, start_s in enumerate(STARTS_S[:count], 1)
    ]


def write(name, ones, inputs=("a.mcap",), **settings):
    document = demonstrations_document(ones, [], settings)
    document["inputs"] = [{"file": file, "sha256": "0" * 64} for file in inputs]
    write_json(Path(name), "demonstrations", document, force=True)


def table(name, rows, header="log,trial,start_s,participant,condition,cycle,set"):
    Path(name).write_text("\n".join([header, *rows]) + "\n")


def test_select_keeps_everything_of_the_trials(navirl):
    far = replace(make.demonstration(make.open_grid(9, 9), CELLS, participant="q", number=1))
    write("a.json", [*trials("p"), far], resolution_m=0.1)
    assert (
        navirl("select", "a.json", "--cycle", 1, "--cycle", 3, "-o", "b.json").stdout
        == "b.json: 2 of 4 demonstrations\n"
    )
    before, after = (json.loads(Path(name).read_text()) for name in ("a.json", "b.json"))
    assert [one["id"] for one in after["demonstrations"]] == ["p/1", "p/3"]
    navirl("select", "a.json", "--participant", "p", "-o", "c.json")
    last = json.loads(Path("c.json").read_text())
    assert last["demonstrations"] == before["demonstrations"][:3]
    assert len(last["maps"]) == 1 < len(before["maps"])
    assert (last["inputs"], last["settings"]) == (before["inputs"], before["settings"])
    assert "Name what to select" in navirl("select", "a.json", "-o", "d.json", code=2).stderr
    assert (
        "--set: expected 'main task', found 'x'" in navirl("select", "a.json", "--set", "x", "-o", "d", code=1).stderr
    )


def test_merge_is_the_inverse_of_select_and_says_what_differs(navirl):
    write("a.json", trials("p"), ("p.mcap",), resolution_m=0.1, split="goal")
    write("b.json", trials("q"), ("q.mcap", "p.mcap"), resolution_m=0.1, split="stop")
    found = navirl("merge", "a.json", "b.json", "-o", "c.json")
    assert found.stdout == "c.json: 6 demonstrations of 2 participants\n"
    assert "extracted with different split" in found.stderr
    merged = json.loads(Path("c.json").read_text())
    assert merged["settings"] == {"resolution_m": 0.1, "split": None}
    assert [one["file"] for one in merged["inputs"]] == ["p.mcap", "q.mcap"]
    navirl("select", "c.json", "--participant", "p", "-o", "d.json")
    ours, theirs = read_demonstrations(Path("d.json")), read_demonstrations(Path("a.json"))
    assert all(np.array_equal(one.xy_m, other.xy_m) for one, other in zip(ours, theirs, strict=True))
    assert "found p/1 in both" in navirl("merge", "a.json", "d.json", "-o", "e.json", code=1).stderr
    assert "two or more" in navirl("merge", "a.json", "-o", "e.json", code=2).stderr
    assert "one twice" in navirl("merge", "a.json", "a.json", "-o", "e.json", code=2).stderr


def test_relabel_finds_the_trials_by_log_and_start(navirl):
    write("a.json", [*trials("p"), *trials("q", 2)])
    table("t.csv", ["p.mcap,1,2.0,,joystick,,", "p.mcap,3,70.1,,,7,far", "q.mcap,1,2.0,p,,,", "q.mcap,2,35.6,,,,"])
    found = navirl("relabel", "a.json", "--trials", "t.csv", "-o", "b.json")
    assert found.stdout == "b.json: 3 of 5 demonstrations have other labels\n"
    assert "q/1 is now p/4" in found.stderr
    after = [(one.id, one.condition.value, one.cycle, one.set) for one in read_demonstrations(Path("b.json"))]
    assert after == [
        ("p/1", "joystick", 1, None),
        ("p/2", "force", 2, None),
        ("p/3", "force", 7, "far"),
        ("p/4", "force", 1, None),
        ("q/2", "force", 2, None),
    ]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["p.mcap,1,2.0,,joystick,,"], "found several ways to place the table's 1 row on its 3 demonstrations"),
        (["x.mcap,1,2.0,,joystick,,"], "expected rows of trials of p.mcap, found none"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(navirl, rows, message):
    write("a.json", trials("p"))
    table("t.csv", rows)
    assert message in navirl("relabel", "a.json", "--trials", "t.csv", "-o", "b.json", code=1).stderr


def test_what_only_an_extraction_can_apply_is_refused(navirl):
    write("a.json", trials("p", 1))
    table("t.csv", ["p.mcap,2.0,0.9"], "log,start_s,robot_radius_m")
    message = navirl("relabel", "a.json", "--trials", "t.csv", "-o", "b.json", code=1).stderr
    assert "column robot_radius_m: expected what p/1 holds, found another; extract the log again" in message


def test_info_shows_what_a_file_holds_and_single_values(navirl):
    ones = trials("p")
    write("a.json", ones)
    found = fit(evidence_of(ones), Reward.named({}), scan=False)
    write_json(Path("r.json"), "reward", reward_document(found, ones, [], 0.1), force=False)
    text = navirl("info", "a.json").stdout
    assert "- demonstrations: 3\n" in text
    assert "- cycles: 1, 2, 3\n" in text
    assert text.count("\n") < 40
    summary = json.loads(navirl("info", "a.json", "--json").stdout)
    assert summary["groups"] == {"force, cycle 1": 1, "force, cycle 2": 1, "force, cycle 3": 1}
    assert summary["participants"] == ["p"]
    navirl("plan", "r.json", "--scene", "a.json", "-o", "plan.json")
    navirl("evaluate", "a.json", "--reward", "r.json", "--samples", 2, "-o", "m.json")
    values = {
        ("a.json", "demonstrations"): 3,
        ("r.json", "parameters.c0"): found.reward.theta[0],
        ("r.json", "demonstrations"): 3,
        ("r.json", "resolution_m"): 0.1,
        ("plan.json", "paths.0.length_m"): json.loads(Path("plan.json").read_text())["paths"][0]["length_m"],
        ("m.json", "metrics.0"): None,
    }
    for (file, name), value in values.items():
        printed = navirl("info", file, "--field", name).stdout
        assert printed == "length_m\n" if value is None else json.loads(printed) == value
    message = navirl("info", "r.json", "--field", "c0", code=2).stderr
    assert "--field: expected dots between levels, found 'c0'; did you mean 'parameters.c0'?" in message
    message = navirl("info", "r.json", "--field", "parameters.c1", code=2).stderr
    assert "--field: expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'c1'" in message
    Path("x.json").write_text('{"format": "navirl/log"}')
    assert "found format 'navirl/log'" in navirl("info", "x.json", code=1).stderr
    for kind in ("plan", "m"):
        assert "navirl: " in navirl("info", f"{kind}.json").stdout
    learnt = next(one for one in json.loads(Path("m.json").read_text())["groups"] if one["path_type"] == "learnt")
    exact = learnt["exact"]["length_m"]
    assert f"{exact:.4f}" != f"{learnt['mean']['length_m']:.4f}"
    assert f" {exact:.4f} " in navirl("info", "m.json").stdout  # as evaluate prints it
