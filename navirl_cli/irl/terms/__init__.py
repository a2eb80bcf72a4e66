"""Terms of the reward, each in a file of its own. A new term is named here and nowhere else."""

from collections.abc import Mapping

from navirl_cli.irl.terms.anisotropic_space import AnisotropicSpace
from navirl_cli.irl.terms.deviation import Deviation
from navirl_cli.irl.terms.length_space import LengthSpace
from navirl_cli.irl.terms.personal_space import PersonalSpace
from navirl_cli.irl.terms.saturating_deviation import SaturatingDeviation
from navirl_cli.irl.terms.step_length import StepLength
from navirl_cli.irl.terms.term import Term
from navirl_cli.irl.terms.turn import Turn

_ALL: tuple[Term, ...] = (
    StepLength(),
    Deviation(),
    PersonalSpace(),
    SaturatingDeviation(),
    AnisotropicSpace(),
    LengthSpace(),
    Turn(),
)
#: Every term of the package by its name.
TERMS: Mapping[str, Term] = {term.name: term for term in _ALL}
