"""Small logs that go wrong, from the folder that is shared with other projects; tests skip where it is absent."""

from pathlib import Path

import pytest

CASES = Path(__file__).resolve().parents[2] / "shared" / "cases"


def case(name: str) -> Path:
    """One of them."""
    path = CASES / f"{name}.mcap"
    if not path.exists():
        pytest.skip(f"no {path.name} in ../shared/cases")
    return path
