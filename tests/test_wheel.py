"""An installed wheel in an empty environment runs navirl fully: it carries its schemas and names its dependencies."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.mark.slow
def test_an_installed_wheel_goes_from_log_to_figure(tmp_path):
    def run(*words):
        return subprocess.run([str(word) for word in words], cwd=tmp_path, check=True, capture_output=True, text=True)

    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check")
    run(*pip, "wheel", "--no-deps", "--wheel-dir", tmp_path / "dist", ROOT)
    run(sys.executable, "-m", "venv", tmp_path / "env")
    run(tmp_path / "env" / "bin" / "pip", "install", *(tmp_path / "dist").glob("*.whl"))
    navirl = tmp_path / "env" / "bin" / "navirl"
    typed = (
        "import navirl_cli; from pathlib import Path; print(Path(navirl_cli.__file__).with_name('py.typed').exists())"
    )
    assert run(tmp_path / "env" / "bin" / "python", "-c", typed).stdout == "True\n"
    run(navirl, "extract", ROOT / "sample_logs" / "p01.mcap", "-o", "demos.json")
    run(navirl, "fit", "demos.json", "--cycle", "2", "-o", "reward.json")
    run(navirl, "evaluate", "demos.json", "--reward", "reward.json", "-o", "metrics.json")
    run(navirl, "plot", "policy", "demos.json", "--reward", "reward.json", "-o", "policy.pdf")
    run(navirl, "study", ROOT / "sample_logs" / "p01.mcap", "-o", "study")
    run(navirl, "simulate", "-o", "logs", "--participants", "1")
    assert (tmp_path / "policy.pdf").read_bytes().startswith(b"%PDF")
    assert "</html>" in (tmp_path / "study" / "report.html").read_text()
