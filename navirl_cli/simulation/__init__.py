"""A robot in a hallway and a person who pushes it, in closed loop, recorded as rosbag2 would, with known truth."""
