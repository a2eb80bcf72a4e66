"""The same results through every executor, also when a process is killed."""

import ctypes
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from jobs import double, killed, raising_at_three, share

from navirl_cli.errors import ArgumentError, MissingPackageError, WorkerLostError
from navirl_cli.parallel import Local, as_completed, cores, keep_freed_memory, map_in_order


@pytest.mark.parametrize("executor", [None, Local(1), Local(2), ThreadPoolExecutor(3)])
def test_results_are_in_order_whatever_works(executor):
    assert list(map_in_order(double, list(range(30)), executor)) == list(range(0, 60, 2))
    assert {n: one.result() for n, one in as_completed(double, [4, 5], executor)} == {0: 8, 1: 10}
    with pytest.raises(ValueError, match="three"):
        list(map_in_order(raising_at_three, list(range(9)), executor))


def test_what_was_begun_with_a_killed_process_is_done_again(tmp_path):
    jobs = [(number, tmp_path / "mark") for number in range(12)]
    assert list(map_in_order(killed, jobs, Local(2))) == list(range(12))


def test_an_item_that_kills_its_process_twice_is_lost_and_no_other():
    found = dict(as_completed(killed, [(number, None) for number in range(12)], Local(2)))
    assert sorted(found) == list(range(12))
    lost = found.pop(5)
    assert [found[number].result() for number in sorted(found)] == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]
    with pytest.raises(WorkerLostError, match="expected a result, found that the process ended twice"):
        lost.result()


def test_processes_share_the_cores():
    assert set(map_in_order(share, [1, 2, 3], Local(cores() + 1))) == {1}


def test_dask_that_is_not_installed_is_named_with_its_remedy(monkeypatch):
    from navirl_cli.cluster import workers_of

    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with (
        pytest.raises(MissingPackageError, match=r"install it: pip install 'navirl\[cluster\]'"),
        workers_of(None, "x"),
    ):
        pass
    with pytest.raises(ArgumentError, match="`workers` and `cluster` exclude each other"), workers_of(2, "x"):
        pass


FAULTS = """
import resource, sys
import numpy as np
from navirl_cli.parallel import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
for _ in range(200):
    held = [np.ones(500_000) for _ in range(8)]
    del held
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library than glibc")
def test_freed_memory_is_kept_for_the_next_arrays():
    words = [sys.executable, "-c", FAULTS]
    given, kept = (int(subprocess.check_output([*words, how])) for how in ("given", "kept"))
    assert kept < given / 10


def test_another_c_library_is_left_alone(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda _name: object())
    keep_freed_memory()
