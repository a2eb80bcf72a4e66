"""Groups of commands that are imported when they are called, so that help and completion stay fast."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click

from navirl_cli.commands.usage import WithExamples
from navirl_cli.errors import unknown


class LazyGroup(WithExamples, click.Group):
    """A group that imports a command when it is called.

    Args:
        known: By name of the command, in the order of the help: the module that holds it (function name with _ for -)
            and its summary.
    """

    def __init__(self, *args: Any, known: Mapping[str, tuple[str, str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.known = known

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Names in the order of the help."""
        return list(self.known)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import a command."""
        if cmd_name not in self.known:
            return None
        command: click.Command = getattr(import_module(self.known[cmd_name][0]), cmd_name.replace("-", "_"))
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """For an unknown name, list the commands and propose similar ones."""
        if args and args[0] not in self.known and not args[0].startswith("-") and not ctx.resilient_parsing:
            ctx.fail(unknown("command", args[0], self.known))
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, summary) in self.known.items()])
