"""Logs in object stores: only what is needed is fetched, and faults of networks change no result."""

import json
import os
import pickle
import re
import urllib.request
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from fleet_logs import SAMPLES
from mcap.writer import CompressionType, Writer
from range_server import serving

from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.cli import cli
from navirl_cli.errors import LogError, MissingPackageError
from navirl_cli.logs.container.log_file import LogFile
from navirl_cli.logs.container.remote_file import RemoteFile, _joined
from navirl_cli.logs.messages.reader import read
from navirl_cli.remote import Remote, _store, path_of

#: Not imported before these tests run: beside obstore, processes do not begin as copies, and import everything anew.
pytestmark = pytest.mark.skipif(find_spec("obstore") is None, reason="needs navirl[remote]")
LOG = SAMPLES[0].read_bytes()


def run(*words, code=0):
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    monkeypatch.setattr("navirl_cli.remote._RETRIES_S", (0.0, 0.0, 0.0))


@pytest.fixture
def store():
    with serving(**{"p01.mcap": LOG}) as own:
        yield own


def test_an_address_is_a_path_that_shows_no_query():
    path = path_of("https://host/a/p01.mcap?X-Amz-Signature=secret")
    assert isinstance(path, Remote)
    assert (str(path), path.name, path.suffix) == ("https://host/a/p01.mcap", "p01.mcap", ".mcap")
    assert "secret" not in repr(path)
    assert path.address == "https://host/a/p01.mcap?X-Amz-Signature=secret"
    again = pickle.loads(pickle.dumps(path))
    assert (type(again), again.address) == (Remote, path.address)
    assert str(path_of("s3://bucket/folder/") / "p01.mcap") == "s3://bucket/folder/p01.mcap"
    assert path_of("s3://bucket/folder/").is_dir()
    assert not isinstance(path_of("file:///tmp/p01.mcap"), Remote)
    assert not isinstance(path_of(Path("logs")), Remote)


def test_neighbours_are_one_request_and_little_between_them_is_fetched():
    assert _joined([(0, 1000), (1000, 3000), (3100, 5000)]) == [(0, 5000)]
    assert _joined([(0, 1000), (1500, 1600)]) == [(0, 1000), (1500, 1600)]
    assert _joined([(0, 5 << 20), (5 << 20, 10 << 20)]) == [(0, 5 << 20), (5 << 20, 10 << 20)]
    rng = np.random.default_rng(0)
    ends = np.cumsum(rng.integers(1, 100_000, 400)).tolist()
    ranges = list(zip(ends[::2], ends[1::2], strict=True))
    blocks = _joined(ranges)
    assert sum(stop - start for start, stop in blocks) <= 1.2 * sum(stop - start for start, stop in ranges)
    assert all(any(a <= start and stop <= b for a, b in blocks) for start, stop in ranges)


def test_an_address_gives_the_demonstrations_of_the_file(store, tmp_path):
    said = run("extract", f"{store.url}/p01.mcap?token=secret", "-o", tmp_path / "there.json")
    assert f"MB were fetched in {len(store.asked)} requests" in said
    assert "secret" not in said
    run("extract", SAMPLES[0], "-o", tmp_path / "here.json")
    assert read_demonstrations(tmp_path / "there.json") == read_demonstrations(tmp_path / "here.json")
    store.asked.clear()
    assert "extract has what it needs" in run("inspect", f"{store.url}/p01.mcap")
    assert len(store.asked) < 20
    assert store.sent < 3 * len(LOG)


def test_broken_connections_and_busy_servers_change_nothing(store):
    expected = read(SAMPLES[0], {"/odom": ("pose.pose.position.x",)}).series["/odom"]
    store.cuts, store.busy = 2, 2
    found = read(path_of(f"{store.url}/p01.mcap"), {"/odom": ("pose.pose.position.x",)}).series["/odom"]
    assert store.cuts == store.busy == 0
    np.testing.assert_array_equal(found.columns["pose.pose.position.x"], expected.columns["pose.pose.position.x"])


def test_an_object_that_is_replaced_meanwhile_is_noticed(store, tmp_path):
    store.replaced_after = 3
    said = run("extract", f"{store.url}/p01.mcap", "-o", tmp_path / "demos.json", code=1)
    assert "expected the object with etag" in said
    assert "it was replaced meanwhile: run the command again" in said


@pytest.mark.parametrize(
    ("name", "refusal", "message"),
    [
        ("none.mcap", None, "expected an MCAP file, found no file there; check the path"),
        ("p01.mcap", 403, "expected the right to read it, found that the store refuses; check the credentials"),
        (
            "p01.mcap?sig=secret",
            403,
            "expected the right to read it, found that the store refuses; the link may have expired",
        ),
    ],
)
def test_a_refusal_names_its_remedy_and_no_secret(store, tmp_path, name, refusal, message):
    store.refusal = refusal
    said = run("extract", f"{store.url}/{name}", "-o", tmp_path / "demos.json", code=1)
    assert f"{store.url}/{name.partition('?')[0]}: {message}" in said
    assert "secret" not in said


