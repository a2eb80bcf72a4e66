"""``navirl extract``: logs to demonstrations."""

from dataclasses import asdict
from functools import partial
from math import degrees, hypot
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import Input, write_json
from navirl_cli.commands.shared import (
    FilePath,
    Number,
    Pair,
    Point,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    progress_bar,
    say,
    text_table,
)
from navirl_cli.demos.contact import PushSettings
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import Extraction, ExtractSettings, numbered
from navirl_cli.demos.extract import extract as extract_one
from navirl_cli.demos.lines import path_length_m
from navirl_cli.demos.rasterize import Rule
from navirl_cli.demos.trials import Split
from navirl_cli.errors import DemonstrationError, NavirlError
from navirl_cli.files import check_writable
from navirl_cli.logs.load import load_recording
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
@click.option("--topic", "topics", multiple=True, type=Pair(), help="ROLE=/topic where several fit, e.g. wrench=/ft.")
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
    topics: tuple[tuple[str, str], ...],
    as_json: bool,
    force: bool,
) -> None:
    """Turn MCAP logs into demonstrations.

    Finds wrench, odometry, map, people, goals, joystick and tf by message type, splits each log into trials, finds the
    intervals in which a person pushes, and puts each trial's path on the grid. The map should be the one in which the
    robot drove; a plain map is grown by the robot's radius, a costmap taken as it is.
    """
    check_writable(output, force=force)
    settings = ExtractSettings(
        split=Split(split),
        resolution_m=resolution,
        robot_radius_m=robot_radius,
        rasterizer=Rule(rasterizer),
        push=PushSettings(begins_n=contact_force),
        participant=participant,
        people_m=people or None,
        goal_m=goal,
    )
    good, failed = _all_extracted(logs, settings, dict(topics))
    demonstrations = numbered(result for _, result in good)
    document = demonstrations_document(demonstrations, [source for source, _ in good], asdict(settings))
    write_json(output, "demonstrations", document, force=force)
    rows = [_row(demonstration) for demonstration in demonstrations]
    if as_json:
        echo_json(rows)
    else:
        click.echo(text_table(list(FORMATS), [[_shown(name, row[name]) for name in FORMATS] for row in rows]))
    for _, result in good:
        for note in result.notes:
            say(note)
    for one in demonstrations:
        for note in one.notes:
            say(f"{one.id}: {note}")
    finish([*failed, *(line for _, result in good for line in (*result.damage, *result.skipped))])


def _all_extracted(
    logs: tuple[Path, ...], settings: ExtractSettings, topics: dict[str, str]
) -> tuple[list[tuple[Input, Extraction]], list[str]]:
    """What came out of each log, and what is wrong with those of which nothing did."""
    good: dict[str, tuple[Input, Extraction]] = {}
    failed: list[NavirlError] = []
    work = partial(_extracted, settings=settings, topics=topics)
    with progress_bar("extract", len(logs)) as update:
        for number, (log, result) in enumerate(zip(logs, map_in_order(work, logs), strict=True), start=1):
            if isinstance(result, NavirlError):
                failed.append(result)
            elif result[0].sha256 in good:
                failed.append(DemonstrationError(f"{log}: the same recording as {good[result[0].sha256][0].file}"))
            else:
                good[result[0].sha256] = result
            update(number, log.name)
    if len(failed) == 1 and not good:
        raise failed[0]
    if not good:
        raise DemonstrationError("none of the logs can be used: " + "; ".join(str(error) for error in failed))
    return list(good.values()), [f"left out: {error}" for error in failed]


def _extracted(log: Path, settings: ExtractSettings, topics: dict[str, str]) -> tuple[Input, Extraction] | NavirlError:
    """One log's demonstrations, or why there are none: one bad log must not spoil the others."""
    try:
        return Input.of(log), extract_one(load_recording(log, topics), settings)
    except NavirlError as error:
        return error


#: Columns of the table, and how their numbers are written.
FORMATS = {
    "trial": "",
    "condition": "",
    "cycle": "d",
    "duration s": ".1f",
    "length m": ".2f",
    "cells": "d",
    "contacts": "d",
    "contact %": ".0f",
    "peak N": ".1f",
    "impulse Ns": ".1f",
    "direction deg": ".0f",
}


def _row(d: Demonstration) -> dict[str, Any]:
    """One trial of the table."""
    strongest = max(d.contacts, key=lambda contact: hypot(*contact.impulse_ns), default=None)
    values = (
        d.id,
        d.condition.value,
        d.cycle,
        d.duration_s,
        path_length_m(d.xy_m),
        len(d.cells),
        len(d.contacts),
        100 * d.contact_s / d.duration_s,
        max((contact.peak_n for contact in d.contacts), default=None),
        sum(hypot(*contact.impulse_ns) for contact in d.contacts),
        None if strongest is None else degrees(strongest.direction_rad),
    )
    return dict(zip(FORMATS, values, strict=True))


def _shown(name: str, value: Any) -> str:
    return "-" if value is None else format(value, FORMATS[name])
