"""The command line. Commands are imported when called. Only this module turns expected errors into messages."""

import errno
import gc
import os
import signal
import sys
from types import FrameType
from typing import Any

import click

from navirl_cli import __version__, limits
from navirl_cli.commands.lazy import LazyGroup
from navirl_cli.commands.usage import Example, as_options
from navirl_cli.documents.inline import printable
from navirl_cli.errors import NavirlError

#: Summaries of the commands, in the order of the work. The module navirl_cli.commands.NAME holds the command NAME, with
#: _ for -. It is imported when the command is called, so that help and completion are fast.
COMMANDS = {
    "inspect": "Show the content of logs, and the topics that extract would use.",
    "annotate": "Write the labels of trials into a copy of a log.",
    "extract": "Turn MCAP logs into demonstrations.",
    "info": "Show what a file of demonstrations, a reward, metrics, a plan or a study holds.",
    "select": "Write some of the trials of a demonstrations file.",
    "merge": "Write the trials of several demonstrations files into one, or those of a folder with a manifest.",
    "relabel": "Give trials of a demonstrations file other labels, without extracting them again.",
    "fit": "Learn a navigation reward from demonstrations.",
    "models": "Compare rewards by how well they predict participants left out.",
    "evaluate": "Measure demonstrated, learnt and baseline paths, and compare groups of them.",
    "plot": "Draw paths, policies, rewards, path properties and fits.",
    "plan": "Plan the path of a robot that drives by a learnt reward.",
    "watch": "Learn from the recordings of a folder as they are finished, and plan the next paths.",
    "export": "Write a learnt reward for Nav2, for viewers, or in other conventions.",
    "view": "Show a scene under a learnt reward in Rerun.",
    "report": "Write one self-contained HTML page on demonstrations and the reward learnt from them.",
    "study": "Evaluate a study as the paper does: fits by participant and pooled, figures, claims, report.",
    "import-study": "Turn the published user study (RUNS) into logs.",
    "config": "Show which values options have beside some data, and from where.",
    "simulate": "Simulate people who push a robot, and write logs with known truth.",
}


#: New objects after which the garbage collector looks for circles: with Python's 700, it takes a tenth of drawing.
_UNCOLLECTED = 20_000
#: Errors of writing to a stream that is no file of ours.
_FULL = {errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EFBIG}


class _Terminated(KeyboardInterrupt):
    """SIGTERM: cleaned up after as Ctrl-C is."""


def _terminate(_number: int, _frame: FrameType | None) -> None:
    raise _Terminated


class _Root(LazyGroup):
    """The group of all commands, and the boundary for expected errors."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; expected errors and Ctrl-C become one line on stderr and an exit code."""
        try:
            return super().invoke(ctx)
        except NavirlError as error:
            if ctx.params.get("debug"):
                raise
            line, code = as_options(str(error)), error.exit_code
        except _Terminated:
            line, code = "terminated", 143  # as a shell reports a process that SIGTERM ended
        except KeyboardInterrupt:
            line, code = "interrupted", 130  # the same of SIGINT
        click.echo(f"navirl: {printable(line)}", err=True)
        return ctx.exit(code)


@click.group(
    cls=_Root,
    known={name: (f"navirl_cli.commands.{name.replace('-', '_')}", summary) for name, summary in COMMANDS.items()},
    context_settings={"help_option_names": ["-h", "--help"]},
    examples=[
        Example("From logs to demonstrations", "navirl extract p01.mcap p02.mcap p03.mcap -o demos.json"),
        Example("From demonstrations to a reward", "navirl fit demos.json -o reward.json"),
        Example(
            "Expected visits of the learnt policy", "navirl plot policy demos.json --reward reward.json -o policy.pdf"
        ),
    ],
)
@click.version_option(__version__, prog_name="navirl")
@click.option("--debug", is_flag=True, help="Show the traceback of expected errors too.")
@click.option("--no-limits", is_flag=True, help="Read files that unpack to much more than their own size.")
def cli(debug: bool, no_limits: bool) -> None:  # noqa: ARG001 - the group reads it
    """Learn how a robot should drive around people from people who push it.

    Exit codes: 0 done; 1 error in the data or files; 2 wrong usage; 3 done, but some data was lost or skipped; 130
    interrupted; 143 terminated.
    """
    if no_limits:
        os.environ[limits.VARIABLE] = "1"


def main() -> None:
    """Entry point of the command ``navirl``."""
    # The matrices are sparse or small: starting the threads of a BLAS would cost more time than they save. Their number
    # is set before numpy is imported, unless the user has set it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Little of what commands make refers to itself; figures do, in thousands of parts that stay until they are saved.
    gc.set_threshold(_UNCOLLECTED)
    for number in (signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup sets it
            signal.signal(number, _terminate)
    if "_NAVIRL_COMPLETE" in os.environ:
        from navirl_cli.commands.completion import use_whole_words

        use_whole_words()
    try:
        cli(prog_name="navirl")
    except OSError as error:
        if error.filename is not None or error.errno not in _FULL:
            raise
        click.echo(f"navirl: standard output cannot be written: {error.strerror}", err=True)
        sys.exit(1)
