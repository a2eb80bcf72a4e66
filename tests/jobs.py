"""Work that other processes find by name."""

import os
import signal
import time

from navirl_cli.parallel import cores


def double(number):
    return 2 * number


def raising_at_three(number):
    if number == 3:
        raise ValueError("three")
    return number


def killed(job):
    """End this process at the number 5: always, or until a file says that it did."""
    number, mark = job
    if number == 5 and (mark is None or not mark.exists()):
        if mark is not None:
            mark.write_text("once")
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def share(_):
    return cores()


def slow_double(number):
    time.sleep(0.02)
    return 2 * number


def signed(part, asked):
    """A part and the process that works on it; the asked part raises, and part 5 may end its process."""
    raised, mark = asked
    if part == raised:
        raise ValueError(f"part {part}")
    if mark is not None:
        killed((part, mark))
    return part, os.getpid()


def ending(part, _):
    killed((part, None))
