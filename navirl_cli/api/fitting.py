"""``fit``: a reward from demonstrations."""

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any

from navirl_cli.api.arguments import (
    chosen,
    one_of,
    subset_in,
    terms_in,
    texts,
    within,
)
from navirl_cli.api.given import (
    AnyReward,
    Demos,
    PathLike,
    demonstrations_in,
    files_behind,
    prior_in,
    reward_in,
    sources_behind,
)
from navirl_cli.api.results import FittedReward
from navirl_cli.api.working import executor_of, warn
from navirl_cli.artefacts.options import option_words
from navirl_cli.artefacts.persons import whose
from navirl_cli.artefacts.rewards import LearntReward, check_cells, learnt_of, reward_document
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.reach import reach_effect
from navirl_cli.irl.analyses import Pool, Questions, answers
from navirl_cli.irl.fit import PAPER_L2, Method
from navirl_cli.irl.fit import fit as fit_reward
from navirl_cli.irl.intervals import ASKED, Kind
from navirl_cli.irl.reward import Reward, starting
from navirl_cli.irl.selection import Steps, of_participant, select
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms.term import Term
from navirl_cli.reports.evidence import reach_unused
from navirl_cli.reports.fit_remarks import cannot_learn, remarks
from navirl_cli.reports.fit_remarks import warnings as fit_warnings
from navirl_cli.reports.persons import ended


def fit(
    demos: Demos,
    *,
    terms: str | Sequence[str | Term] = (),
    init: PathLike | AnyReward | None = None,
    prior: PathLike | LearntReward | None = None,
    person: str | None = None,
    pool: str = "all",
    l2: float = PAPER_L2,
    method: str = "newton",
    condition: str | Collection[str] = (),
    cycle: int | Collection[int] = (),
    set: str | Collection[str] = (),  # noqa: A002 the option's name
    participant: str | Collection[str] = (),
    trial: str | Collection[str] = (),
    only_corrected: bool = False,
    truncated: bool = False,
    steps: str = "all",
    reach: float | None = None,
    correct_bias: bool = False,
    intervals: str | None = None,
    bootstrap: int | None = None,
    profile: str | Sequence[str] = (),
    cross_validate: str | None = None,
    seed: int = 0,
    workers: int | None = None,
    cluster: str | None = None,
    executor: Executor | None = None,
) -> FittedReward:
    """Learn a navigation reward from demonstrations, as ``navirl fit``.

    A fit that did not converge and an analysis that failed give a warning (:class:`~navirl_cli.errors.NavirlWarning`).

    Args:
        demos: Demonstrations, or their files.
        terms: Terms whose sum the reward is: names, separated by commas or in a list, files as "my_term.py:MyTerm", or
            terms themselves; "length,deviation,personal-space" by default.
        init: Initial values: a reward, its file, or values by name.
        prior: An earlier fit, or its file, as a Gaussian prior with its mean and covariance; without init also the
            initial values.
        person: Learn the reward of this participant from the own demonstrations and the prior, a reward fitted with
            ``pool="persons"``. The prior of a new person is how people are scattered, that of a known one the own
            reward.
        pool: "all": one reward for all participants; "persons": a typical one, and one for each person (random effects
            on the logarithms of the parameters).
        l2: Weight of the regulariser, nats: l2/2 times the sum of squares of the parameters, those per metre in units
            of 10 /m, without the parameters that the prior determines. 0 for none.
        method: "newton" (trust region, and scans for other maxima) or the paper's gradient ascent, "adam".
        condition: Only trials of these conditions: "force", "joystick", "autonomous"; one or several.
        cycle: Only trials of these cycles; one or several.
        set: Only trials of these sets; "main task" are those of none.
        participant: Only trials of these participants.
        trial: Only these trials, by their ids.
        only_corrected: Use only trials in which the person intervened.
        truncated: Also use trials that are cut off.
        steps: Use "all" steps of a path, those during "contact", or those in contact or within the person's reach
            ("reachable"), where no push is acceptance.
        reach: Reach of people, between the centres of robot and person, m; by default the largest distance at which
            people pushed.
        correct_bias: Subtract the first-order bias of maximum likelihood.
        intervals: "profile", "wald" (from standard errors) or "none"; by default profile with fewer than ten
            demonstrations or where a standard error leaves the admissible range, else wald.
        bootstrap: Fit this many times with participants drawn with replacement.
        profile: Parameters whose profile likelihood is computed, with its 95 % interval.
        cross_validate: "participant": predict each participant from the others.
        seed: Seed of the bootstrap.
        workers: Number of processes for bootstrap, cross-validation, and sums over many scenes, in place of threads of
            this process; faster. Use it under ``if __name__ == "__main__":``.
        cluster: Address of a running Dask scheduler that distributes them.
        executor: Any other executor that does so.

    Returns:
        The reward with its covariance and its status.

    Raises:
        NavirlError: No demonstration or step is left, the partition function is infinite at the initial values, or
            arguments exclude each other.

    Example:
        >>> reward = navirl.fit(demos, condition="force", cycle=2)
        >>> reward["c0"]  # per metre
        -49.02...
    """
    given = {name: value for name, value in locals().items() if name != "demos"}
    questions = _questions(correct_bias, bootstrap, texts(profile), cross_validate, seed, intervals, pool, person)
    which, weight = chosen(Steps, steps, "steps"), within("l2", l2, 0, 1e6)
    questions.check_arguments(which, prior=prior is not None, l2=weight)
    demos, subset = demonstrations_in(demos), subset_in(condition, cycle, set, participant, trial)
    reach_m = None if reach is None else within("reach", reach, 0.1, 100)
    selected = select(
        of_participant(demos, person),
        subset,
        only_corrected=only_corrected,
        truncated=truncated,
        steps=which,
        reach_m=reach_m,
    )
    earlier = None if prior is None else prior_in(prior, person)
    start = _start(terms, init, earlier, selected.demonstrations)
    questions.check(selected.evidence, start)
    evidence, how = selected.evidence, chosen(Method, method, "method")
    old = None if earlier is None else earlier.as_prior(person)
    with executor_of(executor, workers, cluster) as where:
        with evidence.kept_by(where) as kept:
            found = fit_reward(kept, start, weight, prior=old, method=how)
        effect = reach_effect(selected.demonstrations, found, which, reach_m, evidence, where)
        others, whole = None if earlier is None else earlier.others, which is Steps.ALL
        found, analyses, lost = answers(evidence, found, questions, others=others, whole_paths=whole, executor=where)
    inputs = [*sources_behind(demos), *files_behind(init), *files_behind(prior)]
    document = reward_document(
        found, selected.demonstrations, inputs, selected.resolution_m, analyses, which.value, effect
    )
    document["options"] = option_words(given, fit.__kwdefaults__ or {})
    if person is not None and earlier is not None:
        document |= whose(person, earlier.participants)
    said = remarks(selected.demonstrations, earlier, chosen_by=subset.condition, everyone=demos)
    notes = (*cannot_learn(selected.demonstrations), *said, *reach_unused(document, reach_m), *fit_warnings(document))
    warn([*_early(document), *lost])
    return FittedReward.of(
        learnt_of(document, "reward"), document, notes=notes, lost=tuple(lost), fit=found, analyses=analyses
    )


