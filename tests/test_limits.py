"""A small file does not fill memory or disk: what it unpacks to is bounded in proportion to its size."""

import struct
import tracemalloc
from dataclasses import replace

import fuzzing
import lz4.frame
import numpy as np
import pytest
import zstandard
from click.testing import CliRunner
from log_factory import cut
from rewriting import Part, taken_apart
from verdicts import WANTS

from navirl_cli import limits
from navirl_cli.cli import cli
from navirl_cli.errors import LogError
from navirl_cli.limits import FREE_BYTES, RATIO, Allowance
from navirl_cli.logs.container.batches import Batch, Channel
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.records import MAGIC
from navirl_cli.logs.messages.reader import read
from navirl_cli.logs.messages.single import without_compression

LOG = next(log for log in fuzzing.logs() if log.name == "zstd")
#: Zero bytes that compress to almost nothing, three of which are more than a small file may unpack to.
LARGE = 25 << 20


def peak_of(work):
    """Peak of memory in bytes that Python objects take."""
    tracemalloc.start()
    try:
        return work(), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def bomb(path, compression, count=3):
    """A log whose first chunks hold zeros in an attachment-like record that readers skip."""
    parts = taken_apart(LOG.data)
    for chunk in parts.chunks()[:count]:
        chunk.compression = compression
        chunk.parts.append(Part(0x80, bytes(LARGE)))
    path.write_bytes(parts.stored())
    return path


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_chunks_beyond_the_limit_are_not_opened_and_reported(tmp_path, monkeypatch, compression):
    path = bomb(tmp_path / "bomb.mcap", "zstd")
    if compression == "lz4":  # whose ratio is at most 255, so that the proportion never refuses it
        path = bomb(tmp_path / "bomb.mcap", "lz4")
        assert not read(path, WANTS, threads=1).damage
        return
    found, peak = peak_of(lambda: read(path, WANTS, threads=1))
    assert len(found.damage) == 1
    assert "the chunk claims 26.2 MB uncompressed, expected at most" in str(found.damage[0])
    assert "lift the limit with `no_limits`" in str(found.damage[0])
    assert peak < 5 * LARGE
    monkeypatch.setenv(limits.VARIABLE, "1")
    assert not read(path, WANTS, threads=1).damage


def test_a_cut_chunk_is_decompressed_up_to_the_size_that_it_claims(tmp_path):
    parts = taken_apart(LOG.data)
    chunk = parts.chunks()[-1]
    size = len(chunk.raw)
    chunk.parts += [Part(0x80, bytes(LARGE)), Part(0x80, np.random.default_rng(0).bytes(4000))]
    chunk.oversized = size - len(chunk.raw)
    data = parts.stored()
    path = tmp_path / "cut.mcap"
    path.write_bytes(data)
    path = cut(path, data.rindex(b"\x28\xb5\x2f\xfd") + len(zstandard.compress(chunk.raw)) - 100)
    found, peak = peak_of(lambda: read(path, WANTS, threads=1))
    assert "the file ends inside a chunk" in str(found.damage[-1])
    assert peak < LARGE  # 16 MB of them are what `LogFile.results` keeps for later blocks
    assert {topic: len(series) for topic, series in found.series.items()} == {
        topic: len(LOG.strict.of(topic)) for topic in found.series
    }


@pytest.mark.parametrize("compress", [zstandard.ZstdCompressor().compress, lz4.frame.compress])
def test_a_compressed_file_that_is_no_mcap_is_refused_at_its_first_block(tmp_path, monkeypatch, compress):
    written = []
    monkeypatch.setattr("navirl_cli.logs.container.compressed.check_magic", lambda *_: None)
    path = tmp_path / "zeros.mcap.zst"
    path.write_bytes(compress(bytes(LARGE)))
    monkeypatch.setattr("tempfile.TemporaryFile", lambda: open_counted(tmp_path, written))
    with pytest.raises(LogError, match="found zero bytes only"):
        open_log(path)
    assert sum(written) == 0


