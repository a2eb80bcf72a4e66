"""Files that appear whole or not at all."""

import pickle

import pytest

from navirl_cli.errors import ArtefactError
from navirl_cli.files import new_folder, replacing
from navirl_cli.irl.series import InfinitePartitionError, ValueStatus
from navirl_cli.parallel import map_in_order


def test_the_target_of_a_link_is_replaced_not_the_link(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    with replacing(link, force=True) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_an_exception_leaves_no_file(tmp_path):
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


@pytest.mark.parametrize("error", [KeyboardInterrupt, ArtefactError])
def test_a_new_folder_stays_only_with_something_in_it(tmp_path, error):
    def stopped(*, after_writing):
        with new_folder(tmp_path / "a" / "b") as folder:
            if after_writing:
                (folder / "x").write_text("")
            raise error

    for after_writing, left in ((False, []), (True, ["a", "a/b", "a/b/x"])):
        with pytest.raises(error):
            stopped(after_writing=after_writing)
        assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")) == left


def test_a_folder_that_was_there_stays_though_it_is_empty(tmp_path):
    with new_folder(tmp_path / "mine") as folder:
        folder.joinpath("x").write_text("")
    (tmp_path / "mine" / "x").unlink()
    with new_folder(tmp_path / "mine"):
        pass
    assert (tmp_path / "mine").is_dir()


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    for path, reason in ((tmp_path / "file", "File exists"), (tmp_path / "file" / "x", "Not a directory")):
        with pytest.raises(ArtefactError, match=f"cannot be made a folder: {reason}"), new_folder(path):
            pass


def test_errors_and_results_are_passed_between_processes():
    error = pickle.loads(pickle.dumps(InfinitePartitionError(ValueStatus.INFINITE)))
    assert error.status is ValueStatus.INFINITE
    assert str(error) == str(InfinitePartitionError(ValueStatus.INFINITE))
    assert list(map_in_order(abs, [-3, 2, -1])) == [3, 2, 1]
