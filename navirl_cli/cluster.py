"""Workers of a running Dask scheduler as an executor.

The function of a work is a task of its own: it goes to each worker once, stays there with all that it has computed and
kept, and is made again when its worker is lost. Items and results are all that travels besides.
"""

import logging
import os
import pickle
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, wait
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from typing import Any, Final, TypeVar

import navirl_cli
from navirl_cli.errors import ArgumentError, MissingPackageError, NavirlError, WorkerLostError
from navirl_cli.parallel import Local, Submit, sharing
from navirl_cli.teams import Argument, Ask, Part, of_share

#: A scheduler that does not answer within this time is not there, s.
_TIMEOUT_S: Final = 10
#: Packages on whose versions results or messages between machines depend.
_PACKAGES: Final = ("numpy", "scipy", "distributed")
#: Environment variables that begin so are settings of navirl, and hold for workers too.
_SETTINGS: Final = "NAVIRL_"
#: Items that a scheduler is given before the first is done: enough for some hundred workers.
_AHEAD: Final = 4096

Item = TypeVar("Item")
Result = TypeVar("Result")


class Held:
    """A function on a worker.

    Args:
        pickled: The function.
        settings: Environment variables.
    """

    def __init__(self, pickled: bytes, settings: Mapping[str, str]) -> None:
        os.environ.update(settings)
        self.function: Callable[[Any], Any] = pickle.loads(pickled)  # noqa: S301 - from the client, which chose the code
        self._size = len(pickled)

    def __sizeof__(self) -> int:
        """Bytes that would travel: Dask leaves large data where they are."""
        return self._size


def run(held: Held, item: Any) -> Any:
    """Apply the function to an item, on one core: a worker has a thread for each."""
    return sharing(held.function, 1, item)


