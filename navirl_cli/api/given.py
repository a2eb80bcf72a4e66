"""Demonstrations and rewards from the user's arguments: objects, or the files that hold them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias, TypeVar

from navirl_cli.api.results import Demonstrations, FittedReward
from navirl_cli.artefacts.demonstrations import demonstrations_of
from navirl_cli.artefacts.joined import as_one, read_contents
from navirl_cli.artefacts.rewards import LearntReward, check_cells, learnt_of, reward_content
from navirl_cli.artefacts.steps import Origin, names_of
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import ArgumentError, DemonstrationError
from navirl_cli.files import Input
from navirl_cli.irl.reward import Reward
from navirl_cli.reports.fit_remarks import warnings

PathLike: TypeAlias = str | Path
#: A learnt reward, or values by the names of the parameters; the other parameters keep their initial values.
AnyReward: TypeAlias = LearntReward | Reward | Mapping[str, float]
#: Demonstrations, or the files and folders that hold them.
Demos: TypeAlias = PathLike | Sequence[PathLike] | Sequence[Demonstration]
Given = TypeVar("Given")


def read_demonstrations(*paths: PathLike) -> Demonstrations:
    """Read demonstrations files, or folders of them with a manifest.

    Args:
        *paths: As written by ``navirl extract`` or :meth:`Demonstrations.write`; several are read as one.

    Returns:
        The trials.

    Raises:
        NavirlError: A file is missing or is not a demonstrations file, two trials have the same id, or there are none.
    """
    files = [Path(path) for path in paths]
    if not files:
        raise ArgumentError("`paths`: expected at least one file, found none")
    contents = read_contents(files)
    document, _ = as_one(contents)
    trials = demonstrations_of(document, ", ".join(map(str, files)))
    if not trials:
        raise DemonstrationError(f"{', '.join(map(str, files))}: holds no demonstrations")
    inputs = [Input(**one) for one in document["inputs"]]
    return Demonstrations(
        trials,
        inputs=inputs if len(files) == 1 else [*inputs, *map(Input.of, files)],
        settings=document["settings"],
        notes=[f"{one.id}: {note}" for one in trials for note in one.notes],
        gain=document.get("gain"),
        file=Input.of(files[0]) if len(files) == 1 else None,
        origin=Origin.of(dict(zip(names_of(files), contents.values(), strict=True)), trials),
    )


def read_reward(path: PathLike, person: str | None = None) -> FittedReward:
    """Read a reward file.

    Args:
        path: As written by ``navirl fit`` or :meth:`FittedReward.write`.
        person: One of the people of a reward fitted with ``pool="persons"``, whose own reward is wanted; by default the
            typical one.

    Returns:
        The reward.

    Raises:
        NavirlError: The file is missing or is not a reward file, or holds no reward of this person.
    """
    path = Path(path)
    document = reward_content(path, person)
    content = {key: value for key, value in document.items() if key not in {"format", "version", "navirl"}}
    return FittedReward.of(learnt_of(document, str(path)), content, notes=tuple(warnings(content)), file=Input.of(path))


def demonstrations_in(demos: Demos) -> Sequence[Demonstration]:
    """Demonstrations; files are read.

    Raises:
        DemonstrationError: There are no demonstrations.
    """
    if isinstance(demos, str | Path):
        return read_demonstrations(demos)
    if not demos:
        raise DemonstrationError("`demos`: expected at least one demonstration, found none")
    if isinstance(demos[0], str | Path):
        return read_demonstrations(*demos)
    return demos  # type: ignore[return-value]


def sources_behind(demos: Sequence[Demonstration]) -> Sequence[Input]:
    """The input files of demonstrations, if they are known."""
    return demos.sources() if isinstance(demos, Demonstrations) else ()


def files_behind(reward: object) -> list[Input]:
    """The file of a reward, if it has one."""
    if isinstance(reward, str | Path):
        return [Input.of(Path(reward))]
    file = reward.file if isinstance(reward, FittedReward) else None
    return [] if file is None else [file]


def learnt_in(reward: PathLike | LearntReward) -> LearntReward:
    """A learnt reward; a file is read."""
    return read_reward(reward) if isinstance(reward, str | Path) else reward


def prior_in(reward: PathLike | LearntReward, person: str | None) -> LearntReward:
    """An earlier reward, to learn that of a person if one is named; a file is read.

    Raises:
        ArgumentError: A person is named, and the reward is not one that ``fit`` learnt.
        ArtefactError: A person is named, and the reward is one for all.
    """
    learnt = learnt_in(reward)
    if person is None:
        return learnt
    if learnt.others is not None and person not in learnt.persons:
        return learnt
    return learnt_in(of_one(learnt, person))


def of_one(reward: Given, person: str | None) -> "Given | FittedReward":
    """The reward of one of the people of a reward; the reward itself for None.

    Raises:
        ArgumentError: The reward is not one that ``fit`` learnt.
        ArtefactError: It holds no reward of this person.
    """
    if person is None:
        return reward
    if isinstance(reward, str | Path):
        return read_reward(reward, person)
    if not isinstance(reward, FittedReward):
        raise ArgumentError("`person`: expected a reward that was fitted with `pool` persons, found another")
    return reward.person(person)


def reward_in(reward: PathLike | AnyReward, demonstrations: Sequence[Demonstration] = ()) -> Reward:
    """The reward, checked against the cells of the demonstrations on which it is used.

    Raises:
        ArtefactError: It was learnt on cells of another size.
        RewardError: A parameter is unknown or out of its bounds.
    """
    if isinstance(reward, Reward):
        return reward
    if isinstance(reward, Mapping):
        return Reward.named(reward)
    learnt = learnt_in(reward)
    check_cells(learnt, demonstrations, str(reward) if isinstance(reward, str | Path) else "reward")
    return learnt.reward
