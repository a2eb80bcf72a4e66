"""Which topic is what, and what its columns mean: clocks, poses, wrench, people, commands, maps, session."""
