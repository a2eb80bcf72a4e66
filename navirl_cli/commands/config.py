"""``navirl config``: which values hold, and from where."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from navirl_cli.commands.experiment import CONSTANTS, NAME, experiment_for
from navirl_cli.commands.shared import echo, echo_json, json_option
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import Column, Table, written
from navirl_cli.errors import ArtefactError

#: Of where a value is from.
_DEFAULT, _UNSET = "default", "not set"


@click.command(
    cls=Command,
    examples=[
        Example("What holds in this folder", "navirl config ."),
        Example("What holds for the logs of a folder", "navirl config logs"),
    ],
)
@click.argument("data", required=False, type=FilePath)
@section("Output", json_option)
def config(data: Path | None, as_json: bool) -> None:
    """Show which values options have beside some data, and from where.

    Without a value on the command line, an option has that of navirl.toml in the folder of the data or in the present
    one, else its default. Outside of tables, the file may hold constants of an experiment, as robot-radius = 0.35 or
    topic = ["wrench=/ft"], for every command that has the option. A table as [extract] or [plot.paths] holds any
    options of this command.
    """
    if data is not None and not data.exists():
        raise ArtefactError(f"{data}: expected a folder or a file, found none")
    experiment = experiment_for([] if data is None else [data])
    rows = list(_rows(experiment))
    if as_json:
        keys = ("command", "option", "value", "source")
        file = None if experiment is None else str(experiment.path)
        echo_json({"file": file, "options": [dict(zip(keys, row, strict=True)) for row in rows]})
        return
    echo(f"no {NAME} here" if experiment is None else f"{experiment.path}")
    table = Table(tuple(map(Column, ("command", "option", "value", "from"))), tuple(rows))
    echo(written(table))


def _rows(experiment: Any) -> Iterator[tuple[str, str, str, str]]:
    """A row for each constant of each command, and for each option that the file sets."""
    words = dict(_commands(click.get_current_context().find_root().command))
    if experiment is not None:
        experiment.check(words)
    for own, command in words.items():
        values = {} if experiment is None else experiment.of(own, command)
        for option in command.params:
            if not isinstance(option, click.Option):
                continue
            name = max(option.opts, key=len).removeprefix("--")
            if option.name in values:
                _check(command, option, values[option.name], experiment)
                yield " ".join(own), name, _shown(values[option.name]), NAME
            elif name in CONSTANTS and own == ("extract",):
                default = option.to_info_dict()["default"]
                text = _shown(default)
                yield " ".join(own), name, text, _DEFAULT if text else _UNSET


def _check(command: click.Command, option: click.Option, value: Any, experiment: Any) -> None:
    """Refuse a value that the command would refuse."""
    try:
        option.type_cast_value(click.Context(command), value)
    except click.BadParameter as error:
        name = max(option.opts, key=len).removeprefix("--")
        raise ArtefactError(f"{experiment.path}: {name}: {error.message}") from None


def _shown(value: Any) -> str:
    """A value on one line; empty for none."""
    if value is None or "UNSET" in repr(value).upper():
        return ""
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _commands(group: click.Command, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Words that call a command, and the command."""
    if not isinstance(group, click.Group):
        yield words, group
        return
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is not None:
            yield from _commands(command, (*words, name))
