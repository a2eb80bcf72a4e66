"""What ``navirl simulate`` and ``navirl import-study`` print of the logs that they wrote."""

from collections.abc import Iterable
from typing import Any

from navirl_cli.documents.tables import Column, Table
from navirl_cli.published.log import Imported
from navirl_cli.simulation.log import Simulated

_LOG, _TRIALS = Column("log"), Column("trials")
_SIZE = Column("size_bytes", "size MB", decimals=2, scale=1e-6)


def simulated_table(logs: Iterable[Simulated]) -> Table:
    """Simulated logs, one a row."""
    return Table((_LOG, _TRIALS, _SIZE), tuple((str(one.path), one.trials, one.size_bytes) for one in logs))


def imported_table(logs: Iterable[Imported]) -> Table:
    """Logs of published participants, one a row."""
    rows = []
    for one in logs:
        times = [f"{modality} {s:.1f} s" for modality, several in one.completion_s.items() for s in several]
        rows.append((str(one.path), one.trials, ", ".join(times) or "unknown", one.size_bytes))
    return Table((_LOG, _TRIALS, Column("completion_s", "course completed in"), _SIZE), tuple(rows))


def imported_document(logs: Iterable[Imported], lost: Iterable[str]) -> dict[str, Any]:
    """The same for programs, with what was lost."""
    written = [
        {
            "log": str(one.path),
            "participant": one.participant,
            "trials": one.trials,
            "completion_s": {modality: list(times) for modality, times in one.completion_s.items()},
            "size_bytes": one.size_bytes,
        }
        for one in logs
    ]
    return {"logs": written, "lost": list(lost)}
