"""What several test modules ask for."""

import os

import pytest
from click.testing import CliRunner

from navirl_cli.cli import cli

# As the command line does, before numpy is imported: the threads of a BLAS double the CPU time of small matrices.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

#: Files of many seconds. A process has all tests of a file, which share its fixtures; so these begin first.
LONG = {
    "test_api.py",
    "test_docs.py",
    "test_every_term.py",
    "test_report_command.py",
    "test_reproduction.py",
    "test_study_command.py",
    "test_values.py",
    "test_watch.py",
}


def pytest_collection_modifyitems(items):
    """Put the tests of long files first, so that no process begins one when the others are done.

    Those that import obstore are last: beside it, processes do not begin as copies, which takes a second for each.
    """
    items.sort(key=lambda item: (item.path.name == "test_remote.py", item.path.name not in LONG))


@pytest.fixture
def navirl(tmp_path, monkeypatch):
    """Run navirl in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*words, code=0):
        result = CliRunner().invoke(cli, [str(word) for word in words])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == code, result.output
        return result

    return run
