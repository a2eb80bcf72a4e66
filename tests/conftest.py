"""What several test modules ask for."""

import os

import pytest
from click.testing import CliRunner

from navirl_cli.cli import cli

# As the command line does, before numpy is imported: the threads of a BLAS double the CPU time of small matrices.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


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