def test_a_missing_object_shows_no_query(store):
    with pytest.raises(FileNotFoundError) as error:
        path_of(f"{store.url}/none.mcap?sig=secret").stat()
    assert "secret" not in str(error.value)
    assert error.value.strerror == "the store has no such object"


@pytest.fixture
def clouds(monkeypatch, tmp_path):
    """Buckets of Google and Azure on loopback, by what their libraries offer for emulators: no real store is asked."""
    _store.cache_clear()
    monkeypatch.setattr("navirl_cli.remote._allows_http", lambda _root: True)
    monkeypatch.setattr("navirl_cli.remote._ATTEMPTS", 0)
    with serving(**{f"{account}lab/p01.mcap": LOG for account in ("", "account/")}) as own:
        account = {"gcs_base_url": own.url, "disable_oauth": True, "client_email": "", "private_key": "do-not-show"}
        (tmp_path / "account.json").write_text(json.dumps({**account, "private_key_id": ""}))
        for name, value in {
            "GOOGLE_SERVICE_ACCOUNT": tmp_path / "account.json",
            "AZURE_STORAGE_USE_EMULATOR": "true",
            "AZURITE_BLOB_STORAGE_URL": own.url,
            "AZURE_STORAGE_ACCOUNT_NAME": "account",
        }.items():
            monkeypatch.setenv(name, str(value))
        yield own
    _store.cache_clear()


@pytest.mark.parametrize("scheme", ["gs", "az"])
def test_buckets_of_google_and_azure_are_read_by_ranges(clouds, tmp_path, scheme):
    run("extract", f"{scheme}://lab/p01.mcap", "-o", tmp_path / "there.json")
    run("extract", SAMPLES[0], "-o", tmp_path / "here.json")
    assert read_demonstrations(tmp_path / "there.json") == read_demonstrations(tmp_path / "here.json")
    assert all(span for method, _, span in clouds.asked if method == "GET")
    said = run("extract", f"{scheme}://lab/none.mcap", "-o", tmp_path / "x.json", code=1)
    assert "found no file there; check the path" in said
    clouds.refusal = 403
    said = run("extract", f"{scheme}://lab/p01.mcap", "-o", tmp_path / "x.json", code=1)
    assert "expected the right to read it, found that the store refuses; check the credentials" in said
    assert "do-not-show" not in said


@pytest.mark.parametrize(
    ("address", "variable", "value", "message"),
    [
        (
            "az://lab/p01.mcap",
            "AZURE_STORAGE_ACCOUNT_KEY",
            "do not show",
            "expected valid credentials in AZURE_STORAGE",
        ),
        (
            "gs://lab/p01.mcap",
            "GOOGLE_SERVICE_ACCOUNT",
            "do-not-show.json",
            "expected valid credentials in GOOGLE_APPL",
        ),
        ("az://lab/p01.mcap", None, None, r"expected credentials .*AZURE_STORAGE_ACCOUNT_NAME .* found none; set them"),
    ],
)
def test_wrong_credentials_name_their_variable_and_are_not_shown(monkeypatch, address, variable, value, message):
    for name in list(os.environ):
        if name.startswith(("AZURE", "GOOGLE")):
            monkeypatch.delenv(name)
    if variable is not None:
        monkeypatch.setenv("AZURE_STORAGE_ACCOUNT_NAME", "account")
        monkeypatch.setenv(variable, value)
    _store.cache_clear()
    with pytest.raises(LogError, match=message) as error:
        path_of(address).stat()
    assert "show" not in str(error.value)


def test_a_manifest_does_not_ask_for_an_unchanged_object_again(store, tmp_path):
    words = ("extract", f"{store.url}/p01.mcap", "-o", f"{tmp_path / 'demos'}/")
    run(*words)
    store.asked.clear()
    said = run(*words)
    assert "1 of them unchanged and not read again" in said
    assert "were fetched" not in said
    assert [method for method, _, _ in store.asked] == ["HEAD"]
    store.objects["/p01.mcap"] = SAMPLES[1].read_bytes()
    assert "0 of them unchanged" in run(*words)


