"""The same work over many items, through any concurrent.futures Executor.

Local processes end with their parent, take the function once, and are replaced when one of them is killed: an item that
kills its process a second time, alone, is lost, and the others are not. Results do not depend on the executor or on the
order in which items are done.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from queue import SimpleQueue
from threading import Thread
from types import FrameType
from typing import Any, Final, ParamSpec, Protocol, TypeVar, runtime_checkable

from navirl_cli.errors import WorkerLostError

#: A worker whose parent is gone has this long to clean up, s.
_GRACE_S: Final = 2.0
#: Signals after which a command cleans up.
_DELAYED: Final = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
#: Items that are handed to an executor of unknown size before the first of them is done.
_AHEAD: Final = 1000

Item = TypeVar("Item")
Result = TypeVar("Result")
P = ParamSpec("P")
#: Starts the work on an item.
Submit = Callable[[Item], Future[Result]]

#: M_TRIM_THRESHOLD and M_MMAP_THRESHOLD of mallopt(3), bytes.
_KEPT = ((-1, 128 << 20), (-3, 32 << 20))
#: Cores for the present work, where several works share a machine.
_share: ContextVar[int | None] = ContextVar("share", default=None)


def cores() -> int:
    """Number of cores that the present work may use."""
    own = _share.get()
    if own is not None:
        return own
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def keep_freed_memory() -> None:
    """Let this process, and those forked from it, keep up to 128 MB of freed memory for the next arrays.

    Every evaluation of a likelihood frees arrays of some hundred kB. The C library gives such memory back to the system
    and asks for it again at once, which is a tenth of a fit's time. Does nothing where it is not glibc (mallopt(3)).
    """
    import ctypes

    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return
    for parameter, size in _KEPT:
        mallopt(parameter, size)


def sharing(function: Callable[P, Result], count: int, /, *args: P.args, **kwargs: P.kwargs) -> Result:
    """Call a function that may use so many cores."""
    token = _share.set(count)
    try:
        return function(*args, **kwargs)
    finally:
        _share.reset(token)


@runtime_checkable
class Holding(Protocol):
    """An executor that keeps the function with its workers, so that only items and results travel."""

    def holding(
        self, function: Callable[[Item], Result], count: int
    ) -> AbstractContextManager[tuple[Submit[Item, Result], int]]:
        """Give the function to the workers.

        Args:
            function: The work.
            count: Number of items to come.

        Returns:
            A context manager of the function that starts the work on an item, and the number of items that it should
            be given before the first of them is done.
        """
        ...


class Local(Executor):
    """Processes of this machine; they start with each work and end with it.

    Args:
        workers: Number of processes; None for one for each core.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or cores()

    def submit(self, fn: Callable[P, Result], /, *args: P.args, **kwargs: P.kwargs) -> "Future[Result]":
        """Work on one item in this process: to start another one for it takes longer."""
        future: Future[Result] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - whoever asks for the result gets it
            future.set_exception(error)
        return future

    @contextmanager
    def holding(self, function: Callable[[Item], Result], count: int) -> Iterator[tuple[Submit[Item, Result], int]]:
        """As in :class:`Holding`; a single item or worker stays in this process."""
        workers = min(count, self.workers)
        if workers < 2:
            yield lambda item: self.submit(function, item), 1
            return
        with self.processes(function, workers) as submit:
            yield submit, 2 * workers

    @contextmanager
    def processes(self, function: Callable[[Item], Result], workers: int) -> Iterator[Submit[Item, Result]]:
        """Start processes, and end them when the block ends."""
        from concurrent.futures import ProcessPoolExecutor  # which imports multiprocessing

        share = max(1, cores() // workers)
        begin = (function, share)
        with ProcessPoolExecutor(workers, context(), initializer=_Worker.listen, initargs=begin) as pool:

            def submit(item: Item) -> "Future[Result]":
                with _no_interrupt():  # Python loses an interrupt that comes while a process forks
                    return pool.submit(_Worker.run, item)

            try:
                yield submit
            except BaseException:
                _Worker.interrupt_all()
                raise

    def alone(self, function: Callable[[Item], Result], item: Item) -> "Future[Result]":
        """The future of an item that gets a process of its own, done; the process may end."""
        with self.processes(function, 1) as submit:
            future = submit(item)
            if isinstance(future.exception(), BrokenExecutor):
                future = Future()
                future.set_exception(
                    WorkerLostError(
                        "expected a result, found that the process ended twice, also when it worked on "
                        "this alone: it was killed, mostly because memory ran out, or it crashed"
                    )
                )
        return future


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

    Raises:
        WorkerLostError: The process of an item ended twice.
    """
    early: dict[int, Future[Result]] = {}
    following = 0
    for number, done in as_completed(function, items, executor):
        early[number] = done
        while following in early:
            yield early.pop(following).result()
            following += 1


def as_completed(
    function: Callable[[Item], Result], items: Sequence[Item], executor: Executor | None = None
) -> "Iterator[tuple[int, Future[Result]]]":
    """Apply a function to every item, and yield each as soon as it is done.

    Args:
        function: As in :func:`map_in_order`.
        items: The arguments. A limited number of them is handed on before the first is done.
        executor: As in :func:`map_in_order`.

    Yields:
        Number of the item, and its future, which is done: with the result, what the function raised, or
        :class:`~navirl_cli.errors.WorkerLostError`.
    """
    engine = Local() if executor is None else executor
    left = dict(enumerate(items))
    while left:
        struck = []
        with _held(engine, function, len(left)) as (submit, ahead):
            for number, done in _completed(submit, list(left.items()), ahead):
                if isinstance(engine, Local) and isinstance(done.exception(), BrokenExecutor):
                    struck.append(number)
                    continue
                del left[number]
                yield number, done
        # One of these ended its process, and with it all that had begun: each is tried again, alone.
        for number in struck:
            yield number, Local().alone(function, left.pop(number))


@contextmanager
def _held(
    engine: Executor, function: Callable[[Item], Result], count: int
) -> Iterator[tuple[Submit[Item, Result], int]]:
    """As :meth:`Holding.holding`, for any executor."""
    if isinstance(engine, Holding):
        with engine.holding(function, count) as held:
            yield held
    else:
        yield lambda item: engine.submit(function, item), _AHEAD


def _completed(
    submit: Submit[Item, Result], jobs: Iterable[tuple[int, Item]], ahead: int
) -> "Iterator[tuple[int, Future[Result]]]":
    """Yield jobs when they are done, with so many begun; none is begun after a process has ended."""
    todo = iter(jobs)
    running: dict[int, Future[Result]] = {}
    done: SimpleQueue[int] = SimpleQueue()
    try:
        while True:
            while len(running) < ahead and (job := next(todo, None)) is not None:
                number = job[0]
                running[number] = future = _begun(submit, job[1])
                future.add_done_callback(lambda _, number=number: done.put(number))  # type: ignore[misc]
            if not running:
                return
            number = done.get()
            future = running.pop(number)
            if isinstance(future.exception(), BrokenExecutor):
                todo = iter(())
            yield number, future
    finally:
        for future in running.values():
            future.cancel()


def _begun(submit: Submit[Item, Result], item: Item) -> "Future[Result]":
    """The future of an item, also where no process is left to take it."""
    try:
        return submit(item)
    except BrokenExecutor as error:
        future: Future[Result] = Future()
        future.set_exception(error)
        return future


def context() -> Any:
    """How processes start: as Python likes, but not as a copy of this process where its threads would be missed."""
    from multiprocessing import get_all_start_methods, get_context

    if "obstore" not in sys.modules:
        return get_context()
    return get_context("forkserver" if "forkserver" in get_all_start_methods() else "spawn")


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Delay interrupts and terminations until the block ends: half started, a pool would never end.

    Processes that begin in the block delay them until they handle them.
    """
    if not hasattr(signal, "pthread_sigmask"):  # as on Windows, which does not fork either
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _DELAYED)
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
    #: The work, as the process got it when it began.
    function: Callable[[Any], Any]

    @classmethod
    def listen(cls, function: Callable[[Any], Any], share: int) -> None:
        """Handle interrupts and the end of the parent from now on, in a new process with its share of cores."""
        cls.function = staticmethod(function)
        _share.set(share)
        Thread(target=cls._follow_parent, daemon=True).start()
        signal.signal(signal.SIGINT, cls._interrupted)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _DELAYED)

    @classmethod
    def run(cls, item: Any) -> Any:
        """Process an item, unless there was an interrupt."""
        if cls.stopped:
            raise KeyboardInterrupt
        cls.busy = True
        try:
            return cls.function(item)
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
