"""From a recording to demonstrations: trials, contact with the person, the grid and the path on it."""
