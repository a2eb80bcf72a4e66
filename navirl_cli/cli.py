"""The command line: subcommands are loaded when called, and known trouble becomes a message here and only here."""

import sys
from typing import Any

import click

from navirl_cli import __version__
from navirl_cli.commands.lazy import LazyGroup
from navirl_cli.commands.usage import as_options
from navirl_cli.errors import NavirlError

#: By name: what the help lists. The module navirl_cli.commands.NAME holds a command NAME (with _ for -); it is loaded
#: when called, so that help and completion stay fast.
COMMANDS = {
    "inspect": "Tell what logs hold, and what extract would make of it.",
    "extract": "Turn MCAP logs into demonstrations.",
    "fit": "Learn a navigation reward from demonstrations.",
    "evaluate": "Measure demonstrated, learnt and baseline paths, and how groups of them differ.",
    "plot": "Draw paths, policies, rewards, path properties and fits.",
    "report": "Tell what was learnt, in one HTML page without anything from elsewhere.",
    "study": "Evaluate a study as the paper does: fits by participant and pooled, figures, claims, report.",
    "import-study": "Turn the published user study (RUNS) into logs.",
    "simulate": "Write simulated logs of people pushing a robot, with known truth.",
}


class _Root(LazyGroup):
    """The group of all commands, and the boundary for known trouble."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; expected errors and Ctrl-C become one line on stderr and an exit code."""
        try:
            return super().invoke(ctx)
        except NavirlError as error:
            if ctx.params.get("debug"):
                raise
            line, code = as_options(str(error)), 1
        except KeyboardInterrupt:
            line, code = "interrupted", 130  # as a shell reports a process that SIGINT ended
        click.echo(f"navirl: {line}", err=True)
        return ctx.exit(code)


@click.group(
    cls=_Root,
    known={name: (f"navirl_cli.commands.{name.replace('-', '_')}", summary) for name, summary in COMMANDS.items()},
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="navirl")
@click.option("--debug", is_flag=True, help="Show the traceback of known trouble too.")
def cli(debug: bool) -> None:
    """Learn how a robot should drive around people from people pushing it.

    \b
    navirl extract logs/*.mcap -o demos.json
    navirl fit demos.json -o reward.json
    navirl evaluate demos.json --reward reward.json
    navirl plot policy demos.json --reward reward.json -o policy.pdf

    Exit codes: 0 done, 1 known trouble, 2 wrong usage, 3 done but some data was lost or skipped.
    """  # noqa: D301 click reads the \b


def main() -> None:
    """Entry point of the command ``navirl``."""
    sys.exit(cli(prog_name="navirl"))
