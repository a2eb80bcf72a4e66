"""A robot in a hallway and a person who pushes it, in closed loop, recorded as by rosbag2, with known truth."""
