"""The demonstrated steps that a reward is learnt from, by scene."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import moves_along
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.graph import NO_MOVE, Graph
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.teams import Ask, team

#: Scenes in a block, the sums over which are added up. Numbers in files depend on it, by rounding.
BLOCK: Final = 16
#: Cells of all scenes below which workers take longer to start than they save, in the 40 evaluations of a fit.
ENOUGH_CELLS: Final = 100_000

Given = TypeVar("Given")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class SceneEvidence:
    """All steps that were demonstrated in one scene."""

    scene: Scene
    #: (m,) state of the lattice that each step leaves, number of its move, and of the move before it: NO_MOVE where the
    #: path begins.
    state: IntArray
    move: IntArray
    incoming: IntArray
    #: (m,) number of the demonstration (in the whole list) that each step belongs to, and of the step on its path.
    owner: IntArray
    number: IntArray

    @property
    def target(self) -> IntArray:
        """(m,) state of the lattice that each step leads to."""
        target: IntArray = self.scene.lattice.neighbours[self.state, self.move]
        return target

    def states_in(self, graph: Graph) -> IntArray:
        """(m,) the state of a graph on the lattice that each step leaves."""
        return graph.states_in(self.state, self.incoming)

    def taken(self, steps: IntArray | NDArray[np.bool_]) -> "SceneEvidence":
        """Some of the steps, by number or mask; a step named twice counts twice."""
        arrays = {name: getattr(self, name)[steps] for name in ("state", "move", "incoming", "owner", "number")}
        return replace(self, **arrays)


#: Scenes whose sums are added up before those of others.
Block: TypeAlias = tuple[SceneEvidence, ...]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Demonstrated steps, by scene. A step that is repeated counts each time."""

    scenes: tuple[SceneEvidence, ...]
    #: By demonstration, including those without a selected step.
    participants: tuple[str, ...]
    #: Asks the workers that keep the blocks (:meth:`kept_by`); None where this process works on them.
    ask: Ask[Any, Any] | None = field(default=None, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Cross process borders without workers."""
        return Evidence, (self.scenes, self.participants)

    @cached_property
    def blocks(self) -> list[Block]:
        """The scenes in runs of BLOCK, whichever process works on them."""
        return [self.scenes[low : low + BLOCK] for low in range(0, len(self.scenes), BLOCK)]

    def by_block(self, work: Callable[[Block, Given], Result], given: Given) -> list[Result]:
        """Apply a function to every block: at the workers that keep them, or here.

        Args:
            work: Importable by name. Called with a block and what is given.
            given: Passed to other processes.

        Returns:
            Results in the order of the scenes, so that their sum does not depend on who works on them.

        Raises:
            WorkerLostError: Processes of workers ended twice.
        """
        if self.ask is None:
            return [work(block, given) for block in self.blocks]
        return self.ask((work, given))

    @contextmanager
    def kept_by(self, executor: Executor | None) -> Iterator["Evidence"]:
        """The same evidence with its blocks at workers, which build what a scene needs once and keep it.

        Args:
            executor: Local processes or a cluster. Where it is neither, or there is too little to do, this process
                works on all blocks.
        """
        sizes = [float(sum(part.scene.lattice.size for part in block)) for block in self.blocks]
        if executor is None or len(sizes) < 2 or sum(sizes) < ENOUGH_CELLS:
            yield self
            return
        with team(executor, _applied, self.blocks, sizes) as ask:
            yield replace(self, ask=ask)

    @property
    def count(self) -> int:
        """Number of demonstrations in the list that owners refer to."""
        return len(self.participants)

    @property
    def steps(self) -> int:
        """Number of steps."""
        return sum(len(part.state) for part in self.scenes)

    @property
    def owners(self) -> IntArray:
        """Numbers of the demonstrations with at least one step."""
        return np.unique(np.concatenate([part.owner for part in self.scenes]))

    @property
    def people(self) -> list[str]:
        """Participants with at least one step, sorted by name."""
        return sorted({self.participants[owner] for owner in self.owners})

    def several_people(self, argument: str) -> list[str]:
        """The participants; an error if there is only one.

        Args:
            argument: Name of the argument that needs several participants, for the message.

        Raises:
            DemonstrationError: There is only one.
        """
        if len(self.people) < 2:
            raise DemonstrationError(
                f"`{argument}`: expected several participants, found only {self.people[0]}; add logs of others"
            )
        return self.people

    def only(self, masks: Sequence[NDArray[np.bool_]]) -> "Evidence":
        """Some of the steps.

        Args:
            masks: By demonstration, (k - 1,) whether the step from each cell to the next counts.

        Raises:
            DemonstrationError: No step is left.
        """
        starts = np.concatenate([[0], np.cumsum([len(mask) for mask in masks])])
        chosen = np.concatenate(masks)
        return self._of(part.taken(chosen[starts[part.owner] + part.number]) for part in self.scenes)

    def repeated(self, counts: IntArray) -> "Evidence":
        """The steps of every demonstration, repeated (demonstrations,) count times; demonstrations keep their numbers.

        Raises:
            DemonstrationError: No step is left.
        """
        return self._of(part.taken(np.repeat(np.arange(len(part.owner)), counts[part.owner])) for part in self.scenes)

    def apart(self, participant: str) -> tuple["Evidence", "Evidence"]:
        """The steps of all other participants, and those of one.

        Raises:
            DemonstrationError: One of the two has no step.
        """
        others = np.array([name != participant for name in self.participants], dtype=int)
        return self.repeated(others), self.repeated(1 - others)

    def _of(self, parts: Iterable[SceneEvidence]) -> "Evidence":
        left = tuple(part for part in parts if len(part.state))
        if not left:
            raise DemonstrationError("no step is left to learn from")
        return Evidence(left, self.participants)

    def uniform_log_likelihood(self) -> float:
        """Log-likelihood of the steps when every possible move is equally likely."""
        return -sum(float(np.log(part.scene.lattice.possible[part.state].sum(axis=1)).sum()) for part in self.scenes)


def _applied(block: Block, asked: tuple[Callable[[Block, Any], Any], Any]) -> Any:
    """What a worker does with a block: call a function with it and with what is given."""
    work, given = asked
    return work(block, given)


def evidence_of(demonstrations: Sequence[Demonstration], known: Collection[Scene] = ()) -> Evidence:
    """Collect the steps of demonstrations by scene.

    Args:
        demonstrations: The demonstrations.
        known: As in :func:`navirl_cli.irl.scene.scenes_of`.

    Raises:
        SceneError: A demonstration's scene has no path from start to goal.
        DemonstrationError: A demonstration's path enters its goal before its end, or there are no demonstrations.
    """
    if not demonstrations:
        raise DemonstrationError("no demonstration to learn from")
    steps: dict[Scene, list[tuple[IntArray, IntArray, int]]] = {}
    scenes = scenes_of(demonstrations, known)
    for owner, (demonstration, scene) in enumerate(zip(demonstrations, scenes, strict=True)):
        states = scene.lattice.states_of(demonstration.cells)
        if (states[:-1] == scene.goal).any():
            raise DemonstrationError(
                f"demonstration {demonstration.id}: its path passes the goal's cell before it ends there; "
                "end the trial at the first arrival"
            )
        moves = moves_along(demonstration.cells)
        steps.setdefault(scene, []).append((states[:-1], moves, owner))
    parts = []
    for scene, own in steps.items():
        owners = np.concatenate([np.full(len(states), owner) for states, _, owner in own])
        numbers = np.concatenate([np.arange(len(states)) for states, _, _ in own])
        state, move = (np.concatenate([step[i] for step in own]) for i in (0, 1))
        incoming = np.where(numbers == 0, NO_MOVE, np.roll(move, 1))
        parts.append(SceneEvidence(scene, state, move, incoming, owners, numbers))
    return Evidence(tuple(parts), tuple(d.participant for d in demonstrations))
