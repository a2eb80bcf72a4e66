"""Frames: transforms over time, and the tree that they make."""
