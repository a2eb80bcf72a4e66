"""Work over many logs or fits, through one function that any executor can stand behind."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def map_in_order(
    function: Callable[[Item], Result], items: Sequence[Item], executor: Executor | None = None
) -> Iterator[Result]:
    """Apply a function to every item, in other processes where that can pay, and yield results in order.

    Args:
        function: Importable by name; what it takes and returns crosses process borders.
        items: The work.
        executor: Where to run; by default local processes, or this process for a single item.

    Yields:
        Results in the order of the items.
    """
    workers = min(len(items), cores())
    if executor is not None:
        yield from executor.map(function, items)
    elif workers < 2:
        yield from map(function, items)
    else:
        with ProcessPoolExecutor(workers) as pool:
            yield from pool.map(function, items)
