#!/usr/bin/env python3
"""Publish the learnt cost around people as a live mask for Nav2's KeepoutFilter.

Subscribes to the map and to people. Publishes a mask of the map's geometry (nav_msgs/OccupancyGrid) and, once, the
CostmapFilterInfo that names it. Needs rclpy, tf2_ros and numpy. Parameters stand in people_mask.yaml:

    python3 people_mask_node.py --ros-args --params-file people_mask.yaml

The cost of a person is amplitude x exp(-d^2 / (2 covariance_m2)). Costs of several people add up, as in the reward. A
cell without cost is unknown (-1) in the mask, so that the filter leaves it as it is. A new mask is sent only when it
differs from the last one, because the filter logs each arrival. People who are not heard of for forget_s are dropped.
This is no safety function: obstacles, speed limits and the collision monitor must work without it.
"""

import math
from array import array

import numpy as np
import rclpy
from geometry_msgs.msg import PoseArray
from nav2_msgs.msg import CostmapFilterInfo
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from tf2_ros import Buffer, TransformException, TransformListener

#: KeepoutFilter makes 2.54 of one per cent; 100 per cent is an obstacle.
COST_PER_PERCENT, MOST_PERCENT, UNKNOWN = 2.54, 99, -1


def mask_of(people, shape, resolution_m, origin_m, amplitude, covariance_m2):
    """The occupancy of every cell, (rows, columns) int8; row 0 has the lowest y.

    people: (x, y) in m in the map's frame. shape: rows, columns. origin_m: lower left corner of the first cell.
    """
    costs = np.zeros(shape)
    rows, columns = shape
    if amplitude > 0:
        # farther away a person's cost rounds to nothing, even where two add up
        reach_m = math.sqrt(2 * covariance_m2 * max(0.0, math.log(amplitude / (0.1 * COST_PER_PERCENT))))
        for x, y in people:
            column, row = (x - origin_m[0]) / resolution_m, (y - origin_m[1]) / resolution_m
            cells = reach_m / resolution_m + 1
            left, right = max(0, int(column - cells)), min(columns, int(column + cells) + 1)
            low, high = max(0, int(row - cells)), min(rows, int(row + cells) + 1)
            if left >= right or low >= high:
                continue
            dx = (np.arange(left, right) + 0.5 - column) * resolution_m
            dy = (np.arange(low, high) + 0.5 - row) * resolution_m
            bump = np.exp(-(dy[:, None] ** 2) / (2 * covariance_m2)) * np.exp(-(dx**2) / (2 * covariance_m2))
            costs[low:high, left:right] += amplitude * bump
    percent = np.clip(np.round(costs / COST_PER_PERCENT), 0, MOST_PERCENT).astype(np.int8)
    percent[percent == 0] = UNKNOWN
    return percent


def yaw_of(rotation):
    """The yaw of a quaternion, rad."""
    return math.atan2(2 * (rotation.w * rotation.z + rotation.x * rotation.y), 1 - 2 * (rotation.y**2 + rotation.z**2))


class PeopleMask(Node):
    """People and map in, mask out."""

    def __init__(self):
        super().__init__("people_mask")
        defaults = {
            "amplitude": 0.0,
            "covariance_m2": 0.3,
            "people_topic": "/people",
            "people_type": "people_msgs/msg/People",
            "map_topic": "/map",
            "mask_topic": "/people_filter_mask",
            "info_topic": "/people_filter_info",
            "rate_hz": 2.0,
            "forget_s": 2.0,
        }
        for name, value in defaults.items():
            self.declare_parameter(name, value)
        self.given = {name: self.get_parameter(name).value for name in defaults}
        if self.given["covariance_m2"] <= 0 or self.given["rate_hz"] <= 0:
            raise ValueError("covariance_m2 and rate_hz must be above 0")
        self.map = None
        self.people = None
        self.heard = None
        self.sent = None
        latched = QoSProfile(
            depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE
        )
        self.buffer = Buffer()
        self.listener = TransformListener(self.buffer, self)
        self.mask_publisher = self.create_publisher(OccupancyGrid, self.given["mask_topic"], latched)
        self.info_publisher = self.create_publisher(CostmapFilterInfo, self.given["info_topic"], latched)
        self.create_subscription(OccupancyGrid, self.given["map_topic"], self.on_map, latched)
        self.create_subscription(self.people_class(), self.given["people_topic"], self.on_people, 10)
        self.timer = self.create_timer(1.0 / self.given["rate_hz"], self.on_timer)
        info = CostmapFilterInfo()
        info.type = 0
        info.filter_mask_topic = self.given["mask_topic"]
        info.base = 0.0
        info.multiplier = 1.0
        self.info_publisher.publish(info)

    def people_class(self):
        """The type of the messages about people."""
        if self.given["people_type"] == "geometry_msgs/msg/PoseArray":
            return PoseArray
        if self.given["people_type"] == "people_msgs/msg/People":
            from people_msgs.msg import People

            return People
        raise ValueError(
            "people_type: expected people_msgs/msg/People or geometry_msgs/msg/PoseArray, "
            f"found {self.given['people_type']}"
        )

    def on_map(self, message):
        """Take a new map."""
        if abs(yaw_of(message.info.origin.orientation)) > 1e-6:
            self.get_logger().error("the map is rotated, which masks cannot be here; no mask is published")
            self.map = None
            return
        self.map = message
        self.sent = None

    def on_people(self, message):
        """Take the people of a message."""
        self.people = message
        self.heard = self.get_clock().now().nanoseconds

    def on_timer(self):
        """Publish the mask if it changed."""
        if self.map is None:
            return
        info = self.map.info
        origin = (info.origin.position.x, info.origin.position.y)
        try:
            people = self.people_in(self.map.header.frame_id)
        except TransformException as error:
            self.get_logger().warning(f"people are left out: {error}", throttle_duration_sec=5.0)
            people = []
        mask = mask_of(
            people,
            (info.height, info.width),
            info.resolution,
            origin,
            self.given["amplitude"],
            self.given["covariance_m2"],
        )
        if self.sent is not None and np.array_equal(mask, self.sent):
            return
        self.sent = mask
        message = OccupancyGrid()
        message.header.frame_id = self.map.header.frame_id
        message.header.stamp = self.get_clock().now().to_msg()
        message.info = info
        message.data = array("b", mask.tobytes())
        self.mask_publisher.publish(message)

    def people_in(self, frame):
        """(x, y) of the people heard of lately, in a frame."""
        if self.people is None:
            return []
        if self.get_clock().now().nanoseconds - self.heard > self.given["forget_s"] * 1e9:
            return []
        poses = getattr(self.people, "poses", None)
        own = [one.position for one in (self.people.people if poses is None else poses)]
        source = self.people.header.frame_id
        if source in ("", frame):
            return [(one.x, one.y) for one in own]
        # the latest transform: people are slow against the time that it is late
        transform = self.buffer.lookup_transform(frame, source, Time()).transform
        yaw = yaw_of(transform.rotation)
        cos, sin = math.cos(yaw), math.sin(yaw)
        at = transform.translation
        return [(at.x + cos * one.x - sin * one.y, at.y + sin * one.x + cos * one.y) for one in own]


def main():
    """Run the node until it is stopped."""
    rclpy.init()
    node = PeopleMask()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
