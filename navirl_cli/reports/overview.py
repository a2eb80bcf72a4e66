"""What ``navirl inspect`` reports: the content of a log, and the topics that extract would use."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.documents.document import Block, Bullets, Heading
from navirl_cli.documents.tables import Cell, Column, Table
from navirl_cli.errors import NavirlError, counted
from navirl_cli.logs.overview import Flow, Overview
from navirl_cli.logs.roles.clocks import EARLIEST_NS, NS_PER_S
from navirl_cli.logs.roles.topics import short_name

_FLOW = (
    Column("topic"),
    Column("type"),
    Column("messages"),
    Column("rate_hz", "rate Hz", decimals=2),
    Column("gaps"),
    Column("longest_gap_s", "longest s", decimals=1),
    Column("longest_gap_at_s", "at s", decimals=1),
    Column("stamp_lead_s", "stamp lead s", decimals=3, sign=True),
)
_BRIEF = (
    "only the summary was read, in a few requests to the store: rates, gaps, clocks, frames, damage in chunks, and "
    "whether extract refuses the log, are not known; `check` reads all of it"
)
_ROLE = (Column("role"), Column("topic"), Column("reason"))


def overview_report(view: Overview) -> list[Block]:
    """A recording: name, size, time, topics, and the role of each topic."""
    lines = [_duration(view), *view.findings]
    lines += [f"frames: {view.frames}"] if view.frames else []
    flows = tuple(_flow(flow, view.reference_s) for flow in view.flows)
    roles = tuple(
        (name, ", ".join(topic.name for topic in choice.topics), choice.reason)
        for name, choice in view.choices.items()
        if choice.topics
    )
    tables = [Table(columns, rows).without_empty() for columns, rows in ((_FLOW, flows), (_ROLE, roles)) if rows]
    return [Heading(_name(view)), Bullets(tuple(lines)), *tables, *_verdict(view, _outcome(view))]


def _flow(flow: Flow, reference_s: float) -> tuple[Cell, ...]:
    """A row of the table of topics."""
    return (
        flow.topic.name,
        short_name(flow.topic.type_name),
        flow.topic.count,
        flow.rate_hz,
        flow.gaps,
        flow.longest_s if flow.gaps else None,
        flow.longest_at_s if flow.gaps else None,
        None if flow.offset_s is None else flow.offset_s - reference_s,
    )


@dataclass(frozen=True)
class _Outcome:
    """What an extraction with its defaults makes of a recording."""

    demonstrations: int
    #: Why trials, or the whole log, are left out, in words.
    reasons: tuple[str, ...]


def _outcome(view: Overview) -> _Outcome:
    """The extraction itself is asked, so that nothing is promised that it refuses."""
    if view.needed or view.refusals or view.line.recording is None:
        return _Outcome(0, view.refusals)
    try:
        found = extract(view.line.recording, ExtractSettings())
    except NavirlError as error:
        return _Outcome(0, (str(error),))
    return _Outcome(len(found.demonstrations), found.skipped)


def _verdict(view: Overview, outcome: _Outcome) -> list[Block]:
    """Whether extract can use the log, why not, and the missing roles, those that are needed first."""
    missing = {name: choice.problem for name, choice in view.choices.items() if not choice.topics}
    order = sorted(missing, key=lambda name: name not in view.needed)
    if view.needed:
        verdict = f"extract needs: {', '.join(view.needed)}"
    else:
        verdict = "extract has what it needs" if outcome.demonstrations else "extract refuses this log"
    if view.is_brief and not view.needed:
        verdict = "extract has the topics that it needs"
    count = outcome.demonstrations
    found = [_BRIEF] if view.is_brief else []
    found += [f"{counted(count, 'trial')}, each a demonstration"] if count else []
    return [Heading(verdict), Bullets((*found, *outcome.reasons, *(missing[name] for name in order)))]


def _name(view: Overview) -> str:
    """Name, files, size and recorder."""
    size = sum(path.stat().st_size for path in view.source.files)
    files = f"{len(view.source.files)} files, " if len(view.source.files) > 1 else ""
    libraries = ", ".join(dict.fromkeys(one.library or "unknown recorder" for one in view.contents))
    return f"{view.source.name}: {files}{size / 1e6:.1f} MB, {libraries}"


def _duration(view: Overview) -> str:
    """Start, duration and number of messages."""
    if view.start_ns is None or view.end_ns is None:
        return "no messages"
    duration = (view.end_ns - view.start_ns) / NS_PER_S
    return f"{_when(view.start_ns)}, {duration:.1f} s, {counted(sum(f.topic.count for f in view.flows), 'message')}"


def _when(t_ns: int) -> str:
    """A time of receipt, as a date if the clock counts from 1970."""
    try:
        if t_ns > EARLIEST_NS:
            return f"{datetime.fromtimestamp(t_ns / NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError):
        pass
    return f"from {t_ns / NS_PER_S:.2f} s on"


def overview_document(view: Overview) -> dict[str, Any]:
    """A recording as JSON."""
    outcome = _outcome(view)
    return {
        "log": view.source.name,
        "files": [
            {
                "file": one.path.name,
                "profile": one.profile,
                "library": one.library,
                "size_bytes": one.path.stat().st_size,
            }
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
        "findings": list(view.findings),
        "frames": view.frames or None,
        "needed": list(view.needed),
        "refusals": [] if view.needed or outcome.demonstrations else list(outcome.reasons),
        "demonstrations": None if view.is_brief else outcome.demonstrations,
        "summary_only": view.is_brief,
        "left_out": list(outcome.reasons) if outcome.demonstrations else [],
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
        "gaps": flow.gaps,
        "longest_gap_s": flow.longest_s if flow.gaps else None,
        "longest_gap_at_s": flow.longest_at_s if flow.gaps else None,
        "stamp_minus_receipt_s": flow.offset_s,
    }
