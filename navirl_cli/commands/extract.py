"""``navirl extract``: logs to demonstrations."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.demonstrations import demonstrations_document, gain_document, settings_document
from navirl_cli.artefacts.many import Folder, check_some
from navirl_cli.artefacts.store import write_json
from navirl_cli.cluster import workers_of
from navirl_cli.commands.shared import (
    bytes_bar,
    check_output,
    echo,
    echo_json,
    finish,
    force_option,
    frame_option,
    goal_option,
    json_option,
    logs_argument,
    merged,
    namespace_option,
    say,
    split_option,
    topic_option,
    topics_by_role,
    workers_options,
)
from navirl_cli.commands.types import Choice, Count, FileOrFolder, FilePath, Number, Output, Point
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.demos.contact import CUTOFF_HZ, PushSettings
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.labels import Labels, read_labels
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.recordings import check_no_wrench, extract_recordings
from navirl_cli.demos.trials import Split
from navirl_cli.documents.text import to_text
from navirl_cli.errors import counted
from navirl_cli.files import Input
from navirl_cli.logs.load import Forces, LoadOptions
from navirl_cli.logs.map_file import read_map
from navirl_cli.logs.roles.clocks import TimeSource
from navirl_cli.logs.roles.session import MOST_CYCLES
from navirl_cli.reports.extraction import gain_table, log_table, published_notes, trial_table


@click.command(
    cls=Command,
    examples=[
        Example("A trial for each goal that the logs announce", "navirl extract p01.mcap p02.mcap -o demos.json"),
        Example(
            "A file for each log of a folder, where it is new or has changed; with a named topic",
            "navirl extract logs --topic wrench=/wrench -o demos/",
        ),
        Example("Labels of each trial from a table", "navirl extract p01.mcap --trials trials.csv -o demos.json"),
    ],
)
@logs_argument
@section(
    "Input",
    topic_option,
    namespace_option,
    click.option(
        "--map", "map_file", type=FilePath, help="Nav2 map YAML beside its pgm or png, instead of the map in the log."
    ),
    frame_option,
    click.option(
        "--no-wrench", is_flag=True, help="Ignore forces; also for logs without a wrench. Contact is then unknown."
    ),
    click.option("--wrench-frame", help="Frame of the wrench, instead of the frame in its header."),
    click.option(
        "--force-scale",
        metavar="FACTOR",
        default=1.0,
        type=Number(0, 1e9, min_open=True),
        help="Newtons for the unit of the wrench's forces: 1000 for kN, 0.001 for mN.  [default: 1]",
    ),
    click.option(
        "--time",
        "time_source",
        type=Choice([source.value for source in TimeSource]),
        default=TimeSource.HEADER.value,
        show_default=True,
        help="Time of a message: the stamp in its header, or the time of receipt in the log.",
    ),
    click.option("--join", is_flag=True, help="Treat all LOGs as parts of one recording."),
    click.option("--strict", is_flag=True, help="Refuse damaged logs."),
)
@section(
    "Trials",
    split_option,
    goal_option,
    click.option(
        "--person", "people", multiple=True, type=Point(), help="Position of a person in the map frame, m; repeatable."
    ),
    click.option(
        "--keep-truncated",
        is_flag=True,
        help="Keep trials whose poses are missing at the beginning or end, marked as truncated.",
    ),
)
@section(
    "Labels",
    click.option(
        "--trials",
        type=FilePath,
        help="CSV table of participant, condition, cycle and the like of each trial, as navirl inspect --trials writes "
        "it to be filled in.",
    ),
    click.option("--participant", help="Participant, instead of the name in the log or of the file."),
    click.option(
        "--condition",
        type=Choice([one.value for one in Condition if one is not Condition.UNKNOWN]),
        help="Condition of all trials, instead of that in the log or by contact.",
    ),
    click.option("--cycle", type=Count(1, MOST_CYCLES), help="Cycle of all trials, instead of that in the log."),
    click.option("--set", "part", help="Purpose of all trials besides the main task, instead of that in the log."),
)
@section(
    "Contacts",
    click.option(
        "--contact-force",
        default=3.0,
        show_default=True,
        type=Number(0, 1000, min_open=True),
        help="A contact begins above this force and ends below half of it, N.",
    ),
    click.option(
        "--wrench-filter",
        default=CUTOFF_HZ,
        show_default=True,
        type=Number(0.01, 1000),
        help="Cut-off frequency of the force's low-pass filter, Hz.",
    ),
    click.option("--gain", is_flag=True, help="Estimate the robot's gain, its velocity per sideways force."),
)
@section(
    "Grid",
    click.option("--resolution", default=0.1, show_default=True, type=Number(0.01, 2), help="Side of the cells, m."),
    click.option(
        "--rasterizer",
        type=Choice([rule.value for rule in Rule]),
        default=ExtractSettings.rasterizer.value,
        show_default=True,
        help="Cells of a path: by the rule of the paper's study, the cells crossed, or the chain code.",
    ),
    click.option(
        "--robot-radius",
        type=Number(0, 10),
        help="Radius by which the map is inflated, m.  [default: from the log's session record, else 0.3]",
    ),
)
@workers_options
@section(
    "Output",
    click.option(
        "-o",
        "--output",
        required=True,
        type=FileOrFolder(),
        help="Demonstrations file to write; or a folder (an existing one, or a name that ends in /) for one file a log "
        "and a manifest. In a folder, logs that have not changed are not read again.",
    ),
    json_option,
    force_option,
)
def extract(
    logs: tuple[Path, ...],
    output: Output,
    split: str,
    trials: Path | None,
    participant: str | None,
    condition: str | None,
    cycle: int | None,
    part: str | None,
    robot_radius: float | None,
    resolution: float,
    rasterizer: str,
    people: tuple[tuple[float, float], ...],
    goal: tuple[float, float] | None,
    keep_truncated: bool,
    contact_force: float,
    wrench_filter: float,
    gain: bool,
    topics: tuple[tuple[str, str], ...],
    namespace: str | None,
    map_file: Path | None,
    frame: str | None,
    no_wrench: bool,
    wrench_frame: str | None,
    force_scale: float,
    time_source: str,
    join: bool,
    strict: bool,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    force: bool,
) -> None:
    """Turn MCAP logs into demonstrations.

    LOG is an MCAP file (also compressed with zstd or lz4), a rosbag2 folder, a folder of recordings, or a pattern.
    Topics are found by message type; navirl inspect shows which. Each log is split into trials. In each trial,
    contacts (a person pushes the robot) are detected, and the path becomes cells of a grid.

    The map should be the one in which the robot drove. A plain map is inflated by the robot's radius; a costmap is
    inflated already.

    Only the force of the wrench is used, in the robot's base frame. The sensor's slowly changing bias is subtracted.
    Unlike a torque, a force does not depend on where the sensor is mounted. A push on the robot's body that does not
    pass through the sensor is not measured.
    """
    chosen = topics_by_role(topics)
    if no_wrench:
        check_no_wrench(gain=gain, wrench_frame=wrench_frame, force_scale=force_scale, topics=chosen)
    files = [one for one in (map_file, trials) if one is not None]
    if not output.is_folder:
        check_output(output.path, [*logs, *files], force=force)
    settings = ExtractSettings(
        split=Split(split),
        resolution_m=resolution,
        robot_radius_m=robot_radius,
        rasterizer=Rule(rasterizer),
        push=PushSettings(begins_n=contact_force, cutoff_hz=wrench_filter),
        participant=participant,
        condition=None if condition is None else Condition(condition),
        cycle=cycle,
        set=part,
        people_m=people or None,
        goal_m=goal,
        gain=gain,
        keep_truncated=keep_truncated,
    )
    options = LoadOptions(
        topics=chosen,
        namespace=namespace,
        time=TimeSource(time_source),
        frame=frame,
        wrench_frame=wrench_frame,
        force_scale=force_scale,
        occupancy=None if map_file is None else read_map(map_file),
        forces=Forces.IGNORED if no_wrench else Forces.NEEDED,
        strict=strict,
    )
    labels = None if trials is None else read_labels(trials)
    said = settings_document(settings, options, map_file, trials, join=join)
    asked = _Asked(logs, settings, options, labels, join, said, list(map(Input.of, files)))
    into = _into_folder if output.is_folder else _into_file
    into(asked, output.path, workers, cluster, as_json=as_json, force=force)


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is extracted, and how."""

    logs: Sequence[Path]
    settings: ExtractSettings
    options: LoadOptions
    labels: Labels | None
    join: bool
    #: The settings as a file holds them, and the other files that were read.
    said: dict[str, Any]
    files: Sequence[Input]


