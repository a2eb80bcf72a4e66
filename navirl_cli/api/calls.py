"""The public functions. Each does the work of the command of the same name, with the same options."""

import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.api.arguments import (
    Point,
    chosen,
    one_of,
    pairs_in,
    points_in,
    subset_in,
    terms_in,
    texts,
    topics_in,
    within,
)
from navirl_cli.api.given import (
    AnyReward,
    PathLike,
    demonstrations_in,
    files_behind,
    learnt_in,
    of_one,
    prior_in,
    reward_in,
    sources_behind,
)
from navirl_cli.api.results import Demonstrations, Evaluation, FittedReward, ScenePolicy
from navirl_cli.artefacts.demonstrations import (
    demonstrations_document,
    demonstrations_of,
    gain_document,
    settings_document,
)
from navirl_cli.artefacts.metrics import metrics_document
from navirl_cli.artefacts.persons import whose
from navirl_cli.artefacts.rewards import LearntReward, check_cells, learnt_of, reward_document
from navirl_cli.cluster import workers_of
from navirl_cli.demos.contact import PushSettings
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.labels import read_labels
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.recordings import Recordings, extract_recordings
from navirl_cli.demos.subset import FIELDS
from navirl_cli.demos.trials import Split
from navirl_cli.errors import ArgumentError, NavirlWarning
from navirl_cli.evaluation.compare import LEARNT
from navirl_cli.evaluation.drawn import MOST, Precision
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS, Metric
from navirl_cli.evaluation.questions import answers_to, asked_of
from navirl_cli.evaluation.reach import reach_effect
from navirl_cli.files import Input
from navirl_cli.irl.analyses import Pool, Questions, answers
from navirl_cli.irl.fit import PAPER_L2, Method
from navirl_cli.irl.fit import fit as fit_reward
from navirl_cli.irl.intervals import ASKED, Kind
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward, starting
from navirl_cli.irl.scene import scenes_of
from navirl_cli.irl.selection import Steps, of_participant, select
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms.term import Term
from navirl_cli.logs.load import Forces, LoadOptions
from navirl_cli.logs.map_file import read_map
from navirl_cli.logs.overview import Overview, overview
from navirl_cli.logs.roles.clocks import TimeSource
from navirl_cli.logs.roles.session import MOST_CYCLES
from navirl_cli.logs.sources import sources_of
from navirl_cli.parallel import cores
from navirl_cli.reports.evidence import reach_unused
from navirl_cli.reports.extraction import published_notes
from navirl_cli.reports.fit import cannot_learn, remarks
from navirl_cli.reports.fit import warnings as fit_warnings
from navirl_cli.reports.per_trial import write_per_trial
from navirl_cli.reports.persons import ended


