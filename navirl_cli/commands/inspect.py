"""``navirl inspect``: what a log holds."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from navirl_cli.commands.shared import (
    FilePath,
    bytes_bar,
    echo,
    echo_json,
    finish,
    json_option,
    say,
    topic_option,
    topics_by_role,
)
from navirl_cli.documents.tables import text_table
from navirl_cli.errors import LogError
from navirl_cli.logs.overview import Flow, Overview, overview
from navirl_cli.logs.roles.clocks import EARLIEST_NS, NS_PER_S
from navirl_cli.logs.roles.topics import short_name
from navirl_cli.logs.sources import sources_of


@click.command()
@click.argument("logs", nargs=-1, required=True, type=FilePath)
@topic_option
@click.option("--check", is_flag=True, help="Read every message: damage inside of chunks shows only then.")
@json_option
def inspect(logs: tuple[Path, ...], topics: tuple[tuple[str, str], ...], check: bool, as_json: bool) -> None:
    """Tell what logs hold, and what extract would make of it.

    LOG is an MCAP file, a bag folder, a folder of recordings, or a pattern. Duration, clocks, damage, and every topic
    with its type, number of messages, rate and silences; then the topics that extract would take, and what is missing
    and how to supply it. A silence is a pause of a regular topic, five times as long as usual and half a second at
    least; the rate leaves silences out. The stamp lead is a header's stamp less its receipt, against the odometry's:
    near 0 on one clock; tf is often stamped a second ahead on purpose.
    """
    refused: list[LogError] = []
    views = []
    with bytes_bar("inspect") as update:
        for source in sources_of(logs, refused=refused):
            try:
                views.append(overview(source, topics_by_role(topics), check=check, progress=update))
            except LogError as error:
                refused.append(error)
    if refused and not views:
        raise refused[0]
    if as_json:
        echo_json([_document(view) for view in views])
    else:
        echo("\n\n".join(_text(view) for view in views))
    for view in views:
        for note in view.source.notes:
            say(note)
    finish([*map(str, refused), *(line for view in views for line in view.damage)])


def _text(view: Overview) -> str:
    """A recording as a reader wants it."""
    flows = [
        (
            flow.topic.name,
            short_name(flow.topic.type_name),
            str(flow.topic.count),
            "-" if flow.rate_hz is None else f"{flow.rate_hz:.3g}",
            f"{flow.gaps}, {flow.longest_s:.1f} s at {flow.longest_at_s:.1f} s" if flow.gaps else "-",
            "-" if flow.offset_s is None else f"{flow.offset_s - view.reference_s:+.3f}",
        )
        for flow in view.flows
    ]
    roles = [
        (name, ", ".join(topic.name for topic in choice.topics), choice.reason)
        for name, choice in view.choices.items()
        if choice.topics
    ]
    parts = ["\n".join([_heading(view), *(f"clock: {line}" for line in view.clocks)])]
    if view.frames:
        parts[0] += f"\nframes: {view.frames}"
    if flows:
        parts.append(text_table(["topic", "type", "messages", "Hz", "silences", "stamp lead s"], flows))
    if roles:
        parts.append(text_table(["role", "topic", "why"], roles))
    verdict = f"extract needs: {', '.join(view.needed)}" if view.needed else "extract has what it needs"
    absent = {name: choice.problem for name, choice in view.choices.items() if not choice.topics}
    order = sorted(absent, key=lambda name: name not in view.needed)
    parts.append("\n".join([verdict, *(f"- {absent[name]}" for name in order)]))
    return "\n\n".join(parts)


def _heading(view: Overview) -> str:
    """Name, files, size and time."""
    size = sum(path.stat().st_size for path in view.source.files)
    files = f"{len(view.source.files)} files, " if len(view.source.files) > 1 else ""
    libraries = ", ".join(dict.fromkeys(one.library or "unknown recorder" for one in view.contents))
    heading = f"{view.source.name}: {files}{size / 1e6:.1f} MB, {libraries}"
    if view.start_ns is None or view.end_ns is None:
        return f"{heading}\nno messages"
    duration = (view.end_ns - view.start_ns) / NS_PER_S
    return f"{heading}\n{_when(view.start_ns)}, {duration:.1f} s, {sum(f.topic.count for f in view.flows)} messages"


def _when(t_ns: int) -> str:
    """A time of receipt: a date, where the clock counts from 1970."""
    try:
        if t_ns > EARLIEST_NS:
            return f"{datetime.fromtimestamp(t_ns / NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError):
        pass
    return f"from {t_ns / NS_PER_S:.2f} s on"


def _document(view: Overview) -> dict[str, Any]:
    """A recording as JSON."""
    return {
        "log": view.source.name,
        "files": [
            {"file": one.path.name, "profile": one.profile, "library": one.library, "bytes": one.path.stat().st_size}
            for one in view.contents
        ],
        "start_ns": view.start_ns,
        "end_ns": view.end_ns,
        "topics": [_flow_document(flow) for flow in view.flows],
        "roles": {
            name: {
                "topics": [topic.name for topic in choice.topics],
                "reason": choice.reason or None,
                "problem": choice.problem or None,
            }
            for name, choice in view.choices.items()
        },
        "clocks": list(view.clocks),
        "frames": view.frames or None,
        "needed": list(view.needed),
        "notes": list(view.source.notes),
        "damage": list(view.damage),
    }


def _flow_document(flow: Flow) -> dict[str, Any]:
    return {
        "topic": flow.topic.name,
        "type": flow.topic.type_name,
        "encoding": flow.encoding,
        "messages": flow.topic.count,
        "start_ns": flow.start_ns,
        "end_ns": flow.end_ns,
        "rate_hz": flow.rate_hz,
        "silences": flow.gaps,
        "longest_silence_s": flow.longest_s if flow.gaps else None,
        "stamp_minus_receipt_s": flow.offset_s,
    }
