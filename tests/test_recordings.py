"""Several recordings at once: a bad one does not spoil the others, and what is lost is listed."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from shutil import copy

import pytest

from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.recordings import extract_recordings
from navirl_cli.errors import NavirlError
from navirl_cli.files import Input
from navirl_cli.logs.load import LoadOptions

LOGS = Path(__file__).parent.parent / "sample_logs"


def extracted(*logs, **options):
    return extract_recordings(logs, ExtractSettings(), LoadOptions(), **options)


def test_recordings_keep_the_order_of_the_arguments_and_the_hashes_of_their_files():
    with ThreadPoolExecutor(2) as pool:
        found = extracted(LOGS / "p02.mcap", str(LOGS / "p01.mcap"), executor=pool)
    assert [one.log for one in found.extractions] == ["p02.mcap", "p01.mcap"]
    assert found.inputs == (Input.of(LOGS / "p02.mcap"), Input.of(LOGS / "p01.mcap"))
    assert [one.id for one in found.demonstrations()][::7] == ["p02/1", "p01/1"]
    assert found.lost == []


def test_a_bad_and_a_repeated_recording_are_listed_beside_a_good_one(tmp_path):
    copy(LOGS / "p01.mcap", tmp_path / "again.mcap")
    (tmp_path / "broken.mcap").write_bytes(b"no log at all")
    with ThreadPoolExecutor(2) as pool:
        found = extracted(LOGS / "p01.mcap", tmp_path / "again.mcap", tmp_path / "broken.mcap", executor=pool)
    assert len(found.demonstrations()) == 7
    assert len(found.lost) == 2
    assert "again.mcap: the same recording as p01.mcap" in found.lost[0]
    assert "broken.mcap" in found.lost[1]


def test_the_error_of_a_lone_bad_recording_is_its_own(tmp_path):
    (tmp_path / "broken.mcap").write_bytes(b"no log at all")
    with pytest.raises(NavirlError, match=r"^\S*broken\.mcap"):
        extracted(tmp_path / "broken.mcap")


def test_progress_ends_at_all_bytes():
    calls = []
    extracted(LOGS / "p01.mcap", progress=lambda done, total: calls.append((done, total)))
    assert calls[-1] == ((LOGS / "p01.mcap").stat().st_size,) * 2
