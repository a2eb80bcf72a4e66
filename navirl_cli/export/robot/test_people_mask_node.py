#!/usr/bin/env python3
"""Test people_mask_node.py without ROS: python3 test_people_mask_node.py. Needs numpy only."""

import math
import sys
import types
import unittest
from pathlib import Path
from types import SimpleNamespace


class Message(SimpleNamespace):
    """A message: fields appear when they are set; header and info when they are read."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        if name in ("header", "info", "origin"):
            setattr(self, name, Message())
            return self.__dict__[name]
        raise AttributeError(name)


class FakeError(Exception):
    """tf2_ros.TransformException."""


class FakeBuffer:
    """Transforms by (target, source)."""

    def __init__(self):
        self.known = {}

    def lookup_transform(self, target, source, _time):
        """The transform, or an error."""
        if (target, source) not in self.known:
            raise FakeError(f"no transform from {source} to {target}")
        return self.known[target, source]


class FakeNode:
    """What PeopleMask uses of rclpy.node.Node; time stands still until `now_ns` is set."""

    parameters = {}

    def __init__(self, name):
        self.name = name
        self.now_ns = 0
        self.published = {}
        self.qos = {}
        self.subscribed = {}
        self.lines = []

    def declare_parameter(self, name, value):
        self.__dict__.setdefault("declared", {})[name] = value

    def get_parameter(self, name):
        return SimpleNamespace(value=self.parameters.get(name, self.declared[name]))

    def create_publisher(self, _kind, topic, qos):
        self.qos[topic] = qos
        self.published[topic] = []
        return SimpleNamespace(publish=self.published[topic].append)

    def create_subscription(self, kind, topic, callback, qos):
        self.qos[topic] = qos
        self.subscribed[topic] = (kind, callback)

    def create_timer(self, period_s, callback):
        self.period_s = period_s
        return SimpleNamespace(callback=callback)

    def get_clock(self):
        now = SimpleNamespace(nanoseconds=self.now_ns, to_msg=lambda: self.now_ns)
        return SimpleNamespace(now=lambda: now)

    def get_logger(self):
        def log(text, **_):
            self.lines.append(text)

        return SimpleNamespace(error=log, warning=log, info=log)

    def destroy_node(self):
        """Nothing to do."""

    def say(self, topic, message):
        """Deliver a message."""
        self.subscribed[topic][1](message)


def fake_ros():
    """Modules by name, as far as the node imports them."""
    message = type("OccupancyGrid", (Message,), {})
    content = {
        "rclpy": {"init": lambda: None, "spin": lambda _node: None, "try_shutdown": lambda: None},
        "rclpy.node": {"Node": FakeNode},
        "rclpy.qos": {
            "QoSProfile": SimpleNamespace,
            "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="transient local"),
            "ReliabilityPolicy": SimpleNamespace(RELIABLE="reliable"),
        },
        "rclpy.time": {"Time": object},
        "tf2_ros": {
            "Buffer": FakeBuffer,
            "TransformException": FakeError,
            "TransformListener": lambda _buffer, _node: None,
        },
        "nav_msgs.msg": {"OccupancyGrid": message},
        "nav2_msgs.msg": {"CostmapFilterInfo": type("CostmapFilterInfo", (Message,), {})},
        "geometry_msgs.msg": {"PoseArray": type("PoseArray", (Message,), {})},
        "people_msgs.msg": {"People": type("People", (Message,), {})},
    }
    modules = {name.split(".")[0]: types.ModuleType(name.split(".")[0]) for name in content}
    for name, members in content.items():
        module = modules.setdefault(name, types.ModuleType(name))
        vars(module).update(members)
    return modules


def point(x, y):
    return SimpleNamespace(x=x, y=y, z=0.0)


def turn(yaw):
    return SimpleNamespace(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def map_of(width, height, resolution=0.1, origin=(0.0, 0.0), yaw=0.0):
    """A map in the frame map."""
    pose = SimpleNamespace(position=point(*origin), orientation=turn(yaw))
    info = SimpleNamespace(width=width, height=height, resolution=resolution, origin=pose)
    return SimpleNamespace(header=SimpleNamespace(frame_id="map"), info=info)


def people_of(*places, frame="map"):
    """A people_msgs/People."""
    people = [SimpleNamespace(position=point(x, y)) for x, y in places]
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), people=people)


def poses_of(*places, frame="map"):
    """A geometry_msgs/PoseArray."""
    poses = [SimpleNamespace(position=point(x, y)) for x, y in places]
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), poses=poses)


MASK, INFO = "/people_filter_mask", "/people_filter_info"


class OnTheNode(unittest.TestCase):
    """The node against the fake."""

    def node(self, **parameters):
        FakeNode.parameters = {"amplitude": 100.0, "covariance_m2": 0.3, **parameters}
        return people_mask_node.PeopleMask()

    def masks(self, node):
        return [one.data for one in node.published[MASK]]

    def test_the_filter_info_names_the_mask_and_both_are_latched(self):
        node = self.node()
        (info,) = node.published[INFO]
        self.assertEqual((info.type, info.filter_mask_topic, info.base, info.multiplier), (0, MASK, 0.0, 1.0))
        for topic in (MASK, INFO, "/map"):
            self.assertEqual(node.qos[topic].durability, "transient local")

    def test_a_person_costs_what_the_formula_says(self):
        node = self.node()
        node.say("/map", map_of(20, 10, origin=(-1.0, -0.5)))
        node.say("/people", people_of((0.05, 0.05)))
        node.on_timer()
        (mask,) = self.masks(node)
        for row in range(10):
            for column in range(20):
                x, y = -1.0 + 0.1 * (column + 0.5), -0.5 + 0.1 * (row + 0.5)
                cost = 100 * math.exp(-((x - 0.05) ** 2 + (y - 0.05) ** 2) / 0.6)
                self.assertEqual(mask[row * 20 + column], round(cost / 2.54) or -1)

    def test_people_add_up_and_no_cell_is_an_obstacle(self):
        node = self.node(amplitude=240.0)
        node.say("/map", map_of(20, 10))
        node.say("/people", people_of((0.5, 0.5), (0.5, 0.5)))
        node.on_timer()
        self.assertEqual(max(self.masks(node)[0]), 99)

    def test_nothing_is_sent_twice_and_people_are_forgotten(self):
        node = self.node()
        node.on_timer()
        self.assertEqual(self.masks(node), [])  # no map yet
        node.say("/map", map_of(20, 10))
        node.say("/people", people_of((0.5, 0.5)))
        for _ in range(3):
            node.on_timer()
        self.assertEqual(len(self.masks(node)), 1)
        node.say("/people", people_of((0.8, 0.5)))
        node.on_timer()
        self.assertEqual(len(self.masks(node)), 2)
        node.now_ns = 3_000_000_000
        node.on_timer()
        self.assertEqual(set(self.masks(node)[-1]), {-1})

    def test_poses_in_another_frame_are_transformed(self):
        node = self.node(people_type="geometry_msgs/msg/PoseArray", people_topic="/seen", covariance_m2=0.01)
        node.say("/map", map_of(40, 40))
        node.say("/seen", poses_of((1.0, 0.0), frame="laser"))
        node.on_timer()
        self.assertEqual(set(self.masks(node)[-1]), {-1})
        self.assertIn("no transform", node.lines[-1])
        moved = SimpleNamespace(translation=point(2.05, 1.05), rotation=turn(math.pi / 2))
        node.buffer.known["map", "laser"] = SimpleNamespace(transform=moved)
        node.on_timer()
        mask = self.masks(node)[-1]
        self.assertEqual(divmod(mask.index(max(mask)), 40), (20, 20))

    def test_a_rotated_map_and_wrong_parameters_are_refused(self):
        node = self.node()
        node.say("/map", map_of(20, 10, yaw=0.5))
        node.on_timer()
        self.assertEqual(self.masks(node), [])
        self.assertIn("rotated", node.lines[-1])
        for wrong in ({"people_type": "a/msg/B"}, {"covariance_m2": 0.0}):
            with self.assertRaises(ValueError):
                self.node(**wrong)

    def test_people_outside_of_the_map_and_an_amplitude_of_nothing_cost_nothing(self):
        for amplitude, place in ((100.0, (50.0, 50.0)), (0.0, (0.5, 0.5)), (0.1, (0.5, 0.5))):
            node = self.node(amplitude=amplitude)
            node.say("/map", map_of(20, 10))
            node.say("/people", people_of(place))
            node.on_timer()
            self.assertEqual(set(self.masks(node)[-1]), {-1})


sys.modules.update(fake_ros())
sys.path.insert(0, str(Path(__file__).resolve().parent))
import people_mask_node  # noqa: E402

if __name__ == "__main__":
    unittest.main()
