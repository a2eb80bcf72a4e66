"""A robot that is pushed on its way to a goal, recorded by clocks that a test disturbs.

Each message has a true time and stands in the file in the order in which it came. What its stamp and its time of
receipt show is a matter of the clocks.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import nav_log as nav
import numpy as np
from log_factory import Message, forge

#: The robot drives from the first to the second time, s, at this speed, m/s; a push of a second begins at the third.
STARTS_S, STOPS_S, SPEED_M_S, PUSHED_S = 1.0, 17.0, 0.4, 9.5
LASTS_S = 21.0
NODES = ("odom", "wrench", "tf", "localisation", "people", "goal", "map")


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a recorder sees: message by message, in the order in which they come."""

    #: (n,) true times, s, when each is sent and when it comes, and the name of the node that sends it.
    true_s: np.ndarray
    came_s: np.ndarray
    node: np.ndarray
    #: (n,) ns.
    stamp_ns: np.ndarray
    received_ns: np.ndarray
    #: (n,) row of each in the templates.
    row: np.ndarray

    def sent_by(self, *nodes: str) -> np.ndarray:
        return np.isin(self.node, nodes or NODES)

    def kept(self, rows: np.ndarray) -> "Recorded":
        columns = (self.true_s, self.came_s, self.node, self.stamp_ns, self.received_ns, self.row)
        return Recorded(*(column[rows] for column in columns))

    def ordered(self) -> "Recorded":
        """In the order in which they come."""
        return self.kept(np.argsort(self.came_s, kind="stable"))

    def coming(self, came_s: np.ndarray) -> "Recorded":
        """The same that come at other times."""
        received_ns = self.received_ns + nav.unix(came_s) - nav.unix(self.came_s)
        return replace(self, came_s=came_s, received_ns=received_ns).ordered()


Disturbance = Callable[[Recorded], Recorded]


def driven_m(second: float) -> float:
    return SPEED_M_S * float(np.clip(second - STARTS_S, 0.0, STOPS_S - STARTS_S))


@cache
def _templates() -> list[tuple[float, str, str, str, int, bytes]]:
    """True time, node, topic, type, place of the stamp in the payload, payload."""
    made = []

    def add(second, node, topic, message, place):
        data = bytes(nav.STORE.serialize_cdr(message, message.__msgtype__))
        made.append((float(second), node, topic, message.__msgtype__, place, data))

    for second in np.arange(0.013, LASTS_S, 0.05):
        moving = SPEED_M_S if STARTS_S < second < STOPS_S else 0.0
        add(second, "odom", "/odom", nav.odometry(0, driven_m(second), -0.02 * second, v=moving), 4)
    for second in np.arange(0.0, LASTS_S, 0.01):
        inside = PUSHED_S <= second < PUSHED_S + 1.0
        force = 20.0 * np.sin(np.pi * (second - PUSHED_S)) ** 2 if inside else 0.0
        add(second, "wrench", "/wrench", nav.wrench(0, 0.0, float(force)), 4)
    for second in np.arange(0.021, LASTS_S, 0.1):
        add(second, "localisation", "/tf", nav.tf(nav.transform(0, "map", "odom", 0.0, 0.02 * second)), 8)
    for second in np.arange(0.017, LASTS_S, 0.05):
        add(second, "tf", "/tf", nav.tf(nav.transform(0, "base_link", "wheel", yaw=float(second % 3))), 8)
    for second in np.arange(0.1, LASTS_S, 0.2):
        add(second, "people", "/people", nav.pose_array(0, [(3.0, 1.5)]), 4)
    add(0.5, "goal", "/goal_pose", nav.pose_stamped(0, driven_m(LASTS_S), 0.0), 4)
    add(0.001, "map", "/map", nav.grid(80, 200, origin=(-1.0, -2.0)), 4)
    return sorted(made, key=lambda one: one[0])


def recorded(seed: int = 3) -> Recorded:
    """The scene by clocks that are all right."""
    made = _templates()
    true_s = np.array([one[0] for one in made])
    came = np.maximum.accumulate(true_s + np.random.default_rng(seed).exponential(0.002, len(made)))
    nodes = np.array([one[1] for one in made])
    return Recorded(true_s, came, nodes, nav.unix(true_s), nav.unix(came), np.arange(len(made)))


