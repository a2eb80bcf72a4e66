"""One thin file for each subcommand: parse, call, print."""
