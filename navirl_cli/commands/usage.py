"""How the command line speaks: arguments that a message names are shown as options."""

import re

_ARGUMENT = re.compile(r"`([a-z][a-z0-9_]*)`")


def as_options(text: str) -> str:
    """A message of the rooms below, which name arguments, in the words of the command line.

    Args:
        text: With names of arguments between backticks, as in "name it with `wrench_frame`".

    Returns:
        The same with options, as in "name it with --wrench-frame". Backticks around anything else stay.
    """
    return _ARGUMENT.sub(lambda match: "--" + match[1].replace("_", "-"), text)
