"""Where the public functions work, and how they warn."""

import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager

from navirl_cli.api.arguments import (
    within,
)
from navirl_cli.cluster import workers_of
from navirl_cli.errors import ArgumentError, NavirlWarning
from navirl_cli.parallel import cores


def warn(lines: Sequence[str], depth: int = 3) -> None:
    """Warn of what is lost, at the line of the user's call, which is so many calls up."""
    for line in lines:
        warnings.warn(line, NavirlWarning, stacklevel=depth)


@contextmanager
def executor_of(executor: Executor | None, workers: int | None, cluster: str | None) -> Iterator[Executor]:
    """Where to work: by default in threads. Processes that cannot fork would run the user's script again."""
    if sum(one is not None for one in (executor, workers, cluster)) > 1:
        raise ArgumentError("`workers`, `cluster` and `executor` exclude each other: name one of them")
    if executor is not None:
        yield executor
    elif workers is not None or cluster is not None:
        count = None if workers is None else int(within("workers", workers, 1, 4096))
        with workers_of(count, cluster) as own:
            yield own
    else:
        with ThreadPoolExecutor(cores()) as own:
            yield own