def extract(
    *logs: PathLike,
    split: str = "goal",
    trials: PathLike | None = None,
    participant: str | None = None,
    condition: str | None = None,
    cycle: int | None = None,
    set: str | None = None,  # noqa: A002 the option's name
    robot_radius: float | None = None,
    resolution: float = 0.1,
    rasterizer: str = "study",
    person: Point | Sequence[Point] = (),
    goal: Point | None = None,
    keep_truncated: bool = False,
    contact_force: float = 3.0,
    wrench_filter: float = 5.0,
    gain: bool = False,
    topic: Mapping[str, str | Sequence[str]] | None = None,
    namespace: str | None = None,
    map: PathLike | None = None,  # noqa: A002 the option's name
    frame: str | None = None,
    no_wrench: bool = False,
    wrench_frame: str | None = None,
    force_scale: float = 1.0,
    time: str = "header",
    join: bool = False,
    strict: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    executor: Executor | None = None,
) -> Demonstrations:
    """Turn MCAP logs into demonstrations, as ``navirl extract``.

    Damaged or skipped data gives a warning (:class:`~navirl_cli.errors.NavirlWarning`) and is listed in ``lost``.
    ``notes`` lists unusual findings.

    Args:
        *logs: MCAP files, rosbag2 folders, folders of recordings, or patterns.
        split: Trials begin at a new "goal", after a "stop", or the log is one trial ("none").
        trials: CSV table that states participant, condition, cycle and the like of each trial, as
            ``navirl inspect --trials`` writes it to be filled in.
        participant: Name of the participant, instead of the name in the log or of the file.
        condition: Condition of all trials, instead of that in the log or by contact.
        cycle: Cycle of all trials, instead of that in the log.
        set: Purpose of all trials besides the main task, instead of that in the log.
        robot_radius: Radius by which the map is inflated, m. None: from the log's session record, else 0.3.
        resolution: Side of the cells, m.
        rasterizer: Rule that turns a path into cells: "study", "crossed" or "chain".
        person: Position (x, y) of a person, m in the map frame, or several positions; instead of the log's people.
        goal: Goal (x, y), m in the map frame, instead of the log's goals.
        keep_truncated: Keep trials whose poses are missing at the beginning or end, marked as truncated.
        contact_force: A contact begins above this force, N, and ends below half of it.
        wrench_filter: The force is low-passed below this frequency, Hz.
        gain: Estimate the robot's gain, its velocity per sideways force.
        topic: Topic of a role, or several topics, if several are possible: ``{"wrench": "/ft"}``.
        namespace: Namespace of the robot, in a log of several robots: "/robot1".
        map: Nav2 map YAML beside its pgm or png, instead of the map in the log.
        frame: Frame of all results, instead of the map's frame.
        no_wrench: Ignore forces; also for logs without a wrench. Contact is then unknown.
        wrench_frame: Frame of the wrench, instead of the frame in its header.
        force_scale: Newtons for the unit of the wrench's forces: 1000 for kN, 0.001 for mN.
        time: Time of a message: the stamp in its "header", or the time of receipt in the "log".
        join: Treat all logs as parts of one recording.
        strict: Refuse damaged logs.
        workers: Number of processes that read several logs, in place of threads of this process; faster. Use it under
            ``if __name__ == "__main__":``.
        cluster: Address of a running Dask scheduler that distributes the logs.
        executor: Any other executor that does so.

    Returns:
        The trials.

    Raises:
        NavirlError: No log gave a demonstration, or an argument is invalid.

    Example:
        >>> demos = navirl.extract("p01.mcap", "p02.mcap")
        >>> demos[0].id
        'p01/1'
    """
    if not logs:
        raise ArgumentError("`logs`: expected at least one log, found none")
    if no_wrench and (gain or wrench_frame or force_scale != 1):
        raise ArgumentError("`no_wrench` excludes `gain`, `wrench_frame` and `force_scale`, which need the wrench")
    settings = ExtractSettings(
        split=chosen(Split, split, "split"),
        resolution_m=within("resolution", resolution, 0.01, 2),
        robot_radius_m=None if robot_radius is None else within("robot_radius", robot_radius, 0, 10),
        rasterizer=chosen(Rule, rasterizer, "rasterizer"),
        push=PushSettings(
            begins_n=within("contact_force", contact_force, 0, 1000, above=True),
            cutoff_hz=within("wrench_filter", wrench_filter, 0.01, 1000),
        ),
        participant=participant,
        condition=None if condition is None else _condition(condition),
        cycle=None if cycle is None else int(within("cycle", cycle, 1, MOST_CYCLES)),
        set=set,
        people_m=points_in(person) or None,
        goal_m=None if goal is None else points_in(goal)[0],
        gain=gain,
        keep_truncated=keep_truncated,
    )
    map_file = None if map is None else Path(map)
    options = LoadOptions(
        topics=topics_in(topic),
        namespace=namespace,
        time=chosen(TimeSource, time, "time"),
        frame=frame,
        wrench_frame=wrench_frame,
        force_scale=within("force_scale", force_scale, 0, 1e9, above=True),
        occupancy=None if map_file is None else read_map(map_file),
        forces=Forces.IGNORED if no_wrench else Forces.NEEDED,
        strict=strict,
    )
    table = None if trials is None else Path(trials)
    labels = None if table is None else read_labels(table)
    with _executor(executor, workers, cluster) as where:
        found = extract_recordings(logs, settings, options, join=join, labels=labels, executor=where)
    said = settings_document(settings, options, map_file, table)
    return _extracted(found, said, [one for one in (map_file, table) if one is not None])