def open_counted(folder, written):
    """A file that notes how much is written to it."""
    file = (folder / "unpacked").open("w+b")

    class Counted:
        def write(self, data):
            written.append(len(data))
            return file.write(data)

        def __getattr__(self, name):
            return getattr(file, name)

    return Counted()


def test_a_compressed_file_unpacks_to_a_bounded_size(tmp_path, monkeypatch):
    path = tmp_path / "large.mcap.zst"
    path.write_bytes(zstandard.compress(MAGIC + bytes(FREE_BYTES + LARGE)))
    with pytest.raises(LogError, match=r"expected at most 6\d\.\d MB in \d+ bytes of zstd, found more; .*`no_limits`"):
        open_log(path)
    monkeypatch.setenv(limits.VARIABLE, "1")
    with open_log(path) as raw:
        assert raw.size == len(MAGIC) + FREE_BYTES + LARGE


@pytest.mark.parametrize("states_size", [True, False])
def test_messages_compressed_one_by_one_are_bounded_together(states_size):
    compressor = zstandard.ZstdCompressor(write_content_size=states_size)
    payloads = [compressor.compress(bytes(size)) for size in (1000, LARGE, LARGE, LARGE)]
    sizes = np.array([len(one) for one in payloads])
    none = np.zeros(len(sizes), dtype=np.int64)
    channel = Channel(1, "/map", "", "", "", "cdr")
    batch = Batch(channel, b"".join(payloads), np.cumsum(sizes) - sizes, sizes, none, none)
    found, peak = peak_of(lambda: without_compression(batch))
    # a frame that does not state its size may become as much as its proportion
    right = [1000, LARGE, LARGE, sizes[3]] if states_size else [1000, *sizes[1:]]
    assert found.sizes.tolist() == right
    assert peak < 5 * LARGE
    small = replace(batch, raw=payloads[0], starts=none[:1], sizes=sizes[:1])
    assert without_compression(small).sizes.tolist() == [1000]


def test_the_allowance_counts_only_what_is_beyond_the_proportion():
    allowance = Allowance()
    assert all(allowance.take(100, RATIO * 100) for _ in range(1000))
    assert allowance.most(1) == FREE_BYTES + RATIO
    assert not allowance.take(1, FREE_BYTES + RATIO + 1)
    assert allowance.take(1, FREE_BYTES + RATIO)
    assert not allowance.take(0, 1)
    assert allowance.take(1, RATIO)


def test_many_empty_messages_take_memory_in_proportion_to_their_number(tmp_path):
    peaks = []
    for count in (20_000, 40_000):
        parts = taken_apart(LOG.data)
        chunk = parts.chunks()[-1]
        channel = LOG.strict.of("/wrench")[0].channel
        chunk.parts += [Part(5, struct.pack("<HIQQ", channel, 0, chunk.parts[-1].log_time_ns, 0))] * count
        chunk.indexed = False
        path = tmp_path / "tiny.mcap"
        path.write_bytes(parts.stored())
        found, peak = peak_of(lambda path=path: read(path, WANTS, threads=1))
        assert f"{count} of {count + 90} messages of /wrench do not decode" in str(found.damage[0])
        peaks.append(peak)
    assert (peaks[1] - peaks[0]) / 20_000 < 400


def test_the_option_lifts_the_limits_for_the_command(tmp_path, monkeypatch):
    monkeypatch.setenv(limits.VARIABLE, "")
    path = bomb(tmp_path / "bomb.mcap", "zstd")
    strict = CliRunner().invoke(cli, ["inspect", "--check", str(path)])
    assert strict.exit_code == 3
    assert "lift the limit with --no-limits" in strict.output
    assert CliRunner().invoke(cli, ["--no-limits", "inspect", "--check", str(path)]).exit_code == 0
