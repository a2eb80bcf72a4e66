"""What a fit is asked besides its parameters: bias, bootstrap, profiles, prediction of people left out."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass

from navirl_cli.errors import ArgumentError, NavirlError
from navirl_cli.irl.bias import corrected
from navirl_cli.irl.bootstrap import Bootstrap, bootstrap
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit
from navirl_cli.irl.profile import Profile, number_of, profile
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps
from navirl_cli.irl.validation import Validation, cross_validate

#: Called with the steps done and a word on the present one.
Update = Callable[[int, str], None]
#: Opens a progress bar: a label, and the number of steps where it is known.
Bars = Callable[[str, int | None], AbstractContextManager[Update]]


@dataclass(frozen=True)
class Questions:
    """What is asked of a fit."""

    #: Subtract the first-order bias of maximum likelihood.
    correct_bias: bool = False
    #: Number of fits to participants drawn with replacement.
    bootstrap: int | None = None
    #: Names of parameters whose profile likelihood is followed.
    profiles: tuple[str, ...] = ()
    #: Predict each participant from the others.
    cross_validate: bool = False
    #: Of the bootstrap's draws.
    seed: int = 0

    def check_arguments(self, steps: Steps, *, prior: bool, l2: float) -> None:
        """Refuse before anything is read what cannot be asked of any data.

        Raises:
            ArgumentError: The questions exclude each other, the prior, the steps or the regulariser.
        """
        if self.cross_validate and prior:
            raise ArgumentError(
                "`cross_validate` and `prior` exclude each other: the prior may know the participant who is left out"
            )
        if self.correct_bias and (
            prior or steps is not Steps.ALL or self.bootstrap or self.profiles or self.cross_validate
        ):
            raise ArgumentError(
                "`correct_bias` needs all steps and no prior, and the other analyses belong to the uncorrected fit: "
                "leave out `prior`, `steps`, `bootstrap`, `profile` and `cross_validate`"
            )
        if self.correct_bias and l2 > PAPER_L2:
            raise ArgumentError(
                f"`correct_bias` corrects maximum likelihood: expected `l2` <= {PAPER_L2:g}, found {l2:g}"
            )

    def check(self, evidence: Evidence, start: Reward) -> None:
        """Refuse before a fit what these data cannot answer after it.

        Raises:
            RewardError: A parameter is unknown.
            DemonstrationError: Several participants are needed.
        """
        for name in self.profiles:
            number_of(start, name)
        for name, asked in (("bootstrap", self.bootstrap), ("cross_validate", self.cross_validate)):
            if asked:
                evidence.several_people(name)


@dataclass(frozen=True)
class Analyses:
    """Answers."""

    bootstrap: Bootstrap | None = None
    profiles: tuple[Profile, ...] = ()
    validation: Validation | None = None


def no_bars(_label: str, _length: int | None = None) -> AbstractContextManager[Update]:
    """No progress bar."""
    return nullcontext(lambda _done, _word: None)


def answers(
    evidence: Evidence,
    found: Fit,
    questions: Questions,
    *,
    executor: Executor | None = None,
    bars: Bars = no_bars,
) -> tuple[Fit, Analyses, list[str]]:
    """Ask a fit.

    Args:
        evidence: What was learnt from.
        found: The fit of it.
        questions: What is asked.
        executor: Where to compute; by default local processes.
        bars: Opens a progress bar for each question.

    Returns:
        The fit, corrected where that was asked; the answers; and why a question has no answer. The fit stands whatever
        becomes of a question.
    """
    lost: list[str] = []
    drawn = validation = None
    followed = []
    if questions.correct_bias:
        with _kept(lost):
            found = corrected(evidence, found)
    if questions.bootstrap:
        with _kept(lost), bars("bootstrap", questions.bootstrap) as update:
            drawn = bootstrap(evidence, found, questions.bootstrap, questions.seed, executor=executor, progress=update)
    for name in dict.fromkeys(questions.profiles):
        with _kept(lost), bars("profile", None) as update:
            followed.append(profile(evidence, found, name, progress=update))
    if questions.cross_validate:
        with _kept(lost), bars("cross-validation", len(evidence.people)) as update:
            validation = cross_validate(evidence, found.initial, found.l2, executor=executor, progress=update)
    return found, Analyses(drawn, tuple(followed), validation), lost


@contextmanager
def _kept(lost: list[str]) -> Iterator[None]:
    """Keep an expected error of one question from the fit and from the other questions."""
    try:
        yield
    except NavirlError as error:
        lost.append(str(error))
