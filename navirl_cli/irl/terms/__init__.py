"""Terms of the reward, each in a file of its own. A new term is named here and nowhere else."""

from collections.abc import Mapping

from navirl_cli.irl.terms.deviation import Deviation
from navirl_cli.irl.terms.personal_space import PersonalSpace
from navirl_cli.irl.terms.step_length import StepLength
from navirl_cli.irl.terms.term import Term

#: Every term by the name of its file.
TERMS: Mapping[str, Term] = {
    "step_length": StepLength(),
    "deviation": Deviation(),
    "personal_space": PersonalSpace(),
}
