"""Help and messages of the command line: options in sections, examples, and arguments shown as options."""

import re
from collections.abc import Callable, Sequence
from time import process_time
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import click
from click.core import ParameterSource

from navirl_cli import __version__
from navirl_cli.commands.experiment import experiment_for
from navirl_cli.errors import ArgumentError

Function = TypeVar("Function", bound=Callable[..., Any])
#: Sections that end every help.
_LAST = ("Output", "Help")
#: The section of an option in its command's help.
_SECTIONS: WeakKeyDictionary[click.Parameter, str] = WeakKeyDictionary()
#: Keys of click's ``Context.meta``.
QUIET, VERBOSE, EXPERIMENT = "navirl.quiet", "navirl.verbose", "navirl.experiment"
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


def given_words() -> list[str]:
    """The options that the present command was given, by the user or by navirl.toml, as an artefact keeps them."""
    from navirl_cli.artefacts.options import option_words

    context = click.get_current_context()
    given: dict[str, Any] = {}
    defaults: dict[str, Any] = {}
    for param in context.command.params:
        known = context.get_parameter_source(param.name or "") not in {ParameterSource.DEFAULT, None}
        if isinstance(param, click.Option) and known:
            name = max(param.opts, key=len).removeprefix("--").replace("-", "_")
            given[name], defaults[name] = context.params[param.name or ""], param.default
    return option_words(given, defaults)


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


def _exclusive(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Remember --quiet or --verbose; both at once are refused."""
    if value:
        own, other = (QUIET, VERBOSE) if param.name == "quiet" else (VERBOSE, QUIET)
        if ctx.meta.get(other):
            raise click.UsageError("--quiet and --verbose exclude each other; leave out one.")
        ctx.meta[own] = True


def is_quiet() -> bool:
    """Whether the user wants results and errors only."""
    return _asked(QUIET)


def is_verbose() -> bool:
    """Whether the user wants to see the progress wherever the output goes."""
    return _asked(VERBOSE)


def _asked(key: str) -> bool:
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(key))


def _say_of_experiment(ctx: click.Context) -> None:
    """A line on the values of navirl.toml that count; with --verbose one on the file that gives none."""
    experiment = ctx.meta.get(EXPERIMENT)
    if experiment is None or is_quiet():
        return
    taken = [
        f"{max(param.opts, key=len)} {' '.join(map(str, value)) if isinstance(value, list) else value}"
        for param in ctx.command.params
        if ctx.get_parameter_source(param.name or "") is ParameterSource.DEFAULT_MAP
        for value in [(ctx.default_map or {})[param.name or ""]]
    ]
    if taken or ctx.meta.get(VERBOSE):
        click.echo(f"navirl: {experiment.path}: {', '.join(taken) or 'nothing for this command'}", err=True)


#: Options of every command.
_EVERYWHERE = (
    click.Option(
        ["--quiet"],
        is_flag=True,
        expose_value=False,
        callback=_exclusive,
        help="Results, errors and lost data only: no remarks, no progress.",
    ),
    click.Option(
        ["--verbose"],
        is_flag=True,
        expose_value=False,
        callback=_exclusive,
        help="Also the progress without a terminal, the settings file, version and CPU time.",
    ),
)


for _option in _EVERYWHERE:
    _SECTIONS[_option] = "Output"


class Command(WithExamples):
    """A command whose help shows options in sections, as set by :func:`section`.

    An :class:`~navirl_cli.errors.ArgumentError` is an error of usage.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        _say_of_experiment(ctx)
        started = process_time()
        try:
            return super().invoke(ctx)
        except ArgumentError as error:
            raise click.UsageError(as_options(str(error)), ctx) from error
        finally:
            if is_verbose():
                click.echo(f"navirl: version {__version__}, {process_time() - started:.2f} s of CPU", err=True)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The options of the command, those of every command, and --help."""
        *own, last = super().get_params(ctx)
        return [*own, *_EVERYWHERE, last]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words, with the values of navirl.toml beside the data in place of defaults."""
        if not ctx.resilient_parsing:
            self._take_experiment(ctx, args)
        try:
            return super().parse_args(ctx, args)
        except click.BadParameter as error:
            name, experiment = "" if error.param is None else error.param.name or "", ctx.meta.get(EXPERIMENT)
            if experiment is not None and ctx.get_parameter_source(name) is ParameterSource.DEFAULT_MAP:
                text = f"{error.message} ({experiment.path})"
                raise click.BadParameter(text, error.ctx, error.param, error.param_hint) from error
            raise

    def _take_experiment(self, ctx: click.Context, args: Sequence[str]) -> None:
        """Use the file's values as defaults; a line says which, if the command runs."""
        if ctx.command.name == "config" or {"-h", "--help"} & {*args}:
            return
        experiment = experiment_for(args)
        if experiment is not None:
            words = ctx.command_path.split()[1:]
            experiment.check((name,) for name in getattr(ctx.find_root().command, "known", words))
            ctx.default_map = experiment.of(words, self)
            ctx.meta[EXPERIMENT] = experiment

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