def _questions(
    correct_bias: bool,
    bootstrap: int | None,
    profiles: tuple[str, ...],
    cross_validate: str | None,
    seed: int,
    intervals: str | None,
    pool: str,
    person: str | None,
) -> Questions:
    """The analyses that are asked for, arguments as of :func:`fit`."""
    return Questions(
        correct_bias,
        None if bootstrap is None else int(within("bootstrap", bootstrap, 2, 100_000)),
        profiles,
        cross_validate is not None and bool(one_of(("participant",), cross_validate, "cross_validate")),
        seed,
        None if intervals is None else Kind(one_of([kind.value for kind in ASKED], intervals, "intervals")),
        chosen(Pool, pool, "pool"),
        person,
    )


def _start(
    terms: str | Sequence[str | Term],
    init: PathLike | AnyReward | None,
    earlier: LearntReward | None,
    demonstrations: Sequence[Demonstration],
) -> Reward:
    """The reward at which the fit starts; a prior is checked against the cells of the demonstrations."""
    if earlier is not None:
        check_cells(earlier, demonstrations, "prior")
    given = init if init is None or isinstance(init, Mapping) else reward_in(init)
    return starting(terms_in(terms), given, None if earlier is None else earlier.reward)


def _early(content: Mapping[str, Any]) -> list[str]:
    """What to say of a fit that is not at its end."""
    reached = Status(content["status"]) in {Status.CONVERGED, Status.OPEN_INTERVAL}
    return [] if reached else [f"fit: {content['status']}: {ended(content)}"]
