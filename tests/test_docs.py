"""What the documents say of the commands, the schemas and the code is so."""

import re
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from navirl_cli.cli import COMMANDS, cli
from navirl_cli.commands.plot import plot
from navirl_cli.logs.roles.topics import ROLES, short_name
from navirl_cli.reports.evaluation import metrics_page

ROOT = Path(__file__).parent.parent


def help_of(*words):
    return " ".join(CliRunner().invoke(cli, [*words, "--help"]).output.split())


def test_the_readme_names_every_command_and_no_other():
    text = (ROOT / "README.md").read_text()
    assert set(re.findall(r"^### `navirl ([\w-]+)", text, re.MULTILINE)) == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_options_in_the_readme_exist(command):
    text = (ROOT / "README.md").read_text()
    section = re.search(rf"^### `navirl {command}\b.*?(?=^##)", text, re.MULTILINE | re.DOTALL)
    assert section
    kinds = tuple(plot.known) if command == "plot" else ()
    known = help_of(command) + " ".join(help_of(command, kind) for kind in kinds)
    for option in set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", section.group())):
        assert option in known, option


def test_the_readme_names_every_role_with_its_types():
    text = (ROOT / "README.md").read_text()
    for role in ROLES:
        row = re.search(rf"^\| [\w, ]*\b{role.name}\b[\w, ]* \| ([^|]*) \|", text, re.MULTILINE)
        assert row, role.name
        assert row[1].split(", ") == [short_name(one.name) for one in role.message_types], role.name


def test_links_lead_somewhere():
    for page in (*ROOT.glob("*.md"), ROOT / "sample_logs" / "README.md"):
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
            assert target.startswith("https://") or (page.parent / target).exists(), f"{page.name}: {target}"


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


def test_the_page_of_metrics_is_that_of_the_command():
    assert (ROOT / "METRICS.md").read_text() == metrics_page(), (
        "renew it: python -m navirl_cli.reports.evaluation > METRICS.md"
    )
