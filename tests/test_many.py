"""Many logs into a folder: what has not changed is not read again, and one bad log stops nothing."""

import pytest
from click.testing import CliRunner
from fleet_logs import copies

import navirl_cli as navirl
from navirl_cli.artefacts import many
from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.manifest import read_manifest
from navirl_cli.cli import cli
from navirl_cli.errors import ArtefactError, WorkerLostError


def run(*words, code=0):
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture
def logs(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    copies(folder, 3)
    return folder


def names_in(folder):
    return sorted(one.name for one in folder.iterdir())


def test_a_folder_holds_what_one_file_holds(logs, tmp_path):
    said = run("extract", logs, "-o", f"{tmp_path / 'demos'}/", "--workers", 1)
    assert "3 logs, 0 of them unchanged and not read again; 21 demonstrations." in said
    run("extract", logs, "-o", tmp_path / "demos.json", "--workers", 1)
    one, several = read_demonstrations(tmp_path / "demos.json"), read_demonstrations(tmp_path / "demos")
    assert [own.id for own in several] == [own.id for own in one]
    assert several == one
    assert read_demonstrations(tmp_path / "demos" / "manifest.json") == one
    assert list(navirl.read_demonstrations(tmp_path / "demos")) == one
    assert (
        navirl.read_demonstrations(tmp_path / "demos").inputs
        == navirl.read_demonstrations(tmp_path / "demos.json").inputs
    )
    for name in ("demos", "demos.json"):
        run("evaluate", tmp_path / name, "-o", tmp_path / f"{name}.csv")
    assert (tmp_path / "demos.csv").read_bytes() == (tmp_path / "demos.json.csv").read_bytes()


def test_only_new_changed_and_lost_logs_are_read_again(logs, tmp_path, monkeypatch):
    read = []
    real = many.extracted

    def watched(job, *args, **options):
        read.append(job[0].name)
        if job[0].name == "log0001.mcap" and len(read) < 4:
            return WorkerLostError("ended")
        return real(job, *args, **options)

    monkeypatch.setattr(many, "extracted", watched)
    (logs / "bad.mcap").write_text("{}")
    words = ("extract", logs, "-o", f"{tmp_path / 'demos'}/", "--workers", 1)
    said = run(*words, code=3)
    assert "left out: " in said
    assert "bad.mcap: expected an MCAP file, found JSON" in said
    assert "left out: log0001.mcap: ended" in said
    assert len(read) == 4
    (logs / "log0002.mcap").rename(logs / "copy")
    (logs / "log0002.mcap").write_bytes((logs / "copy").read_bytes())  # other times, the same bytes
    (logs / "copy").unlink()
    read.clear()
    read += ["", "", "", ""]
    said = run(*words, code=3)
    assert read[4:] == ["log0001.mcap"]
    assert "4 logs, 3 of them unchanged" in said
    (logs / "log0000.mcap").write_bytes((logs / "log0002.mcap").read_bytes())
    read.clear()
    read += ["", "", "", ""]
    said = run(*words, code=3)
    assert read[4:] == ["log0000.mcap"]
    assert "log0002.mcap: the same recording as" in said
    assert "found demonstrations of other ones" in run(*words, "--resolution", 0.2, code=1)
    run(*words, "--resolution", 0.2, "--force", code=3)


def test_names_and_order_do_not_depend_on_what_is_done_first(logs, tmp_path, monkeypatch):
    (logs / "below").mkdir()
    (logs / "below" / "log0000.mcap").write_bytes((logs / "log0001.mcap").read_bytes())
    run("extract", logs, "-o", f"{tmp_path / 'one'}/", "--workers", 1, code=3)
    real = many.as_completed
    monkeypatch.setattr(many, "as_completed", lambda *all_: reversed(list(real(*all_))))
    run("extract", logs, "-o", f"{tmp_path / 'other'}/", "--workers", 1, code=3)
    for name in names_in(tmp_path / "one"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes(), name
    assert names_in(tmp_path / "one") == names_in(tmp_path / "other")


def test_an_interrupt_keeps_what_is_finished(logs, tmp_path, monkeypatch):
    real = many.as_completed

    def interrupted(*all_):
        yield next(iter(real(*all_)))
        raise KeyboardInterrupt

    monkeypatch.setattr(many, "as_completed", interrupted)
    said = run("extract", logs, "-o", f"{tmp_path / 'demos'}/", "--workers", 1, code=130)
    assert said.endswith("navirl: 1 log done and kept: the same command goes on with the rest\nnavirl: interrupted\n")
    entries = read_manifest(tmp_path / "demos")
    assert [one.log for one in entries] == ["log0000.mcap"]
    assert len(read_demonstrations(tmp_path / "demos")) == 7


def test_a_file_that_the_manifest_does_not_name_so_is_refused(logs, tmp_path):
    run("extract", logs / "log0000.mcap", "-o", f"{tmp_path / 'demos'}/")
    file = tmp_path / "demos" / "log0000.json"
    file.write_bytes(file.read_bytes() + b"\n")
    with pytest.raises(ArtefactError, match=r"log0000.json: expected the bytes that the manifest names, found others"):
        read_demonstrations(tmp_path / "demos")
