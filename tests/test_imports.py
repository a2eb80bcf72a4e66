"""Which heavy modules each command imports: most of a command's start is imports, so that a new one is a decision."""

import subprocess
import sys
from pathlib import Path

import pytest

LOG = Path(__file__).parent.parent / "sample_logs" / "p01.mcap"
HEAVY = {
    *("numpy", "scipy.sparse", "scipy.special", "scipy.signal", "scipy.stats", "scipy.spatial", "scipy.ndimage"),
    *("scipy.optimize", "scipy.interpolate", "shapely", "matplotlib", "matplotlib.pyplot", "PIL", "pandas"),
    *("multiprocessing", "concurrent.futures.process", "rosbags", "mcap", "ruamel.yaml", "jsonschema"),
}
#: A command's words, and all that it may import of HEAVY.
ALLOWED = {
    "--help": set(),
    "plot --help": set(),
    "inspect LOG": {"numpy", "rosbags"},
    "extract LOG -o new.json --gain": {"numpy", "rosbags"},
    "fit demos.json --cycle 2 -o new.json": {"numpy", "scipy.sparse"},
    "evaluate demos.json": {"numpy", "scipy.sparse", "scipy.special", "shapely"},
    "evaluate demos.json --reward reward.json --metrics all": {"numpy", "scipy.sparse", "scipy.special", "shapely"},
    "plot paths demos.json -o new.png": {"numpy", "matplotlib", "PIL"},
    "plot policy demos.json --reward reward.json -o new.png": {"numpy", "scipy.sparse", "matplotlib", "PIL"},
    "plot convergence reward.json -o new.png": {"numpy", "matplotlib", "PIL"},
}


def run(folder, words):
    code = f"import sys\nfrom navirl_cli.cli import cli\ncli({words}, standalone_mode=False)\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("imports")
    run(folder, ["extract", str(LOG), "-o", "demos.json"])
    run(folder, ["fit", "demos.json", "--cycle", "2", "--intervals", "wald", "-o", "reward.json"])
    return folder


@pytest.mark.parametrize("line", ALLOWED)
def test_a_command_imports_no_more_heavy_modules_than_it_needs(folder, line):
    words = [str(LOG) if word == "LOG" else word for word in line.split()]
    found = run(folder, [*words, "--force"] if "-o" in words else words)
    assert "click" in found
    assert HEAVY & found <= ALLOWED[line]
