"""Plan a robot's path in a scene under a learnt reward."""