def test_chunks_of_cameras_are_not_fetched(tmp_path):
    path = tmp_path / "camera.mcap"
    rng = np.random.default_rng(0)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=100_000, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("S", "jsonschema", b"{}")
        small, camera = (writer.register_channel(topic, "json", schema) for topic in ("/small", "/camera"))
        for second in range(10):
            for n in range(40):
                data = json.dumps({"x": n, "s": "a" * 4000}).encode()
                writer.add_message(small, second * 10**9 + n, data, second * 10**9 + n)
            for n in range(10):
                writer.add_message(camera, second * 10**9 + 100 + n, rng.bytes(200_000), second * 10**9 + 100 + n)
        writer.finish()
    with LogFile(path) as log:
        chunks = [one.stop - one.start for one in log.summary.chunks.values() if small in one.message_indexes]
    with serving(**{"camera.mcap": path.read_bytes()}) as store:
        found = read(path_of(f"{store.url}/camera.mcap"), {"/small": ("x",)}).series["/small"]
        assert len(found.columns["x"]) == 400
        assert store.sent < 1.3 * sum(chunks) + (1 << 18)
        assert store.sent < 0.2 * path.stat().st_size


def test_a_large_log_is_inspected_by_its_summary(tmp_path):
    path = tmp_path / "mixed.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=400_000, compression=CompressionType.NONE)
        writer.start()
        small = writer.register_channel("/small", "json", writer.register_schema("S", "jsonschema", b"{}"))
        for n in range(2001):
            writer.add_message(small, n * 10**7, json.dumps({"x": "a" * 4000}).encode(), n * 10**7)
        writer.finish()
    with serving(**{"mixed.mcap": path.read_bytes()}) as store:
        said = run("inspect", f"{store.url}/mixed.mcap")
        assert len(store.asked) < 20
        assert store.sent < 400_000
        assert "only the summary was read" in said
        assert re.search(r"/small +S +2001\n", said)
        assert "20.0 s, 2001 messages" in said
        brief = json.loads(run("inspect", f"{store.url}/mixed.mcap", "--json"))["logs"][0]
        assert brief["summary_only"] is True
        assert brief["demonstrations"] is brief["topics"][0]["gaps"] is None
        full = json.loads(run("inspect", f"{store.url}/mixed.mcap", "--json", "--check"))["logs"][0]
        assert full["summary_only"] is False
        assert full["topics"][0]["gaps"] == 0
    assert "only the summary" not in run("inspect", path)


def test_a_compressed_object_is_read_as_a_whole(tmp_path):
    import zstandard

    with serving(**{"p01.mcap.zst": zstandard.compress(LOG)}) as store:
        run("extract", f"{store.url}/p01.mcap.zst", "-o", tmp_path / "there.json")
    run("extract", SAMPLES[0], "-o", tmp_path / "here.json")
    assert len(read_demonstrations(tmp_path / "there.json")) == len(read_demonstrations(tmp_path / "here.json"))


def test_blocks_are_forgotten_but_never_wrong(store, monkeypatch):
    monkeypatch.setattr("navirl_cli.logs.container.remote_file._KEPT", 100_000)
    rng = np.random.default_rng(1)
    with RemoteFile(path_of(f"{store.url}/p01.mcap")) as raw:
        raw.plan([(at, at + 50_000) for at in range(0, 1_000_000, 90_000)])
        for start in rng.integers(0, len(LOG), 60).tolist():
            assert raw.read(start, start + 3000) == LOG[start : start + 3000]


def test_obstore_that_is_not_installed_is_named_with_its_remedy(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "obstore", None)
    with pytest.raises(MissingPackageError, match=r"install it: pip install 'navirl\[remote\]'"):
        path_of("s3://bucket/p01.mcap").stat()


@pytest.mark.slow
def test_a_bucket_lists_reads_and_refuses(tmp_path, monkeypatch):
    moto = pytest.importorskip("moto.server", reason="needs moto[server]")
    obstore = pytest.importorskip("obstore")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    try:
        for name, value in {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": "key",
            "AWS_SECRET_ACCESS_KEY": "do-not-show",
            "AWS_REGION": "us-east-1",
        }.items():
            monkeypatch.setenv(name, value)
        request = urllib.request.Request(f"http://{host}:{port}/bucket", method="PUT")
        urllib.request.urlopen(request).close()  # noqa: S310
        there = obstore.store.S3Store("bucket", client_options={"allow_http": True})
        for path in SAMPLES:
            obstore.put(there, f"logs/{path.name}", path.read_bytes())
        # here, because processes may be those of an earlier test, with its environment
        run("extract", "s3://bucket/logs/", "--workers", "1", "-o", tmp_path / "there.json")
        run("extract", *SAMPLES, "-o", tmp_path / "here.json")
        assert read_demonstrations(tmp_path / "there.json") == read_demonstrations(tmp_path / "here.json")
        assert "found no file there" in run("extract", "s3://bucket/none.mcap", "-o", tmp_path / "x.json", code=1)
        said = run("extract", "s3://none/p01.mcap", "-o", tmp_path / "x.json", code=1)
        assert "do-not-show" not in said
    finally:
        server.stop()


def test_a_log_error_survives_between_processes():
    assert str(pickle.loads(pickle.dumps(LogError("x: y")))) == "x: y"
