"""Files that appear whole or not at all."""

import os
import pickle
import subprocess
import sys

import pytest

from navirl_cli.errors import ArtefactError
from navirl_cli.files import new_folder, replacing, swapped_folder
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


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_appears_meanwhile_stays_without_force(tmp_path, monkeypatch, links):
    def no_links(*_):
        raise PermissionError(1, "Operation not permitted")

    if not links:
        monkeypatch.setattr("os.link", no_links)

    def overtaken():
        with replacing(tmp_path / "x", force=False) as temporary:
            temporary.write_text("mine")
            (tmp_path / "x").write_text("another's")

    with pytest.raises(ArtefactError, match="x: exists already; choose another name, or replace it with `force`"):
        overtaken()
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
    assert (tmp_path / "x").read_text() == "another's"
    with replacing(tmp_path / "y", force=False) as temporary:
        temporary.write_text("mine")
    assert (tmp_path / "y").read_text() == "mine"
    assert {path.name for path in tmp_path.iterdir()} == {"x", "y"}


def test_names_of_255_bytes_are_written(tmp_path):
    name = "n" * 250 + ".json"
    with replacing(tmp_path / name, force=False) as temporary:
        temporary.write_text("text")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def dead_process():
    """The number of a process that has ended."""
    done = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    return int(done.stdout)


def test_only_temporary_files_of_dead_processes_of_this_machine_are_removed(tmp_path):
    with replacing(tmp_path / "x", force=False) as temporary:
        temporary.write_text("")
        own = temporary.name
    stale, other = own.replace(str(os.getpid()), str(dead_process())), own.replace(own.split("-")[1], "0" * 8)
    living = own.replace(str(os.getpid()), str(os.getppid()))
    for name in (stale, other, living, ".navirl-notes.tmp"):
        (tmp_path / name).write_text("")
    with replacing(tmp_path / "y", force=False) as temporary:
        temporary.write_text("")
    assert {path.name for path in tmp_path.iterdir()} == {"x", "y", other, living, ".navirl-notes.tmp"}


def test_a_folder_is_swapped_as_a_whole_and_keeps_what_is_not_ours(tmp_path):
    folder = tmp_path / "results"
    for content in ("old", "new"):
        with swapped_folder(folder) as new:
            assert new != folder
            (new / "figures").mkdir()
            (new / "figures" / "a.png").write_text(content)
            (new / f"only {content}").write_text("")
            if content == "new":
                assert (folder / "figures" / "a.png").read_text() == "old"
    assert (folder / "figures" / "a.png").read_text() == "new"
    assert {path.name for path in folder.iterdir()} == {"figures", "only old", "only new"}
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_a_failure_leaves_the_older_folder(tmp_path):
    folder = tmp_path / "results"
    with swapped_folder(folder) as new:
        (new / "a").write_text("old")

    def interrupted():
        with swapped_folder(folder) as new:
            (new / "a").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert (folder / "a").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_a_folder_that_cannot_be_renamed_gets_its_files_one_by_one(tmp_path, monkeypatch):
    folder = tmp_path / "mounted"
    folder.mkdir()
    (folder / "a").write_text("old")
    monkeypatch.setattr("pathlib.Path.is_mount", lambda path: path == folder)
    with swapped_folder(folder) as new:
        assert new.parent == folder
        (new / "figures").mkdir()
        (new / "figures" / "b").write_text("new")
        (new / "a").write_text("new")
    assert (folder / "a").read_text() == "new"
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*")} == {"a", "figures", "figures/b"}
