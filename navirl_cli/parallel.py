"""Parallel work over many logs or fits, through one function that takes any executor."""

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import partial
from threading import Thread
from types import FrameType
from typing import TypeVar

#: A worker whose parent is gone has this long to clean up, s.
_GRACE_S = 2.0

Item = TypeVar("Item")
Result = TypeVar("Result")


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def map_in_order(
    function: Callable[[Item], Result], items: Sequence[Item], executor: Executor | None = None
) -> Iterator[Result]:
    """Apply a function to every item, in other processes if that can be faster, and yield results in order.

    Args:
        function: Importable by name. Its arguments and results are passed between processes.
        items: The arguments.
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
        from concurrent.futures import ProcessPoolExecutor  # which imports multiprocessing

        with ProcessPoolExecutor(workers, initializer=_Worker.listen) as pool:
            try:
                with _no_interrupt():  # Python loses an interrupt that comes while a process forks
                    results = pool.map(partial(_Worker.run, function), items)
                yield from results
            except BaseException:
                _Worker.interrupt_all()
                raise


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Delay interrupts until the block ends. Processes that begin in it delay them until they handle them."""
    if not hasattr(signal, "pthread_sigmask"):  # as on Windows, which does not fork either
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Worker:
    """Interrupts of a local process: the present item is cleaned up, and no other item begins.

    Without this, waiting processes print a traceback, and working processes continue until they are done.
    """

    busy = False
    stopped = False

    @classmethod
    def listen(cls) -> None:
        """Handle interrupts and the end of the parent from now on, in a new process."""
        Thread(target=cls._follow_parent, daemon=True).start()
        signal.signal(signal.SIGINT, cls._interrupted)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

    @classmethod
    def run(cls, function: Callable[[Item], Result], item: Item) -> Result:
        """Process an item, unless there was an interrupt."""
        if cls.stopped:
            raise KeyboardInterrupt
        cls.busy = True
        try:
            return function(item)
        finally:
            cls.busy = False

    @classmethod
    def _follow_parent(cls) -> None:
        """End with the parent, even if it was killed: nobody waits for the results."""
        from multiprocessing import parent_process

        parent = parent_process()
        if parent is None:
            return
        parent.join()
        if cls.busy:  # the present item is cleaned up
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(_GRACE_S)
        os._exit(1)

    @classmethod
    def _interrupted(cls, _number: int, _frame: FrameType | None) -> None:
        again, cls.stopped = cls.stopped, True
        if cls.busy and not again:  # a second one would interrupt the clean-up after the first
            raise KeyboardInterrupt

    @staticmethod
    def interrupt_all() -> None:
        """Interrupt the workers of this process. A terminal sends Ctrl-C only to its foreground processes."""
        from multiprocessing import active_children

        for child in active_children():
            if os.name == "posix" and child.pid is not None:
                os.kill(child.pid, signal.SIGINT)