def _condition(name: str) -> Condition:
    """A condition that can be stated."""
    return Condition(one_of([one.value for one in Condition if one is not Condition.UNKNOWN], name, "condition"))


def _extracted(found: Recordings, said: dict[str, Any], files: Sequence[Path]) -> Demonstrations:
    """The extracted trials as their file holds them, so that numbers are the same with and without a file."""
    demonstrations = found.demonstrations()
    inputs = [*found.inputs, *(Input.of(file) for file in files)]
    _warn(found.lost, depth=4)
    return Demonstrations(
        demonstrations_of(demonstrations_document(demonstrations, inputs, said), "demonstrations"),
        inputs=inputs,
        settings=said,
        notes=[*found.notes(demonstrations), *published_notes(found.extractions)],
        lost=found.lost,
        gain=gain_document([(one.log, one.gain) for one in found.extractions]) if said["gain"] else None,
    )


def inspect(
    *logs: PathLike,
    topic: Mapping[str, str | Sequence[str]] | None = None,
    namespace: str | None = None,
    check: bool = False,
) -> list[Overview]:
    """The content of logs, and the topics that :func:`extract` would use, as ``navirl inspect``.

    Args:
        *logs: As in :func:`extract`.
        topic: As in :func:`extract`.
        namespace: As in :func:`extract`.
        check: Read every message. This also finds damage inside chunks.

    Returns:
        For each recording its topics, the choice for each role, clocks, frames and damage.

    Raises:
        NavirlError: An argument is not a log, or a topic cannot have its role.

    Example:
        >>> navirl.inspect("p01.mcap")[0].needed
        ()
    """
    if not logs:
        raise ArgumentError("`logs`: expected at least one log, found none")
    return [overview(source, topics_in(topic), namespace, check=check) for source in sources_of(logs)]


