"""MCAP bytes: records, chunks, indexes, damage; a log file that hands out batches of messages."""
