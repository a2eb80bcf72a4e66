"""Reading gives the same for any number of threads."""

import log_factory as forge
import numpy as np
import pytest

from navirl_cli.logs.messages.reader import read

WANTS = {
    "/wrench": ("header.stamp", "header.frame_id", "wrench.force.x"),
    "/odom": ("header.stamp", "pose.covariance", "child_frame_id"),
    "/tf": ("transforms[].header.stamp", "transforms[].child_frame_id", "transforms[].transform.translation.x"),
    # the definition of these does not parse
    "/camera": ("header.stamp",),
}


def intact(data, rng):
    """No damage."""


def flipped(data, rng):
    """A bit in each of twelve places."""
    for at in rng.integers(200, len(data), size=12):
        data[at] ^= 1 << int(rng.integers(8))


def zeroed(data, rng):
    """Zeros in two places, where the disk failed."""
    for at in rng.integers(200, len(data) - 2000, size=2):
        data[at : at + 900] = bytes(900)


def cut(data, rng):
    """A file whose recorder was killed."""
    del data[int(rng.integers(len(data) // 3, len(data))) :]


def inserted(data, rng):
    """Random bytes in one place."""
    at = int(rng.integers(200, len(data)))
    data[at:at] = rng.bytes(333)


def messages():
    """A run with transforms in random order of time, some of which do not decode."""
    rng = np.random.default_rng(11)
    run = forge.run(120, frame_ids=("a", "bb"))
    for number in range(30):
        t_ns = forge.START_NS + int(rng.integers(240_000_000))
        payload = forge.cdr(forge.transforms(t_ns, "abcd"[: number % 5], float(number)))
        run.insert(6 * number, forge.Message("/tf", forge.TF, t_ns, payload[: -4 if number % 7 == 0 else None]))
    return run


@pytest.fixture(scope="module")
def run():
    return messages()


CASES = [(variant, intact) for variant in forge.WAYS] + [
    (variant, damage)
    for variant in ("zstd", "uncompressed chunks", "no summary, no chunks")
    for damage in (flipped, zeroed, cut, inserted)
]


@pytest.mark.parametrize(("variant", "damage"), CASES)
def test_threads_change_nothing(tmp_path, run, variant, damage):
    path = forge.forge(tmp_path / "run.mcap", run, **({"chunk_size": 2000} | forge.WAYS[variant]))
    data = bytearray(path.read_bytes())
    damage(data, np.random.default_rng(13))
    path.write_bytes(bytes(data))
    one, four = (read(path, WANTS, threads=threads) for threads in (1, 4))
    assert [str(note) for note in one.damage] == [str(note) for note in four.damage]
    assert (one.series.keys(), bool(one.damage)) == (four.series.keys(), True)
    for topic, series in one.series.items():
        other = four.series[topic]
        assert np.array_equal(series.log_time_ns, other.log_time_ns)
        assert all(np.array_equal(series.counts[name], other.counts[name]) for name in other.counts)
        for name, column in series.columns.items():
            assert column.dtype == other.columns[name].dtype
            assert np.array_equal(column, other.columns[name], equal_nan=column.dtype.kind == "f"), name
    if damage is intact:
        assert len(one.series["/wrench"]) == 120
        _, undecodable = one.damage
        assert undecodable.reason.startswith(
            "5 of 30 messages of /tf do not decode as tf2_msgs/msg/TFMessage and are lost ("
        )


@pytest.mark.parametrize("threads", [1, 8])
def test_spans_count_from_the_files_first_message(tmp_path, threads):
    """The first message in time stands in the last chunk; the first chunk, 10 s later, is damaged."""
    times = [forge.START_NS + seconds * 10**9 for seconds in (10, 11, 12, 0)]
    run = [forge.Message("/wrench", forge.WRENCH, t, forge.cdr(forge.wrench(t, (1, 2, 3)))) for t in times]
    path = forge.forge(tmp_path / "run.mcap", run, chunk_size=1)
    forge.overwrite(path, forge.chunk_starts(path)[0][0] + 9 + 24, b"\1\2\3\4")
    (damage,) = read(path, {"/wrench": ("wrench.force.x",)}, threads=threads).damage
    assert damage.span_s == (10.0, 10.0)
