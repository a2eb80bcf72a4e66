"""Which topic is what, and what its columns mean: clocks, poses, people, maps, session."""
