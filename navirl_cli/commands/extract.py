"""``navirl extract``: logs to demonstrations."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.demonstrations import demonstrations_document, gain_document
from navirl_cli.artefacts.store import Input, write_json
from navirl_cli.commands.extract_report import gain_table, trial_row, trial_table
from navirl_cli.commands.shared import (
    FilePath,
    Number,
    Point,
    bytes_bar,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    say,
    topic_option,
    topics_by_role,
)
from navirl_cli.demos.contact import CUTOFF_HZ, PushSettings
from navirl_cli.demos.extract import Extraction, ExtractSettings, numbered
from navirl_cli.demos.extract import extract as extract_one
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.trials import Split
from navirl_cli.errors import DemonstrationError, LogError, NavirlError
from navirl_cli.files import check_writable
from navirl_cli.logs.clocks import TimeSource
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.map_file import read_map
from navirl_cli.logs.reader import Progress
from navirl_cli.logs.sources import Source, sources_of
from navirl_cli.parallel import map_in_order


@click.command()
@click.argument("logs", nargs=-1, required=True, type=FilePath)
@output_option("Demonstrations file to write.")
@click.option(
    "--split",
    type=click.Choice([split.value for split in Split]),
    default=Split.GOAL.value,
    show_default=True,
    help="Trials start at new goals, at rests, or the log is one trial.",
)
@click.option("--participant", help="Name in place of the log's or the file's.")
@click.option("--robot-radius", default=0.3, show_default=True, type=Number(0, 10), help="m; grows the map.")
@click.option("--resolution", default=0.1, show_default=True, type=Number(0.01, 2), help="Side of the cells, m.")
@click.option(
    "--rasterizer",
    type=click.Choice([rule.value for rule in Rule]),
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
@click.option("--wrench-frame", help="Frame that the wrench is given in, in place of its header's.")
@click.option(
    "--time",
    "time_source",
    type=click.Choice([source.value for source in TimeSource]),
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
    robot_radius: float,
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
        strict=strict,
    )
    good, failed = _all_extracted(logs, settings, options, join=join)
    results = [result for _, result in good]
    demonstrations = numbered(results)
    inputs = [file for files, _ in good for file in files] + ([] if map_file is None else [Input.of(map_file)])
    document = demonstrations_document(demonstrations, inputs, asdict(settings) | _said(options, map_file))
    if gain:
        document["gain"] = gain_document([(result.log, result.gain) for result in results])
    write_json(output, "demonstrations", document, force=force)
    rows = [trial_row(demonstration) for demonstration in demonstrations]
    if as_json:
        echo_json({"trials": rows, "gain": document["gain"]} if gain else rows)
    else:
        click.echo(trial_table(rows))
        if document.get("gain"):
            click.echo("\n" + gain_table(document["gain"]))
    for line in [note for result in results for note in result.notes]:
        say(line)
    for line in [f"{one.id}: {note}" for one in demonstrations for note in one.notes]:
        say(line)
    finish([*failed, *(line for result in results for line in (*result.damage, *result.skipped))])


def _said(options: LoadOptions, map_file: Path | None) -> dict[str, Any]:
    """What the user said about the log, as it is written down."""
    return {
        "topics": {role: list(names) for role, names in options.topics.items()},
        "time": options.time.value,
        "frame": options.frame,
        "wrench_frame": options.wrench_frame,
        "map": None if map_file is None else map_file.name,
    }


#: The hashes of a recording's files, and what came out of it.
_Result = tuple[tuple[Input, ...], Extraction]


def _all_extracted(
    logs: Sequence[Path], settings: ExtractSettings, options: LoadOptions, *, join: bool
) -> tuple[list[_Result], list[str]]:
    """What came out of each recording, and what is wrong with those of which nothing did."""
    refused: list[LogError] = []
    # where all are pieces of one recording none may be missing
    sources = sources_of(logs, join=join, refused=None if join else refused)
    good: dict[tuple[str, ...], _Result] = {}
    failed: list[NavirlError] = [*refused]
    sizes = [sum(path.stat().st_size for path in source.files) for source in sources]
    done = 0
    with bytes_bar("extract") as update:
        # a lone recording is read here, so that the bar can follow its bytes
        work = partial(_extracted, settings=settings, options=options, progress=update if len(sources) == 1 else None)
        for source, size, result in zip(sources, sizes, map_in_order(work, sources), strict=True):
            if isinstance(result, NavirlError):
                failed.append(result)
            elif (key := tuple(sorted(file.sha256 for file in result[0]))) in good:
                failed.append(DemonstrationError(f"{source.name}: the same recording as {good[key][1].log}"))
            else:
                good[key] = result
            done += size
            update(done, sum(sizes))
    if len(failed) == 1 and not good:
        raise failed[0]
    if not good:
        raise DemonstrationError("none of the logs can be used: " + "; ".join(str(error) for error in failed))
    return list(good.values()), [f"left out: {error}" for error in failed]


def _extracted(
    source: Source, settings: ExtractSettings, options: LoadOptions, progress: Progress | None
) -> _Result | NavirlError:
    """One recording's demonstrations, or why there are none: one bad log must not spoil the others."""
    try:
        with ThreadPoolExecutor(1) as pool:
            hashes = pool.submit(lambda: tuple(Input.of(path) for path in source.files))
            extraction = extract_one(load_recording(source, options, progress), settings)
            return hashes.result(), extraction
    except NavirlError as error:
        return error
