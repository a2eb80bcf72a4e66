"""Help and messages of the command line: options in sections, examples, and arguments shown as options."""

import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import click
from click.core import ParameterSource

from navirl_cli.errors import ArgumentError

Function = TypeVar("Function", bound=Callable[..., Any])
#: Sections that end every help.
_LAST = ("Output", "Help")
#: The section of an option in its command's help.
_SECTIONS: WeakKeyDictionary[click.Parameter, str] = WeakKeyDictionary()
_ARGUMENT = re.compile(r"`([a-z][a-z0-9_]*)`")


def as_options(text: str) -> str:
    """A message with its arguments shown as options.

    Args:
        text: With names of arguments between backticks, as in "name it with `wrench_frame`".

    Returns:
        The same with options, as in "name it with --wrench-frame". Other text in backticks is unchanged.
    """
    return _ARGUMENT.sub(lambda match: "--" + match[1].replace("_", "-"), text)


def refuse_unused(needs: str, *names: str, used: bool) -> None:
    """Refuse options of the command line that nothing reads.

    Args:
        needs: What they go with, such as "--reward".
        names: Of click's parameters.
        used: Whether it is there.

    Raises:
        UsageError: The user set one, and it is not.
    """
    context = click.get_current_context()
    for param in context.command.params:
        given = context.get_parameter_source(param.name or "") is ParameterSource.COMMANDLINE
        if given and not used and param.name in names:
            raise click.UsageError(f"{max(param.opts, key=len)} goes with {needs}.")


class Example(NamedTuple):
    """A command that a reader can copy, and its purpose."""

    purpose: str
    line: str


class WithExamples(click.Command):
    """A command whose help ends with examples.

    Args:
        examples: Two or three; tests run them on the sample logs.
    """

    def __init__(self, *args: Any, examples: Sequence[Example] = (), **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.examples = tuple(examples)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        super().format_epilog(ctx, formatter)
        if not self.examples:
            return
        with formatter.section("Examples"):
            for purpose, line in self.examples:
                formatter.write_text(f"{purpose}:")
                formatter.indent()
                formatter.write_text(f"\b\n{line}")  # never wrapped, because readers copy it
                formatter.dedent()


class Command(WithExamples):
    """A command whose help shows options in sections, as set by :func:`section`.

    An :class:`~navirl_cli.errors.ArgumentError` is an error of usage.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except ArgumentError as error:
            raise click.UsageError(as_options(str(error)), ctx) from error

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write each section."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if isinstance(param, click.Option) and (record := param.get_help_record(ctx)) is not None:
                sections.setdefault(_SECTIONS.get(param, "Help"), []).append(record)
        for title in sorted(sections, key=lambda title: _LAST.index(title) if title in _LAST else -1):
            with formatter.section(title):
                formatter.write_dl(sections[title])


def section(title: str, *options: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Options of one section of the help, as one decorator.

    Args:
        title: Title of the section.
        options: Decorators, as of :func:`click.option`, in the order of the help.
    """

    def decorate(function: Function) -> Function:
        decorated: Any = function
        before = len(getattr(function, "__click_params__", ()))
        for option in reversed(options):
            decorated = option(decorated)
        for param in decorated.__click_params__[before:]:
            _SECTIONS.setdefault(param, title)
        return decorated  # type: ignore[no-any-return]

    return decorate
