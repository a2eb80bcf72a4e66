"""The public functions. Each does the work of the command of the same name, with the same options."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from navirl_cli.api.arguments import (
    Point,
    chosen,
    one_of,
    points_in,
    topics_in,
    within,
)
from navirl_cli.api.given import (
    AnyReward,
    PathLike,
    of_one,
    reward_in,
)
from navirl_cli.api.results import Demonstrations, ScenePolicy
from navirl_cli.api.working import executor_of, warn
from navirl_cli.artefacts.demonstrations import (
    demonstrations_document,
    demonstrations_of,
    gain_document,
    settings_document,
)
from navirl_cli.artefacts.steps import Origin
from navirl_cli.demos.contact import PushSettings
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.labels import read_labels
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.recordings import Recordings, check_no_wrench, extract_recordings
from navirl_cli.demos.trials import Split
from navirl_cli.errors import ArgumentError
from navirl_cli.files import Input
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.scene import scenes_of
from navirl_cli.logs.load import Forces, LoadOptions
from navirl_cli.logs.map_file import read_map
from navirl_cli.logs.overview import Overview, overview
from navirl_cli.logs.roles.clocks import TimeSource
from navirl_cli.logs.roles.session import MOST_CYCLES
from navirl_cli.logs.sources import sources_of
from navirl_cli.reports.extraction import published_notes


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
    if no_wrench:
        check_no_wrench(gain=gain, wrench_frame=wrench_frame, force_scale=force_scale, topics=topics_in(topic))
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
    with executor_of(executor, workers, cluster) as where:
        found = extract_recordings(logs, settings, options, join=join, labels=labels, executor=where)
    said = settings_document(settings, options, map_file, table, join=join)
    return _extracted(found, said, [one for one in (map_file, table) if one is not None])


def _condition(name: str) -> Condition:
    """A condition that can be stated."""
    return Condition(one_of([one.value for one in Condition if one is not Condition.UNKNOWN], name, "condition"))


def _extracted(found: Recordings, said: dict[str, Any], files: Sequence[Path]) -> Demonstrations:
    """The extracted trials as their file holds them, so that numbers are the same with and without a file."""
    demonstrations = found.demonstrations()
    inputs = [*found.inputs, *(Input.of(file) for file in files)]
    warn(found.lost, depth=4)
    document = demonstrations_document(demonstrations, inputs, said)
    trials = demonstrations_of(document, "demonstrations")
    return Demonstrations(
        trials,
        inputs=inputs,
        settings=said,
        notes=[*found.notes(demonstrations), *published_notes(found.extractions)],
        lost=found.lost,
        gain=gain_document([(one.log, one.gain) for one in found.extractions]) if said["gain"] else None,
        origin=Origin.of({"demos.json": document}, trials),
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