def _into_file(
    asked: _Asked, path: Path, workers: int | None, cluster: str | None, *, as_json: bool, force: bool
) -> None:
    """Write the demonstrations of all logs to one file, and say what they are."""
    with workers_of(workers, cluster) as executor, bytes_bar("extract") as update:
        found = extract_recordings(
            asked.logs,
            asked.settings,
            asked.options,
            join=asked.join,
            labels=asked.labels,
            executor=executor,
            progress=update,
        )
    demonstrations = found.demonstrations()
    document = demonstrations_document(demonstrations, [*found.inputs, *asked.files], asked.said)
    if asked.settings.gain:
        document["gain"] = gain_document([(result.log, result.gain) for result in found.extractions])
    write_json(path, "demonstrations", document, force=force)
    table, gains = trial_table(demonstrations), document.get("gain")
    if as_json:
        echo_json({"trials": table.records(), "gain": gains})
    else:
        echo(to_text([table, *([gain_table(gains)] if gains else [])]))
    for line in merged([*found.notes(demonstrations), *published_notes(found.extractions)]):
        say(line)
    finish(found.lost)


def _into_folder(
    asked: _Asked, path: Path, workers: int | None, cluster: str | None, *, as_json: bool, force: bool
) -> None:
    """Write a file a log to a folder, and say what became of the logs."""
    folder = Folder(path, asked.settings, asked.options, asked.said, asked.files)
    try:
        with workers_of(workers, cluster) as executor, bytes_bar("extract") as update:
            entries = folder.extract(
                asked.logs, labels=asked.labels, join=asked.join, force=force, executor=executor, progress=update
            )
    except KeyboardInterrupt:
        say(f"{counted(len(folder.entries), 'log')} done and kept: the same command goes on with the rest")
        raise
    check_some(entries)
    if as_json:
        echo_json({"logs": [asdict(one) for one in entries], "unchanged": folder.unchanged})
    else:
        echo(to_text([log_table(entries, folder.unchanged)]))
    for line in merged([*(note for one in entries for note in one.notes), *folder.fetched]):
        say(line)
    lost = [line for one in entries for line in one.lost]
    finish([*(f"left out: {one.reason}" for one in entries if one.reason is not None), *lost])
