"""What is asked of an evaluation, and its answers: demonstrations of several files, pairs, ranks."""

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import DemonstrationError, unknown
from navirl_cli.evaluation.choice import choose
from navirl_cli.evaluation.compare import Comparison, compare_files, name_in
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import Trained, by_group
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.paired import Paired, pairs_of_all
from navirl_cli.evaluation.ranks import Ranking, check_to_rank, chosen_to_rank, ranking
from navirl_cli.irl.reward import Reward

Files = Mapping[str, Sequence[Demonstration]]


@dataclass(frozen=True, eq=False)
class Asked:
    """Demonstrations by the name of their file, which they are, in a line for each file, and what to compare."""

    files: dict[str, Sequence[Demonstration]]
    notes: tuple[str, ...]
    #: As of :func:`asked_of`.
    trained: Sequence[Trained | None]
    pairs: Sequence[tuple[str, str]]
    fields: Collection[str]
    ranked: bool


def asked_of(
    files: Files,
    subset: Subset,
    trained: Sequence[Trained | None],
    *,
    everything: bool = False,
    pairs: Sequence[tuple[str, str]] = (),
    fields: Collection[str] = (),
    ranked: bool = False,
) -> Asked:
    """The demonstrations that an evaluation is about, as :func:`~navirl_cli.evaluation.choice.choose` says.

    Args:
        files: All demonstrations by the name of their file.
        subset: The user's choice.
        trained: What each reward was learnt from.
        everything: All of them.
        pairs: Groups that are compared, which are needed too.
        fields: That groups are by.
        ranked: Demonstrations are ranked under the one reward.

    Raises:
        NavirlError: A name is unknown, or there is nothing to rank.
    """
    groups = {
        name_in(files, name, group): (name, own)
        for name, everyone in files.items()
        for group, own in by_group(_within(subset, everyone, name, files), fields).items()
    }
    named: dict[str, list[Demonstration]] = {name: [] for name in files}
    for group in (group for pair in pairs for group in pair):
        if group not in groups:
            raise DemonstrationError(unknown("`pair`", group, groups))
        name, own = groups[group]
        named[name] += own
    chosen: dict[str, Sequence[Demonstration]] = {}
    notes = []
    for name, everyone in files.items():
        also = [*named[name], *(chosen_to_rank(everyone, trained[0])[0] if ranked else [])]
        found = choose(everyone, subset, trained, everything=everything, also=also)
        chosen[name] = found.demonstrations
        notes += [name_in(files, name, found.note)] if found.note else []
        if ranked:
            check_to_rank(found.demonstrations, trained[0])
    return Asked(chosen, tuple(notes), trained, pairs, fields, ranked)


def _within(subset: Subset, everyone: Sequence[Demonstration], name: str, files: Files) -> Sequence[Demonstration]:
    """The user's choice of a file; an error names the file where there are several."""
    try:
        return subset.of(everyone)
    except DemonstrationError as error:
        raise DemonstrationError(name_in(files, name, str(error))) from error


@dataclass(frozen=True, eq=False)
class Answers:
    """What an evaluation found."""

    result: Comparison
    pairs: list[tuple[str, str, dict[str, Paired]]]
    ranked: Ranking


def answers_to(
    asked: Asked,
    rewards: Mapping[str, Reward],
    metrics: Sequence[Metric],
    precision: Precision,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> Answers:
    """Measure, compare and rank.

    Args:
        asked: The demonstrations and the comparisons.
        rewards: By name.
        metrics: To compute.
        precision: How many paths to draw.
        rng: Source of randomness.
        progress: Called with demonstrations done and in all.
        executor: Where paths of policies are drawn and measured; by default here.

    Raises:
        NavirlError: As of :func:`~navirl_cli.evaluation.compare.compare`.
    """
    files, fields = asked.files, asked.fields
    result = compare_files(
        files, rewards, precision, rng, metrics=metrics, fields=fields, progress=progress, executor=executor
    )
    compared = pairs_of_all(result, asked.pairs, files, rewards, metrics, fields, rng)
    ranks = Ranking()
    if asked.ranked:
        (everyone,) = files.values()
        ranks = ranking(everyone, next(iter(rewards.values())), asked.trained[0], precision.samples, rng)
    return Answers(result, compared, ranks)
