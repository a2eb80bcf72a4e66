"""``navirl extract``: logs to demonstrations."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.demonstrations import demonstrations_document, gain_document, settings_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.shared import (
    bytes_bar,
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    merged,
    output_option,
    say,
    topic_option,
    topics_by_role,
)
from navirl_cli.commands.types import Choice, FilePath, Number, Point
from navirl_cli.demos.contact import CUTOFF_HZ, PushSettings
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.recordings import extract_recordings
from navirl_cli.demos.trials import Split
from navirl_cli.documents.tables import Table
from navirl_cli.documents.text import to_text
from navirl_cli.files import Input, check_writable
from navirl_cli.logs.load import Forces, LoadOptions
from navirl_cli.logs.map_file import read_map
from navirl_cli.logs.roles.clocks import TimeSource
from navirl_cli.reports.extraction import gain_table, published_notes, trial_table


@click.command()
@click.argument("logs", nargs=-1, required=True, type=FilePath)
@output_option("Demonstrations file to write.")
@click.option(
    "--split",
    type=Choice([split.value for split in Split]),
    default=Split.GOAL.value,
    show_default=True,
    help="Trials start at new goals, at rests, or the log is one trial.",
)
@click.option("--participant", help="Name in place of the log's or the file's.")
@click.option(
    "--robot-radius", type=Number(0, 10), help="m; grows the map.  [default: the log's session record's, else 0.3]"
)
@click.option("--resolution", default=0.1, show_default=True, type=Number(0.01, 2), help="Side of the cells, m.")
@click.option(
    "--rasterizer",
    type=Choice([rule.value for rule in Rule]),
    default=ExtractSettings.rasterizer.value,
    show_default=True,
    help="How a path becomes cells: the study's rule, the cells crossed, or the chain code.",
)
@click.option(
    "--person", "people", multiple=True, type=Point(), help="Where a person stands, m in the map; repeatable."
)
@click.option("--goal", type=Point(), help="The goal, m in the map, in place of the log's goals.")
@click.option(
    "--contact-force",
    default=3.0,
    show_default=True,
    type=Number(0, 1000, min_open=True),
    help="A contact begins above this force, N, and ends below half of it.",
)
@click.option(
    "--wrench-filter",
    default=CUTOFF_HZ,
    show_default=True,
    type=Number(0.01, 1000),
    help="The force is low-passed below this frequency, Hz.",
)
@click.option(
    "--gain",
    is_flag=True,
    help="Estimate how fast the robot gives way to a push to the side; with --json the trials go under trials.",
)
@topic_option
@click.option(
    "--map", "map_file", type=FilePath, help="Map in place of the log's: a Nav2 map YAML beside its pgm or png."
)
@click.option("--frame", help="Frame that everything is brought into, in place of the map's.")
@click.option("--no-wrench", is_flag=True, help="Leave forces out, or do without them: contact is then unknown.")
@click.option("--wrench-frame", help="Frame that the wrench is given in, in place of its header's.")
@click.option(
    "--time",
    "time_source",
    type=Choice([source.value for source in TimeSource]),
    default=TimeSource.HEADER.value,
    show_default=True,
    help="When a message was measured: its header's stamp, or when the recorder got it.",
)
@click.option("--join", is_flag=True, help="Take all LOGs as pieces of one recording.")
@click.option("--strict", is_flag=True, help="Refuse a log of which something is lost.")
@json_option
@force_option
def extract(
    logs: tuple[Path, ...],
    output: Path,
    split: str,
    participant: str | None,
    robot_radius: float | None,
    resolution: float,
    rasterizer: str,
    people: tuple[tuple[float, float], ...],
    goal: tuple[float, float] | None,
    contact_force: float,
    wrench_filter: float,
    gain: bool,
    topics: tuple[tuple[str, str], ...],
    map_file: Path | None,
    frame: str | None,
    no_wrench: bool,
    wrench_frame: str | None,
    time_source: str,
    join: bool,
    strict: bool,
    as_json: bool,
    force: bool,
) -> None:
    """Turn MCAP logs into demonstrations.

    LOG is an MCAP file (also one compressed as a whole with zstd or lz4), a rosbag2 folder, a folder of recordings, or
    a pattern. Finds wrench, odometry, map, people, goals, joystick and tf by message type (navirl inspect shows what
    it would take), splits each log into trials, finds the intervals in which a person pushes, and puts each trial's
    path on the grid. The map should be the one in which the robot drove; a plain map is grown by the robot's radius, a
    costmap taken as it is.

    Of the wrench only the force is used, less the sensor's slowly changing bias and turned into the robot's base frame.
    A force does not depend on where the sensor sits; the torque does, by the lever arm, and is not used. A push on the
    robot's body that does not pass through the sensor is not seen.
    """
    if no_wrench and (gain or wrench_frame):
        raise click.UsageError("--no-wrench leaves nothing to --gain and --wrench-frame.")
    check_writable(output, force=force)
    settings = ExtractSettings(
        split=Split(split),
        resolution_m=resolution,
        robot_radius_m=robot_radius,
        rasterizer=Rule(rasterizer),
        push=PushSettings(begins_n=contact_force, cutoff_hz=wrench_filter),
        participant=participant,
        people_m=people or None,
        goal_m=goal,
        gain=gain,
    )
    options = LoadOptions(
        topics=topics_by_role(topics),
        time=TimeSource(time_source),
        frame=frame,
        wrench_frame=wrench_frame,
        occupancy=None if map_file is None else read_map(map_file),
        forces=Forces.IGNORED if no_wrench else Forces.NEEDED,
        strict=strict,
    )
    with bytes_bar("extract") as update:
        found = extract_recordings(logs, settings, options, join=join, progress=update)
    demonstrations = found.demonstrations()
    inputs = [*found.inputs, *([] if map_file is None else [Input.of(map_file)])]
    document = demonstrations_document(demonstrations, inputs, settings_document(settings, options, map_file))
    if gain:
        document["gain"] = gain_document([(result.log, result.gain) for result in found.extractions])
    write_json(output, "demonstrations", document, force=force)
    _echo(trial_table(demonstrations), document, as_json=as_json)
    for line in merged([*found.notes(demonstrations), *published_notes(found.extractions)]):
        say(line)
    finish(found.lost)


def _echo(trials: Table, document: Mapping[str, Any], *, as_json: bool) -> None:
    """The trials, and the gain where it was asked for."""
    if as_json:
        rows = trials.records()
        echo_json({"trials": rows, "gain": document["gain"]} if "gain" in document else rows)
    else:
        echo(to_text([trials, *([gain_table(document["gain"])] if document.get("gain") else [])]))