class Cluster(Executor):
    """Workers of a scheduler.

    Args:
        client: A Dask client.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._executor = client.get_executor(pure=False)

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> "Future[Result]":
        """As an executor does."""
        future: Future[Result] = self._executor.submit(fn, *args, **kwargs)
        return future

    @contextmanager
    def holding(self, function: Callable[[Item], Result], count: int) -> Iterator[tuple[Submit[Item, Result], int]]:
        """As in :class:`navirl_cli.parallel.Holding`."""
        held = self._client.submit(Held, pickle.dumps(function), _settings(), pure=False)
        yield lambda item: _explained(self._executor.submit(run, held, item)), min(count, _AHEAD)

    @property
    def size(self) -> int:
        """As in :class:`navirl_cli.teams.Keeping`."""
        return sum(self._client.nthreads().values())

    @contextmanager
    def keeping(
        self, function: Callable[[Part, Argument], Result], shares: Sequence[Sequence[Part]]
    ) -> Iterator[Ask[Argument, Result]]:
        """As in :class:`navirl_cli.teams.Keeping`; the scheduler makes a share again when its worker is lost."""
        seats = [address for address, threads in self._client.nthreads().items() for _ in range(threads)]
        held = [
            self._client.submit(
                Held,
                pickle.dumps(partial(of_share, function, share)),
                _settings(),
                pure=False,
                workers=[seats[number % len(seats)]],
                allow_other_workers=True,
            )
            for number, share in enumerate(shares)
        ]

        def ask(argument: Argument) -> list[Result]:
            futures = [_explained(self._executor.submit(run, own, argument)) for own in held]
            wait(futures)
            return [result for future in futures for result in future.result()]

        yield ask


def _settings() -> dict[str, str]:
    """Environment variables that hold for workers too."""
    return {name: value for name, value in os.environ.items() if name.startswith(_SETTINGS)}


def _explained(future: "Future[Result]") -> "Future[Result]":
    """A future whose errors of Dask are those of navirl."""
    told: Future[Result] = Future()

    def copy(done: "Future[Result]") -> None:
        if not told.set_running_or_notify_cancel():
            return
        if done.cancelled():
            told.set_exception(NavirlError("`cluster`: expected the scheduler to answer, found that it went away"))
        elif (error := done.exception()) is None:
            told.set_result(done.result())
        else:
            told.set_exception(_lost(error) if type(error).__name__ == "KilledWorker" else error)

    future.add_done_callback(copy)
    told.add_done_callback(lambda _: future.cancel() if told.cancelled() else None)
    return told


def _lost(error: BaseException) -> WorkerLostError:
    """What Dask knows of a task that ended several workers."""
    last = getattr(getattr(error, "last_worker", None), "address", "unknown")
    return WorkerLostError(
        f"expected a result, found that {getattr(error, 'allowed_failures', 0) + 1} workers ended that worked on this, "
        f"the last one at {last}: they were killed, mostly because memory ran out, or they crashed; see their logs"
    )


@contextmanager
def workers_of(workers: int | None, cluster: str | None) -> Iterator[Executor]:
    """The executor of a command: local processes, or the workers of a scheduler.

    Args:
        workers: Number of local processes; None for one for each core.
        cluster: Address of a scheduler, in place of them.

    Raises:
        ArgumentError: Both are given, or as in :func:`connected`.
        MissingPackageError: As in :func:`connected`.
    """
    if cluster is None:
        yield Local(workers)
        return
    if workers is not None:
        raise ArgumentError(
            "`workers` and `cluster` exclude each other: a scheduler has its own workers; leave out `workers`"
        )
    with connected(cluster) as executor:
        yield executor


@contextmanager
def connected(address: str) -> Iterator[Executor]:
    """The workers of a running scheduler.

    Args:
        address: As "tcp://10.0.0.1:8786".

    Raises:
        MissingPackageError: Dask is not installed.
        ArgumentError: No scheduler answers, it has no workers, or their versions are not those of this process.
    """
    try:
        import dask
        from distributed import Client
    except ImportError as error:
        raise MissingPackageError(
            "`cluster`: expected the package distributed, found that it is not installed; "
            "install it: pip install 'navirl[cluster]'"
        ) from error
    # what a fit needs may be large, and travels once
    with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1GB"}):
        try:
            client: Any = Client(  # type: ignore[no-untyped-call]
                address, timeout=_TIMEOUT_S, set_as_default=False, name="navirl"
            )
        except (OSError, ValueError, TypeError) as error:
            raise ArgumentError(
                f"`cluster`: expected the address of a running scheduler, found {address!r}: {error}; "
                "start one by `dask scheduler` and workers by `dask worker ADDRESS`"
            ) from error
        # of tasks that are cancelled after an error or Ctrl-C, Dask logs that they cannot be set any more
        logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
        with client:
            check(versions(), client.run(versions, on_error="return"), address)
            yield Cluster(client)


def check(own: Mapping[str, str], found: Mapping[str, Any], address: str) -> None:
    """Refuse workers whose results might differ.

    Args:
        own: Versions by package.
        found: The same by worker, or why it could not be asked.
        address: The scheduler.

    Raises:
        ArgumentError: There is no worker, or one has another version.
    """
    if not found:
        raise ArgumentError(
            f"`cluster`: expected workers of {address}, found none; start some by `dask worker {address}`"
        )
    for worker, theirs in found.items():
        if isinstance(theirs, Exception):  # as where navirl is not installed, or is too old to be asked
            raise ArgumentError(
                f"`cluster`: expected workers with navirl {own['navirl']} as here, found: {theirs} at {worker}; "
                "install the same version there"
            )
        for name, other in theirs.items():
            if other != own[name]:
                raise ArgumentError(
                    f"`cluster`: expected workers with {name} {own[name]} as here, found {name} {other} at "
                    f"{worker}; install the same versions"
                )


def versions() -> dict[str, str]:
    """Versions on which results, or messages between machines, depend."""
    found = {"navirl": navirl_cli.__version__, "python": ".".join(platform.python_version_tuple()[:2])}
    return found | {name: version(name) for name in _PACKAGES}
