"""Types of options and arguments: valid words and shell completion."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from os import fsdecode, sep
from os.path import isdir
from pathlib import Path
from typing import Any

import click

from navirl_cli.errors import ArgumentError, unknown
from navirl_cli.remote import Remote, path_of

#: Whoever reads a file says why it cannot be read, and goes on with others.
FilePath = click.Path(path_type=Path, readable=False)


class LogPath(click.Path):
    """A file, a folder, a pattern, or an address in a store."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Keep addresses as they are."""
        return path_of(value) if isinstance(value, Remote) else path_of(fsdecode(super().convert(value, param, ctx)))


@dataclass(frozen=True)
class Output:
    """Where to write."""

    path: Path
    is_folder: bool


class FileOrFolder(click.Path):
    """A file; or a folder, which exists or whose name ends in a slash."""

    name = "path"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Output:  # type: ignore[override]
        """Keep the slash, which paths do not."""
        if isinstance(value, Output):
            return value
        text = fsdecode(super().convert(value, param, ctx))
        is_folder = isdir(text)  # noqa: PTH112 no folder has a name that is too long, which is_dir raises
        return Output(Path(text), text.endswith(("/", sep)) or is_folder)


class Choice(click.Choice[str]):
    """One of several words; similar words are proposed for an unknown one."""

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:  # noqa: ARG002
        """The valid words, and similar ones."""
        return unknown("", value, self.choices)


class RoleTopic(click.ParamType):  # type: ignore[type-arg]
    """``ROLE=/topic``, for one of the roles that extract knows."""

    name = "role=/topic"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        """Split at the first equals sign."""
        from navirl_cli.logs.roles.topics import ROLES

        role, equals, topic = str(value).partition("=")
        if not (role and equals and topic):
            self.fail(f"expected ROLE=/topic, found {value!r}", param, ctx)
        roles = [one.name for one in ROLES]
        if role not in roles:
            self.fail(unknown("role", role, roles), param, ctx)
        return role, topic


class Terms(click.ParamType):  # type: ignore[type-arg]
    """Comma-separated terms of a reward."""

    name = "term,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        """Look the names up."""
        from navirl_cli.irl.terms.registry import terms_named

        if not isinstance(value, str):
            return tuple(value)
        try:
            return terms_named([word.strip() for word in value.split(",")])
        except ArgumentError as error:
            self.fail(str(error).removeprefix("`terms`: "), param, ctx)


class Number(click.FloatRange):
    """A finite number within bounds. click's own type accepts nan."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Parse and check."""
        number = float(super().convert(value, param, ctx))
        if not isfinite(number):
            self.fail(f"expected a finite number, found {value!r}", param, ctx)
        return number


class Count(click.IntRange):
    """A whole number within bounds."""

    name = "integer"


class Point(click.ParamType):  # type: ignore[type-arg]
    """A point as ``x,y`` in m."""

    name = "x,y"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """Parse two numbers."""
        try:
            x, y = (float(part) for part in str(value).split(","))
        except ValueError:
            names = {one.name for one in ctx.command.params} if ctx else set()
            hint = "; --person-name takes a name" if param and param.name == "people" and "person_name" in names else ""
            self.fail(f"expected two numbers in m as x,y, found {value!r}{hint}", param, ctx)
        if not (isfinite(x) and isfinite(y)):
            self.fail(f"expected finite numbers, found {value!r}", param, ctx)
        return x, y


class OutputPath(click.Path):
    """The name of a file to write, whose ending chooses the format."""

    def __init__(self, endings: Sequence[str]) -> None:
        super().__init__(path_type=Path)
        self.endings = tuple(endings)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Refuse an ending without a format."""
        path = Path(fsdecode(super().convert(value, param, ctx)))
        if path.suffix.lower() not in self.endings:
            *others, last = self.endings
            endings = f"{', '.join(others)} or {last}" if others else last
            self.fail(f"expected a name that ends in {endings}, found {path.name!r}", param, ctx)
        return path


class Pose(click.ParamType):  # type: ignore[type-arg]
    """A pose as ``x,y`` or ``x,y,yaw`` in m and rad."""

    name = "x,y[,yaw]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Parse two or three numbers."""
        try:
            pose = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            pose = ()
        if len(pose) not in {2, 3} or not all(map(isfinite, pose)):
            self.fail(f"expected two or three finite numbers in m, m and rad as x,y,yaw, found {value!r}", param, ctx)
        return pose
