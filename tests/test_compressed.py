"""Whole-file compression: every variant is read, and what is left of a damaged file."""

import os
import re
import struct
import tempfile

import log_factory as forge
import lz4.frame
import numpy as np
import pytest
import zstandard

from navirl_cli.errors import LogError
from navirl_cli.logs.container import compressed
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.records import MAGIC

BLOCK = 128 << 10
#: A skippable frame, as pzstd puts in front.
SKIPPED = b"\x52\x2a\x4d\x18" + struct.pack("<I", 5) + b"12345"


def content(size=1_000_000, seed=5):
    """MCAP's magic, then bytes of which some compress and some do not."""
    rng = np.random.default_rng(seed)
    noise = rng.integers(0, 256, size, dtype=np.uint8)
    # all types of zstd blocks: compressed, stored, one byte repeated
    noise[: size // 3] &= 0x0F
    noise[size // 2 : size // 2 + 3 * BLOCK] = 7
    return MAGIC + noise.tobytes()[: size - len(MAGIC)]


def zstd(data, **options):
    return zstandard.ZstdCompressor(**options).compress(data)


def zstd_stream(data, **options):
    """A frame without the content's size, as written to a pipe."""
    compressor = zstandard.ZstdCompressor(**options).compressobj()
    return compressor.compress(data) + compressor.flush()


VARIANTS = {
    "zstd": zstd,
    "zstd with a checksum": lambda data: zstd(data, write_checksum=True),
    "zstd without content size": zstd_stream,
    "zstd 19": lambda data: zstd(data, level=19),
    "zstd in frames": lambda data: zstd(data[:300_000]) + zstd(data[300_000:], write_checksum=True),
    "zstd in frames, some of which hold nothing": lambda data: SKIPPED + zstd(data[:9]) + SKIPPED + zstd(data[9:]),
    "zstd with an empty frame": lambda data: zstd(b"") + zstd_stream(data),
    "lz4": lz4.frame.compress,
    "lz4 with everything": lambda data: lz4.frame.compress(
        data, content_checksum=True, block_checksum=True, block_linked=False, store_size=True
    ),
    "lz4 without size": lambda data: lz4.frame.compress(data, store_size=False, block_size=7),
    "lz4 in frames": lambda data: lz4.frame.compress(data[:300_000]) + SKIPPED + lz4.frame.compress(data[300_000:]),
}


def read(raw):
    """All bytes, by the file's own reading and by its descriptor."""
    with raw.file as file:
        data = file.read()
        assert os.pread(file.fileno(), raw.size + 9, 0) == data
    assert len(data) == raw.size
    return data


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", ["log.mcap", "log.mcap.zstd", "log"])
def test_compressed_files_are_read(tmp_path, variant, name):
    data = content()
    path = tmp_path / name
    path.write_bytes(VARIANTS[variant](data))
    raw = open_log(path)
    assert raw.damage == ()
    assert read(raw) == data


def test_a_plain_file_is_opened_itself(tmp_path):
    path = forge.forge(tmp_path / "log.mcap.zstd", forge.run(50))
    raw = open_log(path)
    assert os.path.samestat(os.fstat(raw.file.fileno()), path.stat())
    assert raw.damage == ()
    assert read(raw) == path.read_bytes()


def zstd_blocks(blob):
    """Where the blocks of a frame without checksum start, and its end."""
    at, last, starts = zstandard.frame_header_size(blob), False, []
    while not last:
        mark = int.from_bytes(blob[at : at + 3], "little")
        starts.append(at)
        last = bool(mark & 1)
        at += 3 + (1 if mark >> 1 & 3 == 1 else mark >> 3)
    return [*starts, at]


def test_a_cut_zstd_file_keeps_every_block_before_the_cut(tmp_path):
    data = content()
    blob = zstd_stream(data)
    starts = zstd_blocks(blob)
    assert starts[-1] == len(blob)
    sizes = [len(zstandard.ZstdDecompressor().decompressobj().decompress(blob[:at])) for at in starts]
    assert sizes[-1] == len(data)
    path = tmp_path / "log.mcap.zstd"
    for number, cut in ((1, starts[1]), (3, starts[3] + 2), (4, starts[5] - 1), (5, starts[5] + 40)):
        path.write_bytes(blob[:cut])
        raw = open_log(path)
        found = read(raw)
        assert found == data[: len(found)]
        # of a stored block the bytes before the cut are read, too
        assert sizes[number] <= len(found) < sizes[number + 1]
        (damage,) = raw.damage
        assert (damage.path, damage.start, damage.stop) == (path, starts[number], cut)
        assert damage.reason == "the zstd data are cut off; everything before was read, the rest is lost"


def test_a_cut_inside_a_stored_block_keeps_its_start(tmp_path):
    data = MAGIC + np.random.default_rng(1).bytes(300_000)
    blob = zstd(data)
    path = tmp_path / "log.mcap.zstd"
    path.write_bytes(blob[:200_000])
    raw = open_log(path)
    assert 199_900 < raw.size < 200_000
    assert read(raw) == data[: raw.size]


def lz4_blocks(blob):
    """Where the blocks of a frame with size and without checksums start."""
    at, starts = 15, []
    while size := int.from_bytes(blob[at : at + 4], "little") & 0x7FFFFFFF:
        starts.append(at)
        at += 4 + size
    return [*starts, at]


def test_a_cut_lz4_file_keeps_every_block_before_the_cut(tmp_path):
    data = content()
    blob = lz4.frame.compress(data)
    starts = lz4_blocks(blob)
    path = tmp_path / "log.mcap.lz4"
    for number, cut in ((1, starts[1]), (3, starts[3] + 2), (4, starts[5] - 1), (len(starts) - 1, len(blob) - 1)):
        path.write_bytes(blob[:cut])
        raw = open_log(path)
        found = read(raw)
        assert found == data[: len(found)]
        assert min(number * 65536, len(data)) <= len(found) < (number + 1) * 65536
        (damage,) = raw.damage
        assert (damage.start, damage.stop) == (starts[number], cut)
        assert damage.reason == "the lz4 data are cut off; everything before was read, the rest is lost"


def test_a_damaged_zstd_block_ends_what_is_kept(tmp_path):
    data = content()
    blob = zstd_stream(data)
    starts = zstd_blocks(blob)
    path = tmp_path / "log.mcap.zstd"
    path.write_bytes(blob)
    forge.overwrite(path, starts[2] + 3, b"\xff" * 20)
    raw = open_log(path)
    assert read(raw) == data[: 2 * BLOCK]
    (damage,) = raw.damage
    assert (damage.start, damage.stop) == (starts[2], len(blob))
    assert re.fullmatch(r"the zstd data are damaged \(.*\); the rest is lost", damage.reason)
    assert str(damage).startswith(f"{path}: bytes {starts[2]} to {len(blob)}: the zstd data are damaged")


def test_a_damaged_lz4_block_ends_what_is_kept(tmp_path):
    data = content()
    blob = lz4.frame.compress(data, block_checksum=True)
    path = tmp_path / "log.mcap.lz4"
    path.write_bytes(blob)
    forge.overwrite(path, len(blob) // 2, b"\xff" * 20)
    raw = open_log(path)
    assert 4 * 65536 <= raw.size < len(data) // 65536 * 65536
    assert read(raw) == data[: raw.size]
    (damage,) = raw.damage
    assert damage.start < len(blob) // 2 < damage.stop == len(blob)
    assert re.fullmatch(r"the lz4 data are damaged \(.*\); the rest is lost", damage.reason)
    # a length that no block can have is refused
    first = 15
    forge.overwrite(path, first, b"\xff\xff\xff\x7f")
    with pytest.raises(LogError, match=r"the lz4 data are damaged \(a block of 2147483647 bytes\)"):
        open_log(path)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_wrong_checksum_is_reported_and_the_next_frame_is_read(tmp_path, compression):
    data = content()
    if compression == "zstd":
        frame = zstd(data[:500_000], write_checksum=True)
        following = zstd(data[500_000:])
    else:
        frame = lz4.frame.compress(data[:500_000], content_checksum=True)
        following = lz4.frame.compress(data[500_000:])
    path = tmp_path / "log.mcap"
    path.write_bytes(frame + following)
    forge.overwrite(path, len(frame) - 4, b"abcd")
    raw = open_log(path)
    assert read(raw) == data
    (damage,) = raw.damage
    assert (damage.start, damage.stop) == (0, len(frame))
    assert damage.reason == (f"the {compression} checksum is wrong; some decompressed bytes are wrong, unknown which")


@pytest.mark.parametrize(
    ("rest", "reason"),
    [
        (bytes(100), "no zstd frame starts here (00 00 00 00); the rest is lost"),
        (b"ab", "no zstd frame starts here (61 62); the rest is lost"),
        (b"\x28\xb5\x2f\xfd", "the zstd data are cut off; everything before was read, the rest is lost"),
        (SKIPPED[:-1], "the file ends inside a skippable frame; the rest is lost"),
        (SKIPPED[:6], "the file ends inside a skippable frame; the rest is lost"),
        (b"\x28\xb5\x2f\xfd" + b"\xff" * 30, "the zstd data are damaged ("),
    ],
)
def test_bytes_after_the_frames_are_reported(tmp_path, rest, reason):
    data = content()
    blob = zstd(data)
    path = tmp_path / "log.mcap.zstd"
    path.write_bytes(blob + rest)
    raw = open_log(path)
    assert read(raw) == data
    (damage,) = raw.damage
    assert (damage.start, damage.stop) == (len(blob), len(blob) + len(rest))
    assert damage.reason.startswith(reason)


@pytest.mark.parametrize(
    ("blob", "message"),
    [
        (zstd(content())[:20], "expected MCAP compressed with zstd, found: the zstd data are cut off"),
        (lz4.frame.compress(content())[:5], "expected MCAP compressed with lz4, found: the lz4 data are cut off"),
        (b"\x04\x22\x4d\x18" + bytes(99), "expected MCAP compressed with lz4, found: the lz4 data are damaged ("),
        (SKIPPED, "expected an MCAP file inside the zstd compression, found an empty file; record or copy it again"),
        (SKIPPED + b"hello", "expected MCAP compressed with zstd, found: no zstd frame starts here (68 65 6c 6c)"),
    ],
)
def test_a_file_of_which_nothing_decompresses_is_refused(tmp_path, blob, message):
    path = tmp_path / "log.mcap.zstd"
    path.write_bytes(blob)
    with pytest.raises(LogError, match=re.escape(f"{path}: {message}")) as caught:
        open_log(path)
    assert str(caught.value).endswith("copy it again")


def test_a_window_that_would_fill_the_memory_is_refused(tmp_path):
    path = tmp_path / "log.mcap.zstd"
    for log, fits in ((27, True), (28, False)):
        options = zstandard.ZstdCompressionParameters(window_log=log)
        path.write_bytes(zstd_stream(content(2000), compression_params=options))
        if fits:
            assert read(open_log(path)) == content(2000)
            continue
        message = (
            f"{path}: expected a zstd frame with a window of at most 128 MiB, found one of 256 MiB; decompress it "
            f"first: zstd -d --long=31 {path} -o {tmp_path}/log.mcap"
        )
        with pytest.raises(LogError, match=re.escape(message)):
            open_log(path)


def test_memory_is_bounded_if_few_bytes_decompress_to_many(tmp_path, monkeypatch):
    sizes = []
    real = tempfile.TemporaryFile

    def watched():
        file = real()
        write = file.write
        return Watched(file, lambda data: sizes.append(len(data)) or write(data))

    monkeypatch.setattr(tempfile, "TemporaryFile", watched)
    path = tmp_path / "log.mcap.zstd"
    path.write_bytes(zstd(MAGIC + bytes(50_000_000)))
    assert path.stat().st_size < 10_000
    raw = open_log(path)
    raw.file.close()
    assert raw.size == 50_000_008
    assert max(sizes) == BLOCK


class Watched:
    def __init__(self, file, write):
        self.write = write
        self.seek, self.read, self.close, self.fileno = file.seek, file.read, file.close, file.fileno


def test_a_full_disk_and_a_missing_temporary_folder_are_named(tmp_path, monkeypatch):
    path = tmp_path / "log.mcap.zstd"
    path.write_bytes(zstd(content()))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(
        LogError,
        match=rf"log.mcap.zstd: expected free space in {tmp_path}/none for the decompressed file, found: No such "
        "file or directory after 0 bytes; free some space, or name another folder in the environment variable TMPDIR",
    ):
        open_log(path)
    monkeypatch.setattr(tempfile, "tempdir", "/elsewhere")
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda: open("/dev/full", "w+b"))  # noqa: PTH123, SIM115
    with pytest.raises(
        LogError,
        match=r"expected free space in /elsewhere for .* found: No space left on device after \d+ bytes; free some",
    ):
        open_log(path)


def test_a_file_without_permission_to_read(tmp_path, monkeypatch):
    path = forge.forge(tmp_path / "log.mcap", forge.run(50))

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(compressed, "open_regular", refuse)
    with pytest.raises(
        LogError, match=r"log.mcap: expected a readable file, found: Permission denied; check its rights"
    ):
        open_log(path)


def test_a_read_error_of_the_disk_is_not_reported_as_a_full_disk(tmp_path, monkeypatch):
    path = tmp_path / "log.mcap.zstd"
    blob = zstd(content())
    path.write_bytes(blob)

    def failing(path):
        file = path.open("rb")

        def read(count):
            if file.tell() + count > len(blob) // 2:
                raise OSError(5, "Input/output error")
            return file.read(count)

        watched = Watched(file, None)
        watched.read = read
        return Entered(watched)

    monkeypatch.setattr(compressed, "open_regular", failing)
    with pytest.raises(
        LogError,
        match=rf"expected {len(blob)} readable bytes, found: Input/output error after byte \d+; copy what can be read",
    ):
        open_log(path)


class Entered:
    def __init__(self, file):
        self.read, self.seek, self.fileno, self.close = file.read, file.seek, file.fileno, file.close

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def test_mutated_files_are_refused_or_read(tmp_path):
    rng = np.random.default_rng(3)
    data = content(60_000)
    path = tmp_path / "log.mcap.zstd"
    silent = reported = 0
    for number in range(600):
        variant = list(VARIANTS)[number % len(VARIANTS)]
        blob = bytearray(VARIANTS[variant](data))
        for _ in range(rng.integers(1, 4)):
            # half of the changes hit the headers
            at = int(rng.integers(0, len(blob) if rng.random() < 0.5 else min(40, len(blob))))
            if rng.random() < 0.2:
                del blob[at : at + int(rng.integers(1, 20))]
            else:
                blob[at] = rng.integers(0, 256)
        path.write_bytes(bytes(blob))
        try:
            raw = open_log(path)
        except LogError as error:
            assert str(error).startswith(f"{path}: expected ")  # noqa: PT017
            reported += 1
            continue
        found = read(raw)
        reported += bool(raw.damage)
        if not raw.damage and "without" not in variant:
            # without a checksum, changed bytes in a stored block are not noticed, but its length stays
            assert len(found) == len(data), (variant, number)
            silent += 1
    assert reported > 400
    assert silent > 40
