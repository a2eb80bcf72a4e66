"""Files that appear whole or not at all."""

import pickle

import pytest

from navirl_cli.errors import ArtefactError
from navirl_cli.files import replacing
from navirl_cli.irl.series import InfinitePartitionError, ValueStatus
from navirl_cli.parallel import map_in_order


def test_what_a_link_names_is_replaced_not_the_link(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    with replacing(link, force=True) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_an_exception_leaves_nothing(tmp_path):
    def interrupted():
        with replacing(tmp_path / "x", force=False) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_a_file_below_a_file_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(ArtefactError, match="cannot be written: Not a directory"),
        replacing(tmp_path / "file" / "x", force=False),
    ):
        pass


def test_errors_and_results_cross_process_borders():
    error = pickle.loads(pickle.dumps(InfinitePartitionError(ValueStatus.INFINITE)))
    assert error.status is ValueStatus.INFINITE
    assert str(error) == str(InfinitePartitionError(ValueStatus.INFINITE))
    assert list(map_in_order(abs, [-3, 2, -1])) == [3, 2, 1]
