"""Work on a Dask cluster: scheduler and workers are processes on loopback."""

import json
import time
from contextlib import ExitStack
from importlib.util import find_spec
from threading import Thread

import numpy as np
import pytest
from click.testing import CliRunner
from dask_scheduler import scheduler
from factories import drawn, random_scene
from fleet_logs import SAMPLES, copies
from jobs import killed, signed, slow_double

from navirl_cli import cluster
from navirl_cli.cli import cli
from navirl_cli.cluster import connected
from navirl_cli.errors import ArgumentError, WorkerLostError
from navirl_cli.irl import evidence as evidence_room
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import likelihood
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.parallel import as_completed, map_in_order
from navirl_cli.teams import team

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="needs navirl[cluster]")


def invoked(*words):
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code in {0, 3}, result.output
    return result


def test_a_scheduler_that_is_not_there_is_named():
    before, cluster._TIMEOUT_S = cluster._TIMEOUT_S, 0.2
    try:
        with (
            pytest.raises(
                ArgumentError, match=r"expected the address of a running scheduler, found 'tcp://127\.0\.0\.1:9'"
            ),
            connected("tcp://127.0.0.1:9"),
        ):
            pass
    finally:
        cluster._TIMEOUT_S = before


@pytest.fixture(scope="module")
def address():
    """A scheduler and two workers in threads of this process: the same messages, without the start of processes."""
    import distributed

    with distributed.LocalCluster(
        n_workers=2, processes=False, protocol="tcp", threads_per_worker=1, dashboard_address=":0"
    ) as own:
        yield own.scheduler_address


def test_logs_give_the_same_demonstrations(address, tmp_path):
    here, there = tmp_path / "here.json", tmp_path / "there.json"
    invoked("extract", *SAMPLES[:2], "-o", here, "--workers", 1)
    invoked("extract", *SAMPLES[:2], "-o", there, "--cluster", address)
    assert there.read_bytes() == here.read_bytes()


def test_workers_keep_parts_and_answer_in_order(address):
    with connected(address) as executor:
        executor._client.wait_for_workers(2)
        assert executor.size == 2
        with team(executor, signed, range(7), [1.0] * 7) as ask:
            assert [part for part, _ in ask((None, None))] == list(range(7))
            with pytest.raises(ValueError, match="part 3"):
                ask((3, None))
            assert ask((None, None)) == ask((None, None))


def test_sums_over_scenes_at_workers_are_those_of_this_process(address, monkeypatch):
    monkeypatch.setattr(evidence_room, "ENOUGH_CELLS", 0)
    reward, rng = Reward((-50.0, -0.5, -4.0, 1.5)), np.random.default_rng(2)
    many = evidence_of([one for seed in range(20) for one in drawn(random_scene(rng, 7, 6, 0.1), reward, 1, seed)])
    with connected(address) as executor:
        executor._client.wait_for_workers(2)
        with many.kept_by(executor) as kept:
            assert kept.ask is not None
            assert likelihood(kept, reward) == likelihood(many, reward)
            with pytest.raises(InfinitePartitionError):
                likelihood(kept, Reward((-0.1, -0.01, -0.1, 1.5)))


def test_other_versions_are_refused():
    own = cluster.versions()
    cluster.check(own, {"tcp://one": own}, "tcp://host")
    said = r"expected workers with navirl \S+ as here, found navirl 0\.0\.1 at tcp://two; install the same versions$"
    with pytest.raises(ArgumentError, match=said):
        cluster.check(own, {"tcp://one": own, "tcp://two": {**own, "navirl": "0.0.1"}}, "tcp://host")
    with pytest.raises(
        ArgumentError, match="found: No module named 'navirl_cli' at tcp://one; install the same version"
    ):
        cluster.check(own, {"tcp://one": ModuleNotFoundError("No module named 'navirl_cli'")}, "tcp://host")
    with pytest.raises(ArgumentError, match=r"expected workers of tcp://host, found none; start some by `dask worker"):
        cluster.check(own, {}, "tcp://host")


@pytest.mark.slow
def test_forty_logs_and_a_fit_are_the_same_from_other_processes(tmp_path):
    logs = copies(tmp_path, 40)
    demos, there = tmp_path / "demos.json", tmp_path / "there.json"
    rewards = tmp_path / "reward.json", tmp_path / "reward_there.json"
    fit = ("--bootstrap", 20, "--cross-validate", "participant", "--intervals", "wald")
    with scheduler() as (address, _):
        invoked("extract", *logs, "-o", demos, "--workers", 1)
        invoked("extract", *logs, "-o", there, "--cluster", address)
        assert there.read_bytes() == demos.read_bytes()
        invoked("fit", demos, *fit, "-o", rewards[0], "--workers", 1)
        invoked("fit", demos, *fit, "-o", rewards[1], "--cluster", address)
    assert json.loads(rewards[1].read_text()) == json.loads(rewards[0].read_text())


@pytest.mark.slow
def test_a_killed_worker_changes_nothing_and_a_killing_item_is_lost():
    with scheduler(workers=5) as (address, workers), connected(address) as executor:
        Thread(target=lambda: (time.sleep(0.5), workers[0].kill())).start()
        assert list(map_in_order(slow_double, list(range(300)), executor)) == list(range(0, 600, 2))
        found = dict(as_completed(killed, [(number, None) for number in range(12)], executor))
        with pytest.raises(WorkerLostError, match="2 workers ended that worked on this"):
            found.pop(5).result()
        assert [found[number].result() for number in sorted(found)] == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]


@pytest.mark.slow
def test_parts_of_a_killed_worker_are_made_again():
    with scheduler(workers=3) as (address, workers), connected(address) as executor, ExitStack() as stack:
        executor._client.wait_for_workers(3)
        ask = stack.enter_context(team(executor, signed, range(30), [1.0] * 30))
        before = ask((None, None))
        assert len({process for _, process in before}) == len(workers)
        assert ask((None, None)) == before
        workers[0].kill()
        workers[0].wait()
        after = ask((None, None))
        assert [part for part, _ in after] == list(range(30))
        assert workers[0].pid not in {process for _, process in after}
