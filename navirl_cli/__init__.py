"""navirl: learn how a robot should drive around people from people pushing it."""

__version__ = "0.1.0"
