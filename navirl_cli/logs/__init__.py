"""Logs: the bytes of MCAP files become columns of numbers, and columns become files.

Read with `navirl_cli.logs.messages.reader` (scan, read), write with `navirl_cli.logs.messages.writer`, relate frames
with `navirl_cli.logs.tf.tree`. The modules are imported where they are needed; this package imports none of them.
"""
