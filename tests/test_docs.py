"""What the documents say of the commands, the schemas and the code is so."""

import re
import sys
import tomllib
from pathlib import Path

import matplotlib as mpl
import pytest
from matplotlib import pyplot as plt

from navirl_cli.cli import COMMANDS

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "docs" / "_ext"))
from blocks import blocks_of, run_page  # noqa: E402

PAGES = [page for page in sorted((ROOT / "docs").rglob("*.md")) if not {"_generated", "_build"} & set(page.parts)]
#: Pages whose blocks take long, or that show what another page shows; the build of the site runs the gallery.
SLOW = {
    "choose-trials.md",
    "figures.md",
    "gallery.md",
    "index.md",
    "nav2-study.md",
    "other-rewards.md",
    "own-log.md",
    "pandas.md",
    "plan.md",
    "persons.md",
    "published-study.md",
    "settings.md",
    "several-rewards.md",
    "visit.md",
}


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.name, marks=[pytest.mark.slow] if page.name in SLOW else [])
        for page in (ROOT / "README.md", *PAGES)
        if any(not block.skipped for block in blocks_of(page))
    ],
)
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # a page sets it: restored afterwards
    pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    run_page(page, tmp_path)
    plt.close("all")


def test_blocks_that_do_not_run_state_the_reason():
    for page in (ROOT / "README.md", *PAGES):
        for block in blocks_of(page):
            assert block.skipped == "" or " " in block.skipped, page.name


def test_the_readme_names_every_command_and_no_other():
    text = (ROOT / "README.md").read_text()
    assert re.findall(r"^\| `navirl ([\w-]+)`", text, re.MULTILINE) == list(COMMANDS)


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 100


def test_contributing_fits_on_a_screen():
    assert len((ROOT / "CONTRIBUTING.md").read_text().splitlines()) <= 60


def test_links_lead_somewhere():
    for page in (*ROOT.glob("*.md"), ROOT / "sample_logs" / "README.md", *PAGES):
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text()):
            made = "_generated" in target  # when the site is built, which fails without it
            assert made or target.startswith("https://") or (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_dependency_has_a_floor_and_a_reason():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    table = (ROOT / "ARCHITECTURE.md").read_text().split("## Dependencies")[1]
    for dependency in project["dependencies"]:
        name, floor = dependency.split(">=")
        assert floor[0].isdigit()
        assert re.search(rf"\b{name}\b.* \| \w", table), name


def test_the_demo_runs_what_the_readme_shows():
    script = (ROOT / "sample_logs" / "demo.sh").read_text()
    for command in (
        "extract",
        "fit",
        "evaluate",
        "plot paths",
        "plot policy",
        "plot reward",
        "plot properties",
        "study",
    ):
        assert f"run {command} " in script


def test_architecture_names_the_files_that_stand():
    text = (ROOT / "ARCHITECTURE.md").read_text()
    for path in re.findall(
        r"`((?:logs|demos|irl|artefacts|evaluation|figures|simulation|published|study|documents|reports|commands)/[\w/]+)",
        text,
    ):
        whole = ROOT / "navirl_cli" / path
        assert whole.is_dir() or whole.with_suffix(".py").exists(), path
