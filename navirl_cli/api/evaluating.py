"""``evaluate``: metrics of paths, and comparisons of groups."""

from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.api.arguments import (
    one_of,
    pairs_in,
    subset_in,
    texts,
    within,
)
from navirl_cli.api.given import (
    AnyReward,
    Demos,
    PathLike,
    demonstrations_in,
    files_behind,
    learnt_in,
    of_one,
    reward_in,
    sources_behind,
)
from navirl_cli.api.results import Evaluation
from navirl_cli.api.working import executor_of, warn
from navirl_cli.artefacts.metrics import metrics_document
from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import FIELDS
from navirl_cli.errors import ArgumentError
from navirl_cli.evaluation.compare import LEARNT
from navirl_cli.evaluation.drawn import MOST, Precision
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS
from navirl_cli.evaluation.questions import answers_to, asked_of
from navirl_cli.irl.reward import Reward
from navirl_cli.reports.per_trial import check_per_trial, write_per_trial


def evaluate(
    demos: Demos | Mapping[str, Demos],
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
        demos: Demonstrations, or their files; or several by name, whose groups of the same name are compared.
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
        raise ArgumentError(
            "`ranks` needs one `reward` and one file of demonstrations: give one of each, or leave it out"
        )
    if per_trial is not None:
        check_per_trial(Path(per_trial))
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
    with nullcontext() if here else executor_of(executor, workers, cluster) as where:
        found = answers_to(asked, learnt, measured, drawing, rng, executor=where)
    inputs = [one for own in files.values() for one in sources_behind(own)]
    inputs += [file for one in rewards.values() for file in files_behind(one)]
    document = metrics_document(found.result, found.pairs, found.ranked, measured, inputs, drawing, seed, shares)
    warn(found.result.notes)
    if per_trial is not None:
        write_per_trial(Path(per_trial), found.result, asked.files, measured)
    return Evaluation(found.result, measured, found.pairs, found.ranked, document, asked.notes, shares)


def _rewards(
    reward: PathLike | AnyReward | Mapping[str, PathLike | AnyReward] | None,
    demos: Sequence[Demonstration],
    person: str | None,
) -> dict[str, Reward | LearntReward]:
    """Rewards by name; one alone is named "learnt"."""
    if reward is None:
        if person is not None:
            raise ArgumentError("`person` goes with `reward`: name one, or leave it out")
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
