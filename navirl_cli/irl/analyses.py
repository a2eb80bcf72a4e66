"""Analyses of a fit: bias, bootstrap, profile likelihoods, prediction of left-out participants."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from enum import StrEnum

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.errors import ArgumentError, NavirlError, refuse_beside
from navirl_cli.irl.bias import corrected, expected_bias
from navirl_cli.irl.bootstrap import Bootstrap, bootstrap
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit
from navirl_cli.irl.intervals import Intervals, Kind, default_kind, intervals
from navirl_cli.irl.newcomer import Others, newcomer
from navirl_cli.irl.population import Population, population
from navirl_cli.irl.profile import Profile, number_of, profile
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps
from navirl_cli.irl.status import Status
from navirl_cli.irl.validation import Validation, cross_validate

#: Called with the number of steps done and a short text on the present one.
Update = Callable[[int, str], None]
#: Opens a progress bar: a label, and the number of steps where it is known.
Bars = Callable[[str, int | None], AbstractContextManager[Update]]


class Pool(StrEnum):
    """What the reward is of."""

    #: One for everyone.
    ALL = "all"
    #: A typical one, and one for each participant.
    PERSONS = "persons"


@dataclass(frozen=True)
class Questions:
    """The analyses requested of a fit."""

    #: Subtract the first-order bias of maximum likelihood.
    correct_bias: bool = False
    #: Number of fits to participants drawn with replacement.
    bootstrap: int | None = None
    #: Names of parameters whose profile likelihood is followed.
    profiles: tuple[str, ...] = ()
    #: Predict each participant from the others.
    cross_validate: bool = False
    #: Seed of the bootstrap's draws.
    seed: int = 0
    #: How intervals are computed; None: by the number of demonstrations.
    intervals: Kind | None = None
    #: Whether all people have one reward.
    pool: Pool = Pool.ALL
    #: Whose reward is learnt from a prior of people who differ.
    person: str | None = None

    def check_arguments(self, steps: Steps, *, prior: bool, l2: float) -> None:
        """Refuse requests that no data can answer, before anything is read.

        Raises:
            ArgumentError: The analyses exclude each other, the prior, the steps or the regulariser.
        """
        if self.pool is Pool.PERSONS:
            refuse_beside(
                "`pool` persons has intervals of its own and no prior",
                {"prior": prior, **self._of_one_reward},
                "ask for them in another fit without `pool`",
            )
        if self.person is not None and not prior:
            raise ArgumentError(
                "`person` goes with `prior`, a reward that was fitted with `pool` persons; name it, or choose the "
                "demonstrations with `participant` to learn from them alone"
            )
        if self.person is not None:
            refuse_beside(
                "`person` has intervals of its own",
                self._of_one_reward,
                "ask for them in a fit to these demonstrations alone, with `participant`, not `person` and `prior`",
            )
        if self.cross_validate:
            why = "`cross_validate` predicts participants whom the prior may know"
            refuse_beside(why, {"prior": prior}, "`cross_validate`")
        if self.correct_bias:
            self._check_correction({"prior": prior, "steps": steps is not Steps.ALL}, l2)

    def _check_correction(self, needs: Mapping[str, bool], l2: float) -> None:
        """Refuse what the correction of the bias excludes; arguments and errors as of :meth:`check_arguments`."""
        refuse_beside("`correct_bias` corrects a fit to all steps without a prior", needs, "`correct_bias`")
        refuse_beside(
            "`correct_bias` changes the values, and these analyses are of the fit before",
            self._of_the_fit,
            "ask for them in another fit without `correct_bias`",
        )
        if l2 > PAPER_L2:
            raise ArgumentError(
                f"`correct_bias` corrects maximum likelihood: expected `l2` <= {PAPER_L2:g}, found {l2:g}; lower it, "
                "or leave out `correct_bias`"
            )

    @property
    def _of_the_fit(self) -> dict[str, object]:
        """The analyses of a fit as it is, by name."""
        return {"bootstrap": self.bootstrap, "profile": self.profiles, "cross_validate": self.cross_validate}

    @property
    def _of_one_reward(self) -> dict[str, object]:
        """What only a fit of one reward for all can answer, by name."""
        return {"correct_bias": self.correct_bias, "intervals": self.intervals, **self._of_the_fit}

    def check(self, evidence: Evidence, start: Reward) -> None:
        """Refuse requests that these data cannot answer, before the fit.

        Raises:
            RewardError: A parameter is unknown.
            DemonstrationError: Several participants are needed.
        """
        for name in self.profiles:
            number_of(start, name)
        for name, asked in (
            ("pool", self.pool is Pool.PERSONS),
            ("bootstrap", self.bootstrap),
            ("cross_validate", self.cross_validate),
        ):
            if asked:
                evidence.several_people(name)


@dataclass(frozen=True, eq=False)
class Analyses(ByContent):
    """The results of the analyses."""

    #: Intervals of the parameters, by participant first where there are several.
    intervals: tuple[Intervals, ...] = ()
    #: (k,) expected bias of the fit, in the parameters' units; None where it is unknown or subtracted.
    bias: FloatArray | None = None
    bootstrap: Bootstrap | None = None
    profiles: tuple[Profile, ...] = ()
    validation: Validation | None = None
    #: The people, for a typical reward and one for each.
    population: Population | None = None


def no_bars(_label: str, _length: int | None = None) -> AbstractContextManager[Update]:
    """No progress bar."""
    return nullcontext(lambda _done, _word: None)


def answers(
    evidence: Evidence,
    found: Fit,
    questions: Questions,
    *,
    others: Others | None = None,
    whole_paths: bool = True,
    executor: Executor | None = None,
    bars: Bars = no_bars,
) -> tuple[Fit, Analyses, list[str]]:
    """Run the requested analyses of a fit.

    Args:
        evidence: The demonstrated steps of the fit.
        found: The fit.
        questions: The requested analyses.
        others: Earlier people, where the reward is that of a new person.
        whole_paths: Whether all steps of each path count, so that the bias of the fit can be computed.
        executor: Where to compute; by default local processes.
        bars: Opens a progress bar for each analysis.

    Returns:
        The fit, corrected if requested; the results; and the errors of analyses that failed. A failed analysis does not
        affect the fit.
    """
    if questions.person is not None and others is not None:
        found, ends = newcomer(evidence, others, questions.person, found)
        return found, Analyses((ends,)), []
    if questions.pool is Pool.PERSONS:
        return _persons(evidence, found, executor, bars)
    lost: list[str] = []
    drawn = validation = None
    followed = []
    bias = None
    with evidence.kept_by(executor) as kept:
        measured = _measured(kept, found, questions, bars, lost)
        if questions.correct_bias:
            with _kept(lost):
                found = corrected(kept, found)
            measured = tuple(one.moved(found) for one in measured)
        elif whole_paths:
            bias = expected_bias(kept, found)
    if found.status is Status.CONVERGED and measured and measured[0].is_open:
        found = replace(found, status=Status.OPEN_INTERVAL)
    if questions.bootstrap:
        with _kept(lost), bars("bootstrap", questions.bootstrap) as update:
            drawn = bootstrap(evidence, found, questions.bootstrap, questions.seed, executor=executor, progress=update)
    for name in dict.fromkeys(questions.profiles):
        with _kept(lost), bars("profile", None) as update, evidence.kept_by(executor) as kept:
            followed.append(profile(kept, found, name, progress=update))
    if questions.cross_validate:
        with _kept(lost), bars("cross-validation", len(evidence.people)) as update:
            validation = cross_validate(evidence, found.initial, found.l2, executor=executor, progress=update)
    return found, Analyses(measured, bias, drawn, tuple(followed), validation), lost


def _persons(evidence: Evidence, pooled: Fit, executor: Executor | None, bars: Bars) -> tuple[Fit, Analyses, list[str]]:
    """The typical reward in place of the pooled one, and the people; results as of :func:`answers`."""
    with bars("persons", None) as update:
        found, people, ends = population(
            evidence,
            pooled,
            executor=executor,
            progress=lambda step, value: update(step, f"log-likelihood {value:.3f}"),
        )
    return found, Analyses((ends,), population=people), []


def _measured(
    evidence: Evidence, found: Fit, questions: Questions, bars: Bars, lost: list[str]
) -> tuple[Intervals, ...]:
    """The intervals of the parameters; none where the search did not reach a maximum."""
    kind = default_kind(found) if questions.intervals is None else questions.intervals
    if kind is Kind.NONE or found.status in {Status.STOPPED_EARLY, Status.INFINITE}:
        return ()
    if kind is Kind.WALD:
        return intervals(evidence, found, kind)
    with _kept(lost), bars("intervals", len(found.reward.theta)) as update:
        return intervals(evidence, found, kind, update)
    return ()


@contextmanager
def _kept(lost: list[str]) -> Iterator[None]:
    """Collect an expected error of one analysis, so that it ends neither the fit nor the other analyses."""
    try:
        yield
    except NavirlError as error:
        lost.append(str(error))
