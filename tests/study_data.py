"""The published study, where it is available."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.demos.grid import Grid
from navirl_cli.published.participant import participant_of
from navirl_cli.published.runs import runs_in

ROOT = Path(os.environ.get("NAVIRL_STUDY_DIR") or Path(__file__).parents[2] / "shared" / "study")
REASON = f"the published study's data are not at hand in {ROOT} (see NAVIRL_STUDY_DIR)"


@dataclass(frozen=True)
class Published:
    """One demonstration as published."""

    xy_m: NDArray[np.float64]
    people_m: NDArray[np.float64]
    cells: NDArray[np.int64]
    grid: Grid


def expected() -> dict[str, Any]:
    return json.loads((ROOT / "expected.json").read_text())


def published(run: str) -> dict[str, list[Published]]:
    """Demonstrations of one participant by "file/list", as in expected.json."""
    (files,), _ = runs_in(ROOT / "runs" / run)
    participant = participant_of(files)
    grid = participant.grid
    found: dict[str, list[Published]] = {}
    for path in participant.paths:
        name, _, _ = path.name.rpartition("/")
        found.setdefault(name, []).append(Published(path.xy_m, grid.centres_of(path.people), path.cells, grid))
    return found
