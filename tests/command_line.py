"""Every command of the command line, with its options: for tests that hold for all of them."""

from collections.abc import Iterator

import click

from navirl_cli.cli import cli


def commands(group: click.Group = cli, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Words that call a command, and the command; those of a group in place of the group."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, (*words, name))
        else:
            yield (*words, name), command


def options(command: click.Command) -> list[click.Option]:
    """The options of a command, without --help."""
    return [param for param in command.params if isinstance(param, click.Option)]


def option_names() -> set[str]:
    """The long names of all options of all commands."""
    everywhere = [cli, *(command for _, command in commands())]
    return {name for command in everywhere for option in options(command) for name in option.opts if name[1] == "-"}
