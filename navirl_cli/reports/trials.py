"""The table of trials that ``navirl inspect --trials`` writes to be filled in."""

from collections.abc import Iterable

from navirl_cli.demos.labels import COLUMNS, points_text
from navirl_cli.demos.listing import FoundTrial
from navirl_cli.documents.tables import Column, Table

_DECIMALS = {"start_s": 3, "duration_s": 1, "length_m": 2, "contact_s": 1}


def trials_table(trials: Iterable[FoundTrial]) -> Table:
    """One row for each trial: where it stands, how it looks, and what the log states of it."""
    rows = []
    for one in trials:
        known = one.declared
        rows.append(
            (
                one.log,
                one.number,
                *(None if value is None else round(value, _DECIMALS[name]) for name, value in _measured(one).items()),
                known.participant,
                known.condition,
                known.cycle,
                known.set,
                one.robot_radius_m,
                None if known.people_m is None else points_text(known.people_m),
                None if known.nominal_m is None else points_text(known.nominal_m),
            )
        )
    return Table(tuple(Column(name, decimals=_DECIMALS.get(name)) for name in COLUMNS), tuple(rows))


def _measured(one: FoundTrial) -> dict[str, float | None]:
    """The numbers that help to recognise a trial."""
    return {
        "start_s": one.start_s,
        "duration_s": one.duration_s,
        "length_m": one.length_m,
        "contact_s": one.contact_s,
    }
