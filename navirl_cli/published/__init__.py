"""The published user study: its archive -> paths, map, completion times -> MCAP logs."""