def write(path: Path, seen: Recorded, **options: object) -> Path:
    """A log of what the recorder saw, in that order."""
    messages = []
    for row, stamp, received in zip(seen.row.tolist(), seen.stamp_ns.tolist(), seen.received_ns.tolist(), strict=True):
        _, _, topic, typename, place, data = _templates()[row]
        stamped = data[:place] + struct.pack("<iI", *divmod(stamp, 10**9)) + data[place + 8 :]
        messages.append(Message(topic, typename, received, stamped))
    return forge(path, messages, **{"chunk_size": 1 << 16, **options})


# clocks


def computer(at_s: float, by_s: float) -> Disturbance:
    """The one computer's clock is set: stamps and times of receipt step."""
    return both(stamps(at_s, by_s), recorder(at_s, by_s))


def recorder(at_s: float, by_s: float) -> Disturbance:
    """Only the recorder's clock is set."""
    return lambda seen: replace(seen, received_ns=seen.received_ns + np.where(seen.came_s >= at_s, _ns(by_s), 0))


def stamps(at_s: float, by_s: float, *nodes: str) -> Disturbance:
    """The clock that stamps the messages of some nodes, or of all, is set."""
    return lambda seen: replace(
        seen, stamp_ns=seen.stamp_ns + np.where(seen.sent_by(*nodes) & (seen.true_s >= at_s), _ns(by_s), 0)
    )


def off(by_s: float, *nodes: str) -> Disturbance:
    """Some nodes stamp by a clock that is off."""
    return stamps(-1.0, by_s, *nodes)


def both(*some: Disturbance) -> Disturbance:
    """One disturbance after the other."""

    def disturbed(seen: Recorded) -> Recorded:
        for one in some:
            seen = one(seen)
        return seen

    return disturbed


def receipts(value_ns: int, begin_s: float = -1.0, end_s: float = 1e9) -> Disturbance:
    """The recorder writes one value as the time of receipt for a while."""

    def disturbed(seen: Recorded) -> Recorded:
        inside = (seen.came_s >= begin_s) & (seen.came_s < end_s)
        return replace(seen, received_ns=np.where(inside, np.uint64(value_ns), seen.received_ns.astype(np.uint64)))

    return disturbed


def simulated(seen: Recorded) -> Recorded:
    """All stamps are simulated time."""
    return replace(seen, stamp_ns=seen.stamp_ns - nav.START_NS + 928 * 10**9)


def stall(begin_s: float, end_s: float) -> Disturbance:
    """The recorder receives nothing for a while, then all at once."""
    return lambda seen: seen.coming(np.where((seen.came_s >= begin_s) & (seen.came_s < end_s), end_s, seen.came_s))


def pause(begin_s: float, end_s: float) -> Disturbance:
    """Nothing is recorded for a while."""
    return lambda seen: seen.kept((seen.true_s < begin_s) | (seen.true_s >= end_s))


def dropped(share: float, seed: int = 1) -> Disturbance:
    """Messages are lost by chance, except for those that come once."""

    def disturbed(seen: Recorded) -> Recorded:
        lost = np.random.default_rng(seed).random(len(seen.row)) < share
        return seen.kept(~lost | seen.sent_by("goal", "map"))

    return disturbed


def latency(mean_s: float, *nodes: str, seed: int = 1) -> Disturbance:
    """Messages of some nodes take their time."""

    def disturbed(seen: Recorded) -> Recorded:
        takes = np.random.default_rng(seed).exponential(mean_s, len(seen.row)) * seen.sent_by(*nodes)
        return seen.coming(seen.came_s + takes)

    return disturbed


def shuffled(pieces: int, seed: int = 1) -> Disturbance:
    """The file's pieces stand in another order, as some tools join them."""

    def disturbed(seen: Recorded) -> Recorded:
        parts = np.array_split(np.arange(len(seen.row)), pieces)
        order = np.random.default_rng(seed).permutation(pieces)
        return seen.kept(np.concatenate([parts[number] for number in order]))

    return disturbed


def by_topic(seen: Recorded) -> Recorded:
    """The file holds one topic after the other, as some converters write them."""
    return seen.kept(np.lexsort((seen.true_s, seen.node)))


def _ns(seconds: float | np.ndarray) -> np.ndarray:
    return np.round(np.asarray(seconds) * 1e9).astype(np.int64)
