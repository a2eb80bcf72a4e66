"""Workers that keep parts of data between the calls of a function: what takes long to build is built once.

All parts are asked at once, and their results come in the order of the parts, so that sums of them do not depend on the
number of workers.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from itertools import accumulate
from typing import Any, Final, Protocol, TypeVar, runtime_checkable

from navirl_cli.errors import WorkerLostError
from navirl_cli.parallel import Local, Submit, context

Part = TypeVar("Part")
Argument = TypeVar("Argument")
Result = TypeVar("Result")
#: Calls the function on all parts with an argument; results in the order of the parts.
Ask = Callable[[Argument], list[Result]]
#: What a member of a team sends back: its number, its results, and what its function raised in place of them.
Answer = tuple[int, list[Any], Exception | None]
#: Processes of a local team are replaced once for each call.
_TRIALS: Final = 2


@runtime_checkable
class Keeping(Protocol):
    """An executor whose workers keep what they are given."""

    @property
    def size(self) -> int:
        """Number of items that it works on at a time."""
        ...

    def keeping(
        self, function: Callable[[Part, Argument], Result], shares: Sequence[Sequence[Part]]
    ) -> AbstractContextManager[Ask[Argument, Result]]:
        """Give each worker a share of the parts, as long as the block lasts.

        Args:
            function: Importable by name.
            shares: One for each worker.
        """
        ...


@contextmanager
def team(
    executor: Executor, function: Callable[[Part, Argument], Result], parts: Sequence[Part], sizes: Sequence[float]
) -> Iterator[Ask[Argument, Result] | None]:
    """Workers that keep parts, as long as the block lasts.

    Args:
        executor: Local processes, or the workers of a cluster.
        function: Applied to a part and an argument; importable by name. Its results must not depend on earlier calls.
        parts: The data.
        sizes: Work for each part, in any unit.

    Yields:
        What asks all of them; None where the executor has no workers that keep anything, or only one. It raises what
        the function raises on the first of the parts that fail, or WorkerLostError where processes ended twice.
    """
    workers = executor.workers if isinstance(executor, Local) else executor.size if isinstance(executor, Keeping) else 1
    shares = divided(parts, sizes, workers)
    if len(shares) < 2:
        yield None
    elif isinstance(executor, Local):
        with _local(executor, function, shares) as ask:
            yield ask
    elif isinstance(executor, Keeping):
        with executor.keeping(function, shares) as ask:
            yield ask


def divided(parts: Sequence[Part], sizes: Sequence[float], count: int) -> list[Sequence[Part]]:
    """Divide parts into at most so many runs of about equal size; neighbours have much in common."""
    total, runs = sum(sizes), [[] for _ in range(count)]  # type: ignore[var-annotated]
    for part, size, end in zip(parts, sizes, accumulate(sizes), strict=True):
        runs[min(int((end - size / 2) / total * count), count - 1)].append(part)
    return [run for run in runs if run]


def of_share(function: Callable[[Part, Argument], Result], share: Sequence[Part], argument: Argument) -> list[Result]:
    """Apply a function to all parts of a share."""
    return [function(part, argument) for part in share]


class _Member:
    """The work of the processes of a local team.

    Each takes one share with its first call. A call begins when all processes have taken it, so that none takes two of
    one question.
    """

    def __init__(self, function: Callable[[Any, Any], Any], shares: Sequence[Sequence[Any]], context: Any) -> None:
        self._function, self._shares = function, shares
        self._seats, self._begin = context.Value("i", 0), context.Barrier(len(shares))
        self._own: int | None = None

    def __call__(self, argument: Any) -> Answer:
        if self._own is None:
            with self._seats.get_lock():
                self._own = self._seats.value
                self._seats.value += 1
        self._begin.wait()
        try:
            return self._own, of_share(self._function, self._shares[self._own], argument), None
        except Exception as error:  # noqa: BLE001 - whoever asks gets it
            return self._own, [], error


@contextmanager
def _local(
    executor: Local, function: Callable[[Part, Argument], Result], shares: Sequence[Sequence[Part]]
) -> Iterator[Ask[Argument, Result]]:
    """As :meth:`Keeping.keeping`, in processes that are begun again when one of them ends."""
    with ExitStack() as stack:

        def begun() -> Submit[Argument, Answer]:
            member = _Member(function, shares, context())
            return stack.enter_context(executor.processes(member, len(shares)))

        submit = begun()

        def ask(argument: Argument) -> list[Result]:
            nonlocal submit
            for _ in range(_TRIALS):
                try:
                    futures = [submit(argument) for _ in shares]
                    answers = sorted((one.result() for one in futures), key=lambda answer: answer[0])
                except BrokenExecutor:
                    submit = begun()
                else:
                    return _joined(answers)
            raise WorkerLostError(
                "expected sums over scenes, found that processes which compute them ended twice: they were killed, "
                "mostly because memory ran out, or they crashed; use fewer `workers`"
            )

        yield ask


def _joined(answers: Sequence[Answer]) -> list[Any]:
    """The results of all members in order; raises the error of the first of them."""
    for _, _, error in answers:
        if error is not None:
            raise error
    return [result for _, results, _ in answers for result in results]
