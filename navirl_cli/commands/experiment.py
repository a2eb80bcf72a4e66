"""``navirl.toml`` beside the data: an experiment's own defaults, below the command line and above those of navirl."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import click

from navirl_cli.errors import ArtefactError, brief, unknown

NAME: Final = "navirl.toml"
#: Options that may stand outside of a table: constants of an experiment, for every command that has the option.
CONSTANTS: Final = (
    *("robot-radius", "resolution", "rasterizer", "topic", "namespace", "map", "frame", "wrench-frame", "force-scale"),
    *("time", "split", "contact-force", "wrench-filter"),
)
#: Options of one call, which a file does not decide.
_OF_A_CALL: Final = {"output", "force", "help"}


@dataclass(frozen=True)
class Experiment:
    """The content of a file."""

    path: Path
    content: Mapping[str, Any]

    def of(self, words: Sequence[str], command: click.Command) -> dict[str, Any]:
        """Values for a command by click's names of its options; paths are relative to the file's folder.

        Args:
            words: That call the command, such as ("plot", "paths").
            command: The command.

        Raises:
            ArtefactError: A table names an option that the command does not have, or one of a single call.
        """
        known = _options(command)
        found = {name: value for name, value in self.content.items() if name in CONSTANTS and name in known}
        table: Any = self.content
        for word in words:
            table = table.get(word, {}) if isinstance(table, Mapping) else {}
        if not isinstance(table, Mapping):
            raise ArtefactError(f"{self.path}: {' '.join(words)}: expected a table, found {brief(table)}")
        for name, value in table.items():
            if isinstance(value, Mapping) and name != "topic":
                continue  # the table of a command in a group
            if name not in known or name in _OF_A_CALL:
                names = [one for one in known if one not in _OF_A_CALL]
                raise ArtefactError(f"{self.path}: [{'.'.join(words)}] {unknown(name, name, names)}")
            found[name] = value
        return {str(known[name].name): self._value(known[name], name, value) for name, value in found.items()}

    def _value(self, option: click.Option, name: str, value: Any) -> Any:
        """A value as click expects it before it converts it."""
        if isinstance(value, Mapping):  # topics by role
            pairs = [(key, own if isinstance(own, list) else [own]) for key, own in value.items()]
            value = [f"{key}={one}" for key, own in pairs for one in own]
        if isinstance(value, list) and not option.multiple:
            raise ArtefactError(f"{self.path}: {name}: expected one value, found {brief(value)}")
        values = value if isinstance(value, list) else [value]
        if not all(isinstance(one, str | int | float) for one in values):
            raise ArtefactError(f"{self.path}: {name}: expected texts or numbers, found {brief(value)}")
        if isinstance(option.type, click.Path):
            values = [str(self.path.parent / str(one)) for one in values]
        if option.is_flag:
            return values[0]
        texts = [str(one) for one in values]
        return texts if option.multiple else texts[0]

    def check(self, words: Iterable[Sequence[str]]) -> None:
        """Refuse names outside of tables that are neither a constant nor a command.

        Args:
            words: That call the commands.

        Raises:
            ArtefactError: There is such a name.
        """
        known = [*CONSTANTS, *dict.fromkeys(one[0] for one in words)]
        for name in self.content:
            if name not in known:
                raise ArtefactError(f"{self.path}: {unknown(name, name, known)}")


def _options(command: click.Command) -> dict[str, click.Option]:
    """The options of a command by their long names without dashes."""
    options = [one for one in command.params if isinstance(one, click.Option)]
    return {max(one.opts, key=len).removeprefix("--"): one for one in options}


def experiment_for(places: Iterable[str | Path]) -> Experiment | None:
    """The file beside data: in their folder, or in the present one.

    Args:
        places: Words of the command line, of which those that exist are data.

    Raises:
        ArtefactError: The file cannot be read or is no TOML.
    """
    for folder in dict.fromkeys(folder for place in (*places, ".") for folder in _folders(place)):
        path = folder / NAME
        if path.is_file():
            return _read(path)
    return None


def _folders(place: str | Path) -> list[Path]:
    """The folders in which the file of some data may be."""
    try:
        path = Path(place)
        if path.is_dir():
            return [path] if path == Path() else [path, path.parent]
        return [path.parent] if path.is_file() else []
    except (OSError, ValueError):  # a word that cannot be a path
        return []


def _read(path: Path) -> Experiment:
    """The content of a file."""
    import tomllib

    from navirl_cli.files import read_regular

    try:
        return Experiment(path, tomllib.loads(read_regular(path).decode("utf-8")))
    except OSError as error:
        raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise ArtefactError(f"{path}: expected TOML, found none ({error}); correct it") from error
