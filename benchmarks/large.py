"""Measure how long large inputs take, and how the time grows: many trials, long paths, many people, tiny messages.

python benchmarks/large.py [--quick] [--json]. Each line is CPU time of one command in its own process, on a generated
log; the growth is that of ten times as much input. The bar on growth is 15: linear, with room for noise. --quick takes
a tenth of everything.
"""

import argparse
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rows import Row, report

from navirl_cli.logs.messages.writer import LogWriter, header, message_type, planar_pose

GROWTH = 15.0
EPOCH_NS = 1_700_000_000_000_000_000
RATE_HZ, SPEED_M_S, RESOLUTION_M = 10, 0.5, 0.1


def write_log(path: Path, trials: int = 1, length_m: float = 3.0, people: int = 1) -> None:
    """A robot that drives to and fro along lanes of an open hall, past people who stand in a row.

    Args:
        path: The log to write.
        trials: Number of goals.
        length_m: Of each trial, m.
        people: In every message about people.
    """
    lane = np.arange(0.0, length_m, SPEED_M_S / RATE_HZ)
    side = 40.0
    xs, ys = _snake(lane, side)
    with LogWriter(path, compression="zstd") as writer:
        size = round((side + 2) / RESOLUTION_M)
        grid, meta = message_type("nav_msgs/msg/OccupancyGrid"), message_type("nav_msgs/msg/MapMetaData")
        writer.message(
            "/map",
            grid(
                header(EPOCH_NS, "map"),
                meta(header(0, "").stamp, RESOLUTION_M, size, size, planar_pose(-1.0, -1.0, 0.0)),
                np.zeros(size * size, dtype=np.int8),
            ),
            EPOCH_NS,
        )
        poses = [planar_pose(-0.9 + 40.0 * k / max(people - 1, 1), -0.8, 0.0) for k in range(people)]
        pose_array, stamped = message_type("geometry_msgs/msg/PoseArray"), message_type("geometry_msgs/msg/PoseStamped")
        t_ns = EPOCH_NS
        for trial in range(trials):
            along = slice(None) if trial % 2 == 0 else slice(None, None, -1)
            x, y = xs[along], ys[along]
            writer.message("/people", pose_array(header(t_ns, "map"), poses), t_ns)
            writer.message("/goal_pose", stamped(header(t_ns, "map"), planar_pose(x[-1], y[-1], 0.0)), t_ns)
            times = t_ns + np.arange(1, len(x) + 1) * (1_000_000_000 // RATE_HZ)
            _drive(writer, times, x, y)
            t_ns = int(times[-1]) + 2_000_000_000


def _snake(lane: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Places along lanes a quarter of a metre apart, without crossings."""
    row, along = np.divmod(lane, side)
    return np.where(row % 2 == 0, along, side - along), 0.25 * row


def _drive(writer: LogWriter, times: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
    odometry, pose = message_type("nav_msgs/msg/Odometry"), message_type("geometry_msgs/msg/PoseWithCovariance")
    twist, vector = message_type("geometry_msgs/msg/TwistWithCovariance"), message_type("geometry_msgs/msg/Vector3")
    still = twist(message_type("geometry_msgs/msg/Twist")(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0)), np.zeros(36))
    template = odometry(header(0, "map"), "base_link", pose(planar_pose(0.0, 0.0, 0.0), np.zeros(36)), still)
    writer.columns(
        "/odom",
        template,
        times,
        {"header.stamp": times, "pose.pose.position.x": x, "pose.pose.position.y": y},
    )


def cpu_seconds(words: list[str], folder: Path) -> tuple[float, float]:
    """CPU time of a command, s, and its peak memory, MB."""
    code = "import sys; from navirl_cli.cli import main; sys.argv[0] = 'navirl'; main()"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}
    done = subprocess.run(  # noqa: S603 our own command
        [sys.executable, "-c", code, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in {0, 3}:
        raise SystemExit(f"navirl {' '.join(words)}: {done.stderr[-500:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, after.ru_maxrss / 1024


def growth(
    what: str, small: Callable[[Path], list[str]], large: Callable[[Path], list[str]], bar_s: float
) -> list[Row]:
    """Rows of one kind of input at a size and at ten times of it."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (first, _), (second, _) = cpu_seconds(small(folder), folder), cpu_seconds(large(folder), folder)
    start_s = 0.4  # of imports
    return [
        Row.at_most(f"{what}", second, "s", bar_s),
        Row.at_most(f"{what}: growth by ten times as much", second / max(first, start_s), "", GROWTH),
    ]


def extracting(**sizes: float) -> Callable[[Path], list[str]]:
    """Words that extract a log of given sizes, which is written first."""

    def words(folder: Path) -> list[str]:
        path = folder / f"{'_'.join(str(value) for value in sizes.values())}.mcap"
        write_log(path, **sizes)  # type: ignore[arg-type]
        return ["extract", path.name, "--no-wrench", "-o", f"{path.stem}.json"]

    return words


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    less = 10 if given.quick else 1
    rows = [
        *growth("extract 2,000 trials", extracting(trials=200 // less), extracting(trials=2000 // less), 10),
        *growth("extract a path of 4,000 cells", extracting(length_m=40 // less), extracting(length_m=400 // less), 10),
        *growth("extract 1,000 people", extracting(people=100 // less), extracting(people=1000 // less), 10),
    ]
    return report(rows, as_json=given.json)


if __name__ == "__main__":
    sys.exit(main())
