"""A reward: terms with the values of their parameters, evaluated on a scene."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError, unknown
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms import TERMS
from navirl_cli.irl.terms.term import Jet, Parameter, Term

#: The reward of the paper (Eq. 13).
PAPER_TERMS: tuple[Term, ...] = (TERMS["step_length"], TERMS["deviation"], TERMS["personal_space"])


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

    def on(self, scene: Scene) -> Jet:
        """Value, first and second derivatives for all parameters together; zero in the absorbing goal.

        Arrays as in :class:`Jet`. ``value`` is -inf where a move is not possible.
        """
        at = 0
        total = np.zeros((scene.lattice.size, 8))
        first: list[FloatArray] = []
        second: dict[tuple[int, int], FloatArray] = {}
        for term in self.terms:
            count = len(term.parameters)
            jet = term.on(scene, self.theta[at : at + count])
            total += jet.value
            first.extend(_closed(array, scene.goal) for array in jet.first)
            second |= {(at + j, at + k): _closed(array, scene.goal) for (j, k), array in jet.second.items()}
            at += count
        total[~scene.lattice.possible] = -np.inf
        total[scene.goal] = -np.inf
        return Jet(total, first, second)

    def by_cell(self, scene: Scene) -> FloatArray:
        """(n,) the part of the reward that depends on the cell only, not on the move (Fig. 8 right)."""
        total = np.zeros(scene.lattice.size)
        at = 0
        for term in self.terms:
            count = len(term.parameters)
            value = term.on(scene, self.theta[at : at + count]).value
            if value.shape[1] == 1:
                total += value[:, 0]
            at += count
        return total


def _closed(array: FloatArray, goal: int) -> FloatArray:
    """The array with zeros in the goal's row; arrays by move alone are unchanged, because no move leaves the goal."""
    if len(array) == 1:
        return array
    closed = array.copy()
    closed[goal] = 0.0
    return closed
