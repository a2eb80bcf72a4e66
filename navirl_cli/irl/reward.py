"""A reward: terms with the values of their parameters, evaluated on a scene."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError, unknown
from navirl_cli.irl.graph import NO_MOVE
from navirl_cli.irl.ordering import Ordering
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms import TERMS
from navirl_cli.irl.terms.term import Jet, Parameter, Term

#: The reward of the paper (Eq. 13).
PAPER_TERMS: tuple[Term, ...] = (TERMS["length"], TERMS["deviation"], TERMS["personal-space"])


def parameters_of(terms: Iterable[Term]) -> tuple[Parameter, ...]:
    """All parameters of a sum of terms, in order."""
    return tuple(parameter for term in terms for parameter in term.parameters)


def terms_with(names: Sequence[str]) -> tuple[Term, ...]:
    """The terms of TERMS whose parameters have these names, in this order.

    Raises:
        RewardError: The names are not those of one or more terms, each once.
    """
    known = {tuple(parameter.name for parameter in term.parameters): term for term in TERMS.values()}
    found: list[Term] = []
    left = tuple(names)
    while left:
        first = next((own for own in known if left[: len(own)] == own and known[own] not in found), None)
        if first is None:
            groups = "; ".join(", ".join(own) for own in known)
            raise RewardError(f"expected the parameters of known terms ({groups}), found {', '.join(names)}")
        found.append(known[first])
        left = left[len(first) :]
    return tuple(found)


def starting(
    terms: Sequence[Term] = (), given: "Reward | Mapping[str, float] | None" = None, earlier: "Reward | None" = None
) -> "Reward":
    """The reward at which a fit starts.

    Args:
        terms: Of the reward; none for those of the given or the earlier reward, or the paper's.
        given: Initial values, as a reward or by name. A reward of other terms gives the values of common parameters.
        earlier: The reward of a prior, which gives the initial values if no others are given.

    Raises:
        RewardError: A name is unknown or a value out of bounds, or the prior is of other terms.
    """
    source = earlier if given is None else given
    others = source.terms if isinstance(source, Reward) else PAPER_TERMS if earlier is None else earlier.terms
    terms = tuple(terms) or others
    if earlier is not None and earlier.terms != terms:
        own, found = (", ".join(term.name for term in some) for some in (terms, earlier.terms))
        raise RewardError(
            f"`prior`: expected a reward of the terms {own}, found one of {found}; fit it with these `terms`"
        )
    if not isinstance(source, Reward):
        return Reward.named(source or {}, terms)
    names = {parameter.name for parameter in parameters_of(terms)}
    values = zip(source.parameters, source.theta, strict=True)
    return Reward.named({one.name: value for one, value in values if one.name in names}, terms)


@dataclass(frozen=True)
class Reward:
    """r(s, a) as a sum of terms at fixed parameters."""

    theta: tuple[float, ...]
    terms: tuple[Term, ...] = PAPER_TERMS

    def __post_init__(self) -> None:
        """Check number and bounds of the parameters."""
        if len(self.theta) != len(self.parameters):
            names = ", ".join(parameter.name for parameter in self.parameters)
            raise RewardError(f"the reward needs {len(self.parameters)} parameters ({names}), found {len(self.theta)}")
        for parameter, value in zip(self.parameters, self.theta, strict=True):
            if not parameter.lower <= value <= parameter.upper:
                raise RewardError(
                    f"{parameter.name} = {value:g} {parameter.unit}".rstrip()
                    + f" is outside its bounds {parameter.lower:g} to {parameter.upper:g}"
                )

    @staticmethod
    def named(values: Mapping[str, float], terms: tuple[Term, ...] = PAPER_TERMS) -> "Reward":
        """A reward from values by name; the other parameters keep their initial values.

        Raises:
            RewardError: A name is unknown or a value out of bounds.
        """
        parameters = parameters_of(terms)
        names = [parameter.name for parameter in parameters]
        for name in values:
            if name not in names:
                raise RewardError(unknown("parameter", name, names))
        return Reward(tuple(float(values.get(p.name, p.initial)) for p in parameters), terms)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters in order."""
        return parameters_of(self.terms)

    @property
    def about_turns(self) -> bool:
        """Whether a move's reward depends on the move before it."""
        return any(term.about_turns for term in self.terms)

    def ordering(self, scene: Scene) -> Ordering:
        """The states that the reward needs, in order: cells, or cells by incoming move."""
        return scene.turn_ordering if self.about_turns else scene.ordering

    def on(self, scene: Scene) -> Jet:
        """Value, first and second derivatives for all parameters together; zero in the absorbing goal.

        Arrays broadcast to (n, 8), the states of :meth:`ordering` by moves. ``value`` is -inf where a move is not
        possible.
        """
        at = 0
        ordering = self.ordering(scene)
        graph, goal = ordering.graph, ordering.goal
        total = np.zeros((graph.size, 8))
        first: list[FloatArray] = []
        second: dict[tuple[int, int], FloatArray] = {}
        for term in self.terms:
            count = len(term.parameters)
            jet = term.on(scene, self.theta[at : at + count])
            total += graph.on_states(jet.value)
            first.extend(_closed(graph.on_states(array), goal) for array in jet.first)
            second |= {(at + j, at + k): _closed(graph.on_states(array), goal) for (j, k), array in jet.second.items()}
            at += count
        total[~graph.possible] = -np.inf
        total[goal] = -np.inf
        return Jet(total, first, second)

    def by_cell(self, scene: Scene) -> FloatArray:
        """(n,) the part of a step's reward that depends on its cell, mean over straight steps (Fig. 8 right).

        Terms that depend on the moves alone are not in it, such as the cost of path length.
        """
        total = np.zeros(scene.lattice.size)
        at = 0
        for term in self.terms:
            count = len(term.parameters)
            value = term.on(scene, self.theta[at : at + count]).value
            at += count
            if len(value) > 1:
                begun = value if value.ndim == 2 else np.broadcast_to(value, (len(value), 9, 8))[:, NO_MOVE]
                total += begun[:, 0] if begun.shape[1] == 1 else begun[:, ::2].mean(axis=1)
        return total


def _closed(array: FloatArray, goal: int) -> FloatArray:
    """The array with zeros in the goal's row; arrays by move alone are unchanged, because no move leaves the goal."""
    if len(array) == 1:
        return array
    closed = array.copy()
    closed[goal] = 0.0
    return closed
