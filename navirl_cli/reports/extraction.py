"""The tables of ``navirl extract``."""

from collections.abc import Iterable, Sequence
from math import degrees, hypot
from typing import Any

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import Extraction
from navirl_cli.demos.lines import path_length_m
from navirl_cli.documents.tables import text_table

#: Columns of the table, and how their numbers are written.
FORMATS = {
    "trial": "",
    "condition": "",
    "cycle": "d",
    "set": "",
    "duration s": ".1f",
    "length m": ".2f",
    "cells": "d",
    "contacts": "d",
    "contact %": ".0f",
    "peak N": ".1f",
    "impulse Ns": ".1f",
    "direction deg": ".0f",
}


def trial_row(d: Demonstration) -> dict[str, Any]:
    """One trial of the table, by its columns."""
    contacts = d.contacts or ()
    strongest = max(contacts, key=lambda contact: hypot(*contact.impulse_n_s), default=None)
    values = (
        d.id,
        d.condition.value,
        d.cycle,
        d.set,
        None if d.laid_out_m_s is not None else d.duration_s,
        path_length_m(d.xy_m),
        len(d.cells),
        None if d.contacts is None else len(d.contacts),
        None if d.contact_s is None else 100 * d.contact_s / d.duration_s,
        max((contact.peak_force_n for contact in contacts), default=None),
        None if d.contacts is None else sum(hypot(*contact.impulse_n_s) for contact in contacts),
        None if strongest is None else degrees(strongest.direction_rad),
    )
    return dict(zip(FORMATS, values, strict=True))


def trial_table(rows: Sequence[dict[str, Any]]) -> str:
    """The trials, one a line."""
    return text_table(list(FORMATS), [[_shown(name, row[name]) for name in FORMATS] for row in rows])


def _shown(name: str, value: Any) -> str:
    return "-" if value is None else format(value, FORMATS[name])


#: Columns of the table of gains: field, heading and how its numbers are written.
GAIN_FORMATS = (
    ("m_s_per_n", "gain m/s/N", ".4g"),
    ("standard_error", "standard error", ".2g"),
    ("pushes", "pushes", "d"),
    ("delay_s", "delay s", ".2f"),
)


def gain_table(gain: dict[str, Any]) -> str:
    """The gain of each log, and of all together where there are several."""
    lines = [*gain["logs"], *([{"log": "all", **gain}] if len(gain["logs"]) > 1 else [])]
    rows = [[line["log"], *(format(line[field], style) for field, _, style in GAIN_FORMATS)] for line in lines]
    return text_table(["log", *(heading for _, heading, _ in GAIN_FORMATS)], rows)


def published_notes(results: Iterable[Extraction]) -> list[str]:
    """How many paths have the cells that were published with their log."""
    notes = []
    for result in results:
        other = [name for name, same in result.published.items() if not same]
        if result.published:
            told = f"; not those of {', '.join(other)}" if other else ""
            total = len(result.published)
            notes.append(f"{result.log}: cells as published with it: {total - len(other)} of {total} paths{told}")
    return notes
