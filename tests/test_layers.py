"""Rooms stand in the order in which the data walks, and import only from rooms below them."""

import ast
from pathlib import Path

import navirl_cli

PACKAGE = Path(navirl_cli.__file__).parent
#: From the bottom up; rooms of one line do not know each other.
ORDER = [
    ["__init__", "arrays", "errors"],
    ["files", "parallel", "documents"],
    ["logs"],
    ["demos"],
    ["irl"],
    ["evaluation"],
    ["study", "simulation", "published"],
    ["artefacts"],
    ["reports"],
    ["figures"],
    ["commands"],
    ["cli"],
    ["__main__"],
]
LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_rooms(tree: ast.AST) -> set[str]:
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "navirl_cli":
            if node.module == "navirl_cli":
                names |= {alias.name if (PACKAGE / f"{alias.name}.py").exists() else "__init__" for alias in node.names}
            else:
                names.add(node.module.split(".")[1])
        elif isinstance(node, ast.Import):
            names |= {alias.name.split(".")[1] for alias in node.names if alias.name.startswith("navirl_cli.")}
    return names


def test_every_room_has_its_place():
    assert {room_of(path) for path in PACKAGE.rglob("*.py")} == set(LEVEL)


def test_rooms_import_only_from_below():
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {other}"
        for path in PACKAGE.rglob("*.py")
        for other in imported_rooms(ast.parse(path.read_text(encoding="utf-8")))
        if other != room_of(path) and LEVEL[other] >= LEVEL[room_of(path)]
    ]
    assert wrong == []


def test_the_reading_of_imports_sees_them():
    text = "from navirl_cli.irl.fit import fit\nimport navirl_cli.logs.load\nfrom navirl_cli import __version__, files"
    assert imported_rooms(ast.parse(text)) == {"irl", "logs", "__init__", "files"}


def test_only_figures_know_matplotlib_and_only_the_command_line_knows_click():
    for path in PACKAGE.rglob("*.py"):
        modules = {
            (node.module or "").split(".")[0] if isinstance(node, ast.ImportFrom) else node.names[0].name.split(".")[0]
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Import | ast.ImportFrom)
        }
        if room_of(path) != "figures":
            assert "matplotlib" not in modules, path
        if room_of(path) not in {"cli", "commands"}:
            assert "click" not in modules, path
