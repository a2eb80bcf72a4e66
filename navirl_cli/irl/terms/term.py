"""A term of the reward: parameters, and a value with its derivatives on a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.scene import Scene


@dataclass(frozen=True)
class Parameter:
    """One number of a reward."""

    name: str
    #: SI unit as printed, empty for a pure number.
    unit: str
    #: Closed interval of admissible values.
    lower: float
    upper: float
    #: The value in the unit above that counts as 1 for regularisation and step lengths.
    scale: float
    #: Initial value of a fit by default (the study's initial values).
    initial: float
    meaning: str
    #: Values between the bounds, ascending, at which a fit holds this parameter and looks for other maxima. Empty where
    #: the parameter enters linearly: given all scanned parameters, the reward is linear in the others, and so the
    #: log-likelihood is concave in them.
    scan: tuple[float, ...] = ()


def geometric(low: float, high: float, count: int) -> tuple[float, ...]:
    """Values from low to high whose ratios are equal."""
    return tuple(low * (high / low) ** (number / (count - 1)) for number in range(count))


@dataclass(frozen=True, eq=False)
class Jet:
    """Value and derivatives of a term on a scene.

    Every array broadcasts to (n, 8), cells by moves: (n, 1) for what depends on the cell that is left, (1, 8) for what
    depends on the move alone. Arrays of terms about turns broadcast to (n, 9, 8): cells, incoming moves (the last one
    for paths that begin in the cell), moves.
    """

    value: FloatArray
    #: By parameter of the term.
    first: Sequence[FloatArray]
    #: By pair (j, k), j <= k, of the term's parameters; a missing pair is zero everywhere.
    second: Mapping[tuple[int, int], FloatArray] = field(default_factory=dict)


class Term(Protocol):
    """A term of the reward: a frozen dataclass, so that equal terms compare equal."""

    @property
    def name(self) -> str:
        """Its name on the command line and in files: lower-case letters, digits and hyphens."""

    @property
    def formula(self) -> str:
        """Its value for a step from s to s', as the report prints it."""

    @property
    def symbols(self) -> tuple[str, ...]:
        """Sentences on what its formula contains besides its parameters, s and s'."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The term's parameters in order. No two terms share a name."""

    @property
    def about_people(self) -> bool:
        """Whether it depends on people; a model without people leaves it out."""

    @property
    def about_turns(self) -> bool:
        """Whether it depends on the move before, so that states are cells by incoming move."""

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivatives with respect to the term's parameters, in reward per step."""
