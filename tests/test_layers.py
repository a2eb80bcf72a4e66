"""Rooms stand in the order in which the data walks, and import only from rooms below them."""

import ast
from pathlib import Path

import pytest

import navirl_cli

PACKAGE = Path(navirl_cli.__file__).parent
#: By folder, from the bottom up; rooms of one line do not know each other.
ORDERS = {
    "navirl_cli": [
        ["__init__", "arrays", "errors", "limits"],
        ["remote"],
        ["files", "parallel"],
        ["documents", "teams"],
        ["cluster"],
        ["logs"],
        ["demos"],
        ["irl"],
        ["evaluation"],
        ["study", "simulation", "published", "planning"],
        ["artefacts", "export"],
        ["reports"],
        ["figures"],
        ["api", "watching"],
        ["commands"],
        ["cli"],
        ["__main__"],
    ],
    "navirl_cli.logs": [
        ["__init__", "findings", "occupancy", "yaml_file"],
        ["recording"],
        ["container", "tf"],
        ["messages", "sources", "map_geometry"],
        ["map_file"],
        ["roles"],
        ["load"],
        ["overview"],
    ],
    "navirl_cli.logs.container": [
        ["__init__", "damage", "records"],
        ["batches", "raw", "sniff"],
        ["remote_file"],
        ["chunks", "compressed", "summary"],
        ["resync", "insertion"],
        # what the pieces define reaches the survey through `batches.Definitions`, which both are given
        ["survey", "opener"],
        ["log_file"],
    ],
    "navirl_cli.logs.messages": [
        ["__init__", "schema", "single"],
        ["definitions", "layout"],
        ["decode", "writer"],
        ["packing"],
        ["series"],
        ["reader"],
    ],
    "navirl_cli.logs.tf": [["__init__", "rotations"], ["transforms"], ["tree"]],
}


def level(order: list[list[str]]) -> dict[str, int]:
    return {room: number for number, rooms in enumerate(order) for room in rooms}


def folder_of(package: str) -> Path:
    return PACKAGE.joinpath(*package.split(".")[1:])


def room_of(path: Path, package: str = "navirl_cli") -> str:
    return path.relative_to(folder_of(package)).parts[0].removesuffix(".py")


def imported_rooms(tree: ast.AST, package: str = "navirl_cli") -> set[str]:
    """The rooms of a package that a file imports from."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == package:
            folder = folder_of(package)
            for alias in node.names:
                found = (folder / f"{alias.name}.py").exists() or (folder / alias.name).is_dir()
                names.add(alias.name if found else "__init__")
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{package}."):
            names.add(node.module.removeprefix(f"{package}.").split(".")[0])
        elif isinstance(node, ast.Import):
            names |= {
                alias.name.removeprefix(f"{package}.").split(".")[0]
                for alias in node.names
                if alias.name.startswith(f"{package}.")
            }
    return names


@pytest.mark.parametrize("package", ORDERS)
def test_every_room_has_its_place(package):
    assert {room_of(path, package) for path in folder_of(package).rglob("*.py")} == set(level(ORDERS[package]))


@pytest.mark.parametrize("package", ORDERS)
def test_rooms_import_only_from_below(package):
    levels = level(ORDERS[package])
    door = PACKAGE / "__init__.py"  # shows types of the rooms above it, and loads them when they are used
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {other}"
        for path in folder_of(package).rglob("*.py")
        if path != door
        for other in imported_rooms(ast.parse(path.read_text(encoding="utf-8")), package)
        if other != room_of(path, package) and levels[other] >= levels[room_of(path, package)]
    ]
    assert wrong == []


def test_the_reading_of_imports_sees_them():
    text = (
        "from navirl_cli.irl.fit import fit\nimport navirl_cli.logs.load\n"
        "from navirl_cli import __version__, files, logs\n"
        "from navirl_cli.logs import recording\nfrom navirl_cli.logs.tf.tree import TransformTree"
    )
    assert imported_rooms(ast.parse(text)) == {"irl", "logs", "__init__", "files"}
    assert imported_rooms(ast.parse(text), "navirl_cli.logs") == {"load", "recording", "tf"}


def at_run_time(tree: ast.Module) -> list[ast.stmt]:
    """The statements of a file but those for type checkers."""
    return [one for one in tree.body if not (isinstance(one, ast.If) and ast.unparse(one.test) == "TYPE_CHECKING")]


def test_only_figures_know_matplotlib_only_the_command_line_knows_click_and_logs_know_no_scipy():
    for path in PACKAGE.rglob("*.py"):
        modules = {
            (node.module or "").split(".")[0] if isinstance(node, ast.ImportFrom) else node.names[0].name.split(".")[0]
            for statement in at_run_time(ast.parse(path.read_text(encoding="utf-8")))
            for node in ast.walk(statement)
            if isinstance(node, ast.Import | ast.ImportFrom)
        }
        if room_of(path) != "figures":
            assert "matplotlib" not in modules, path
        if room_of(path) not in {"cli", "commands"}:
            assert "click" not in modules, path
        if room_of(path) == "logs":
            # importing it takes longer than reading a small log
            assert "scipy" not in modules, path