def fit(
    demos: PathLike | Sequence[Demonstration],
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
        demos: Demonstrations, or their file.
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
        workers: Number of processes for bootstrap and cross-validation, in place of threads of this process; faster.
            Use it under ``if __name__ == "__main__":``.
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
    questions = Questions(
        correct_bias,
        None if bootstrap is None else int(within("bootstrap", bootstrap, 2, 100_000)),
        texts(profile),
        cross_validate is not None and bool(one_of(("participant",), cross_validate, "cross_validate")),
        seed,
        None if intervals is None else Kind(one_of([kind.value for kind in ASKED], intervals, "intervals")),
        chosen(Pool, pool, "pool"),
        person,
    )
    which, weight = chosen(Steps, steps, "steps"), within("l2", l2, 0, 1e6)
    questions.check_arguments(which, prior=prior is not None, l2=weight)
    demos = demonstrations_in(demos)
    subset = subset_in(condition, cycle, set, participant, trial)
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
    if earlier is not None:
        check_cells(earlier, selected.demonstrations, "prior")
    given = init if init is None or isinstance(init, Mapping) else reward_in(init)
    start = starting(terms_in(terms), given, None if earlier is None else earlier.reward)
    questions.check(selected.evidence, start)
    found = fit_reward(
        selected.evidence,
        start,
        weight,
        prior=None if earlier is None else earlier.as_prior(person),
        method=chosen(Method, method, "method"),
    )
    effect = reach_effect(selected.demonstrations, found, which, reach_m)
    with _executor(executor, workers, cluster) as where:
        whole = which is Steps.ALL
        others = None if earlier is None else earlier.others
        found, analyses, lost = answers(
            selected.evidence, found, questions, others=others, whole_paths=whole, executor=where
        )
    inputs = [*sources_behind(demos), *files_behind(init), *files_behind(prior)]
    document = reward_document(
        found, selected.demonstrations, inputs, selected.resolution_m, analyses, which.value, effect
    )
    if person is not None and earlier is not None:
        document |= whose(person, earlier.participants)
    notes = (
        *cannot_learn(selected.demonstrations),
        *remarks(selected.demonstrations, earlier, chosen_by=subset.condition, everyone=demos),
        *reach_unused(document, reach_m),
        *fit_warnings(document),
    )
    reached = found.status in {Status.CONVERGED, Status.OPEN_INTERVAL}
    early = [] if reached else [f"fit: {found.status.value}: {ended(document)}"]
    _warn([*early, *lost])
    return FittedReward.of(
        learnt_of(document, "reward"), document, notes=notes, lost=tuple(lost), fit=found, analyses=analyses
    )


def evaluate(
    demos: PathLike | Sequence[Demonstration] | Mapping[str, PathLike | Sequence[Demonstration]],
    reward: PathLike | AnyReward | Mapping[str, PathLike | AnyReward] | None = None,
    *,
    person: str | None = None,
    metrics: str | Sequence[str] = (),
    condition: str | Collection[str] = (),
    cycle: int | Collection[int] = (),
    set: str | Collection[str] = (),  # noqa: A002 the option's name
    participant: str | Collection[str] = (),
    trial: str | Collection[str] = (),
    all: bool = False,  # noqa: A002 the option's name
    by: str | Collection[str] = (),
    pair: tuple[str, str] | Sequence[tuple[str, str]] = (),
    ranks: bool = False,
    quantiles: float | Sequence[float] = (),
    per_trial: PathLike | None = None,
    samples: int = 1000,
    precision: float | None = None,
    seed: int = 0,
    workers: int | None = None,
    cluster: str | None = None,
    executor: Executor | None = None,
) -> Evaluation:
    """Measure demonstrated, learnt and baseline paths, as ``navirl evaluate``.

    Args:
        demos: Demonstrations, or their file; or several by name, whose groups of the same name are compared.
        reward: A reward, its file, values by name of parameter; or several rewards by name.
        person: Take this person's own reward, of a reward fitted with ``pool="persons"``; the typical one by default.
        metrics: Names of metrics, or "all"; the paper's three by default.
        condition: Only trials of these conditions, as of :func:`fit`; so are cycle, set, participant and trial.
        cycle: Only trials of these cycles.
        set: Only trials of these sets.
        participant: Only trials of these participants.
        trial: Only these trials.
        all: All trials. By default those that the rewards were learnt from, where that is known, and those to compare
            with.
        by: Fields to group by: "condition", "cycle", "set", "participant"; by the first three by default.
        pair: Two groups whose driven paths are compared by participant, or several such pairs.
        ranks: Rank each demonstration by likelihood, least distance and area among paths sampled from the policy, by
            group, for the groups that the reward was learnt from.
        quantiles: Shares of which quantiles by group are computed: 0.5 for medians.
        per_trial: Long table to write, one row for each trial, type of path and metric: .csv or .parquet.
        samples: Number of paths sampled from each policy in each scene.
        precision: Sample until the Monte Carlo error of each mean is below this share of the mean or of its standard
            deviation.
        seed: Seed of all random numbers.
        workers: Number of processes that draw and measure paths of policies; by default this one. Use it under
            ``if __name__ == "__main__":``.
        cluster: Address of a running Dask scheduler that distributes them.
        executor: Any other executor that does so.

    Returns:
        Metrics by group; print them, write them, or take :meth:`~navirl_cli.api.results.Evaluation.to_frame`.

    Raises:
        NavirlError: A metric or a group is unknown, or a reward has no policy in a scene.

    Example:
        >>> navirl.evaluate(demos, reward).to_frame()[["group", "path_type", "length_m_mean"]]
    """
    given = {str(n): one for n, one in demos.items()} if isinstance(demos, Mapping) else {"demos": demos}
    files = {name: demonstrations_in(one) for name, one in given.items()}
    everyone = [one for own in files.values() for one in own]
    rewards = _rewards(reward, everyone, person)
    if ranks and not len(rewards) == len(files) == 1:
        raise ArgumentError("`ranks` needs one `reward` and one file of demonstrations")
    measured = _metrics(metrics)
    fields = tuple(one_of(tuple(FIELDS), one, "by") for one in texts(by))
    drawing = Precision(
        int(within("samples", samples, 2, MOST)),
        None if precision is None else within("precision", precision, 1e-3, 1),
    )
    shares = tuple(within("quantiles", share, 0, 1) for share in np.atleast_1d(np.array(quantiles, dtype=float)))
    pairs, subset = pairs_in(pair), subset_in(condition, cycle, set, participant, trial)
    trained = [one.trained(everyone) if isinstance(one, LearntReward) else None for one in rewards.values()]
    asked = asked_of(files, subset, trained, everything=all, pairs=pairs, fields=fields, ranked=ranks)
    rng = np.random.default_rng(seed)
    learnt = {name: one if isinstance(one, Reward) else one.reward for name, one in rewards.items()}
    here = executor is None and workers is None and cluster is None
    with nullcontext() if here else _executor(executor, workers, cluster) as where:
        found = answers_to(asked, learnt, measured, drawing, rng, executor=where)
    inputs = [one for own in files.values() for one in sources_behind(own)]
    inputs += [file for one in rewards.values() for file in files_behind(one)]
    document = metrics_document(found.result, found.pairs, found.ranked, measured, inputs, drawing, seed, shares)
    _warn(found.result.notes)
    if per_trial is not None:
        write_per_trial(Path(per_trial), found.result, asked.files, measured)
    return Evaluation(found.result, measured, found.pairs, found.ranked, document, asked.notes, shares)


def policy(reward: PathLike | AnyReward, demonstration: Demonstration, *, person: str | None = None) -> ScenePolicy:
    """The policy of a reward in the scene of a demonstration.

    Args:
        reward: A reward, its file, or values by name of parameter.
        demonstration: Gives the map, the people, the start and the goal.
        person: Take this person's own reward, of a reward fitted with ``pool="persons"``; the typical one by default.

    Returns:
        Expected visits, soft value, reward and probabilities as arrays over the map, and paths to draw.

    Raises:
        NavirlError: The scene has no path to the goal, the partition function is infinite, or the reward was learnt on
            cells of another size.

    Example:
        >>> where = navirl.policy(reward, demos[0])
        >>> where.visits.shape == where.grid.shape
        True
    """
    learnt = reward_in(of_one(reward, person), [demonstration])
    scene = scenes_of([demonstration])[0]
    return ScenePolicy(demonstration, learnt, scene, policy_of(learnt, scene))


def _warn(lines: Sequence[str], depth: int = 3) -> None:
    """Warn of what is lost, at the line of the user's call, which is so many calls up."""
    for line in lines:
        warnings.warn(line, NavirlWarning, stacklevel=depth)


@contextmanager
def _executor(executor: Executor | None, workers: int | None, cluster: str | None) -> Iterator[Executor]:
    """Where to work: by default in threads. Processes that cannot fork would run the user's script again."""
    if sum(one is not None for one in (executor, workers, cluster)) > 1:
        raise ArgumentError("`workers`, `cluster` and `executor` exclude each other: name one of them")
    if executor is not None:
        yield executor
    elif workers is not None or cluster is not None:
        count = None if workers is None else int(within("workers", workers, 1, 4096))
        with workers_of(count, cluster) as own:
            yield own
    else:
        with ThreadPoolExecutor(cores()) as own:
            yield own


def _rewards(
    reward: PathLike | AnyReward | Mapping[str, PathLike | AnyReward] | None,
    demos: Sequence[Demonstration],
    person: str | None,
) -> dict[str, Reward | LearntReward]:
    """Rewards by name; one alone is named "learnt"."""
    if reward is None:
        if person is not None:
            raise ArgumentError("`person` goes with `reward`")
        return {}
    several = isinstance(reward, Mapping) and not all(isinstance(value, int | float) for value in reward.values())
    named: Mapping[str, Any] = reward if several else {LEARNT: reward}  # type: ignore[assignment]
    named = {name: of_one(one, person) for name, one in named.items()}
    for one in named.values():
        reward_in(one, demos)
    files = str | Path | LearntReward
    return {name: learnt_in(one) if isinstance(one, files) else reward_in(one) for name, one in named.items()}


def _metrics(names: str | Sequence[str]) -> tuple[Metric, ...]:
    """Metrics by name."""
    if names == "all":
        return tuple(BY_NAME.values())
    known = tuple(BY_NAME)
    return tuple(BY_NAME[one_of(known, name, "metrics")] for name in dict.fromkeys(texts(names))) or PAPER_METRICS
