"""``navirl report``: one page with the content of the files."""

import json
import re
from base64 import b64decode
from dataclasses import asdict, replace
from math import inf
from pathlib import Path

import pytest
from browser import CHROMIUM, Browser
from click.testing import CliRunner
from figure_factory import demonstration

from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.artefacts.steps import selection_words
from navirl_cli.cli import cli
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.evaluation.meaning import half_distance_m
from navirl_cli.reports.made import changed_settings
from navirl_cli.reports.reward import in_words

LOGS = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))[:1]


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    for words in (
        ["extract", *LOGS, "-o", folder / "demos.json"],
        ["fit", folder / "demos.json", "--cycle", 2, "--profile", "c0", "-o", folder / "reward.json"],
        [
            "report",
            folder / "demos.json",
            folder / "reward.json",
            "-o",
            folder / "page.html",
            "--samples",
            100,
            "--all",
        ],
    ):
        result = CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)
        assert result.exit_code == 0, result.output
    return folder


@pytest.fixture(scope="module")
def page(work):
    return (work / "page.html").read_text()


def test_it_holds_parameters_and_their_meaning(work, page):
    document = json.loads((work / "reward.json").read_text())
    (intervals,) = document["intervals"]
    for one, ends in zip(document["parameters"], intervals["parameters"], strict=True):
        numbers = [one["value"], *(end for end in (ends["lower"], ends["upper"]) if end is not None)]
        for text in (f"{number:.4f}" for number in numbers):
            assert text.replace("-", "\N{MINUS SIGN}") in page
    theta = dict(zip(("c0", "a_g", "a_p", "sigma_p"), read_reward(work / "reward.json").reward.theta, strict=True))
    assert f"<strong>{half_distance_m(theta):.3g} m</strong>" in page
    assert "7 demonstrations of 1 participant, and a navigation reward learnt from 2 of them, of 1 participant." in page


def test_it_says_in_front_how_to_drive(page):
    assert page.index("How to pass people by this reward") < page.index("Parameters</h2>")
    assert re.search(r"Pass the person at \d\.\d\d m between the robot's shell", page.replace("&#x27;", "'"))
    assert "No intervals: a parameter has none, or an open one" in page  # a_p has no lower end
    assert "In the scene of p01/3:" in page


def test_it_holds_figures_trials_ranks_and_hashes(work, page):
    assert page.count("data:image/png;base64,") == 16  # paths, policy, properties, profile; dark, narrow, and both
    assert page.count("<picture>") == 4
    for number in range(1, 8):
        assert f"p01/{number}" in page
    document = json.loads((work / "demos.json").read_text())
    assert document["inputs"][0]["sha256"] in page.replace("<wbr>", "")
    assert "Ranks of demonstrations among the policy" in page
    assert "Not ranked, because the reward was not learnt from such trials: force, cycle 1 (2), joystick (2), " in page
    assert "://" not in re.sub(r"data:image/png;base64,[^\"]+", "", page)


def test_it_says_how_it_was_made(page):
    made = page[page.index("How it was made</h2>") :].replace("<wbr>", "")
    assert "<li>Learnt from 2 of 7 demonstrations: p01/3, p01/4.</li>" in made
    assert "<li>Steps: all (" in made
    assert (
        "; method newton; regulariser 0.001; without a prior; start: c0 -50, a_g -0.01, a_p -5, sigma_p 2.</li>" in made
    )
    for command in (
        "navirl extract p01.mcap -o demos.json",
        "navirl fit demos.json --cycle 2 --profile c0 -o reward.json",
        "navirl report demos.json reward.json --all --samples 100 -o report.html",
    ):
        assert f"<code>{command}</code>" in made


def test_demonstrations_are_chosen_by_the_options_that_give_the_same():
    force, again, joystick = (
        demonstration(Condition.FORCE, 1, 0.1),
        demonstration(Condition.FORCE, 2, 0.2),
        demonstration(Condition.JOYSTICK, 2, 0.3),
    )
    everyone = [force, again, joystick]
    assert selection_words(everyone, everyone) == []
    assert selection_words(everyone, [force, again]) == ["--condition", "force"]
    assert selection_words(everyone, [again]) == ["--condition", "force", "--cycle", "2"]
    assert selection_words(everyone, [again, joystick]) == ["--cycle", "2"]
    assert selection_words(everyone, [force, joystick]) == ["--trial", force.id, "--trial", joystick.id]
    course = replace(again, id="p01/9", set="obstacle course")
    assert selection_words([*everyone, course], [again])[-2:] == ["--set", "main task"]


def test_settings_other_than_the_defaults_are_named():
    defaults = asdict(ExtractSettings())
    written = {**defaults, "push": {**defaults["push"], "begins_n": 9.5}, "time": "receipt", "map": None}
    assert changed_settings(written, defaults) == {"begins_n": 9.5, "time": "receipt"}


def test_it_warns_of_starts_aside(work):
    content = json.loads((work / "reward.json").read_text())
    content.update(demonstrations=["p01/1", "p01/2"], groups=["force, cycle 1"])
    first, report = work / "first.json", work / "first.html"
    first.write_text(json.dumps(content))
    words = ["report", work / "demos.json", first, "-o", report, "--samples", 10]
    assert CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False).exit_code == 0
    assert "<li>All 2 demonstrations are of cycle 1 and start 0." in report.read_text()


def test_it_warns_of_uncertain_parameters(page):
    assert "<li>Open interval: converged, but the demonstrations set no end to a parameter on one side" in page
    assert "Approximate: with so few demonstrations 84 to 98 % of such intervals cover, rather than 95 %." in page
    assert "<li>The policy rarely takes paths like those of " not in page


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium found; on Debian: apt-get install chromium")
def test_it_opens_sorts_enlarges_and_prints(work):
    browser = Browser(work / "profile")
    try:
        browser.show(width=360, height=700)
        browser.open(work / "page.html")
        assert browser.run("document.documentElement.scrollWidth <= innerWidth"), "the page scrolls sideways"
        assert not [
            event for event in browser.events if event["method"] in {"Log.entryAdded", "Runtime.exceptionThrown"}
        ]
        ranks = "[...document.querySelectorAll('table')].find(one => one.innerText.includes('learnt from'))"
        column = f"[...{ranks}.tBodies[0].rows].map(row => Number(row.cells[3].innerText))"
        browser.run(f"{ranks}.querySelectorAll('th button')[3].click()")
        sorted_ranks = browser.run(column)
        assert sorted_ranks == sorted(sorted_ranks)
        browser.run("document.querySelector('figure img').click()")
        assert browser.run("document.querySelector('dialog').open")
        assert b64decode(browser.call("Page.printToPDF")["data"]).startswith(b"%PDF")
    finally:
        browser.close()


def test_refusals(navirl, work):
    words = ("report", work / "demos.json", work / "reward.json")
    assert "exists already" in navirl(*words, "-o", work / "page.html", code=1).stderr
    swapped = navirl("report", work / "reward.json", work / "demos.json", "-o", "x.html", code=1).stderr
    assert "expected navirl demonstrations" in swapped


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((0.4, 0.9), "0.400 to 0.900"),
        ((-inf, 0.9), "less than 0.900"),
        ((0.4, inf), "more than 0.400"),
        ((6e-35, 0.9), "less than 0.900"),
        ((6e-35, inf), "the demonstrations set no range"),
        ((-2.0, 0.9), "-2.000 to 0.900"),
    ],
)
def test_a_range_in_metres_is_in_words(ends, text):
    assert in_words(*ends, 0.6) == text
