"""Shell completion: names from the files on the command line, and lists of names.

Completion never raises and never prints. A file that cannot be read gives no proposals.
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias
from warnings import catch_warnings, simplefilter

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class

if TYPE_CHECKING:
    from navirl_cli.demos.demonstration import Demonstration

#: Characters with a special meaning in bash.
_SPECIAL, _ESCAPED = re.compile(r"[^\w,./:=@%+-]"), r"\\\g<0>"
#: click's function for proposals: of the context with the words so far, the parameter, and the word at the cursor.
Complete: TypeAlias = "Callable[[click.Context, click.Parameter, str], list[CompletionItem[str]]]"


def use_whole_words() -> None:
    """Use :class:`WholeWords` for completion in bash."""
    add_completion_class(WholeWords)


def _proposed(names: Callable[[click.Context, str], Iterable[str]]) -> Complete:
    """The names that begin with the word at the cursor; none after any error."""

    def complete(ctx: click.Context, _param: click.Parameter, incomplete: str) -> "list[CompletionItem[str]]":
        with suppress(Exception), redirect_stdout(StringIO()), redirect_stderr(StringIO()), catch_warnings():
            simplefilter("ignore")
            return [CompletionItem(name) for name in names(ctx, incomplete) if name.startswith(incomplete)]
        return []

    return complete


def _files(ctx: click.Context, name: str) -> list[Path]:
    """The files of an argument. While an option lacks its value, click keeps them among the other words."""
    found = ctx.params.get(name) or ctx.args
    return [Path(one) for one in ([found] if isinstance(found, Path) else found)]


def _demonstrations(ctx: click.Context) -> "list[Demonstration]":
    """Those of the files on the command line: of the argument, or of ``--scene DEMOS[:TRIAL]``."""
    from navirl_cli.artefacts.joined import read_joined

    scene = ctx.params.get("scene")
    if scene is None:
        return read_joined(_files(ctx, "demos"))
    return read_joined([Path(scene if Path(scene).exists() else scene.rpartition(":")[0])])


@_proposed
def trials(ctx: click.Context, _incomplete: str) -> Iterator[str]:
    """Ids of the demonstrations in the file on the command line."""
    return (one.id for one in _demonstrations(ctx))


def _names(field: str) -> Complete:
    """Names of a field of the demonstrations in the file on the command line."""

    @_proposed
    def names(ctx: click.Context, _incomplete: str) -> Iterable[str]:
        from navirl_cli.demos.subset import FIELDS

        found = [FIELDS[field](one) for one in _demonstrations(ctx)]
        return sorted({name.removeprefix("cycle ") for name in found if name != "no cycle"})

    return names


cycles, sets, participants = _names("cycle"), _names("set"), _names("participant")


@_proposed
def groups(ctx: click.Context, _incomplete: str) -> Iterable[str]:
    """Groups of the demonstrations in the file on the command line, by the fields on it."""
    from navirl_cli.evaluation.groups import by_group

    return by_group(_demonstrations(ctx), ctx.params.get("fields") or ())


@_proposed
def parameters(ctx: click.Context, _incomplete: str) -> Iterator[str]:
    """Parameters of the terms on the command line, or of the paper's reward."""
    from navirl_cli.irl.reward import PAPER_TERMS, parameters_of

    return (parameter.name for parameter in parameters_of(ctx.params.get("terms") or PAPER_TERMS))


def initial(ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem[str]]":
    """A list of parameters extended by each missing one, or a file."""
    before, comma, name = incomplete.rpartition(",")
    named = [part.partition("=")[0] for part in before.split(",")]
    lacking = [one for one in parameters(ctx, param, name) if one.value not in named]
    items = [CompletionItem(f"{before}{comma}{one.value}=") for one in lacking]
    return items or [CompletionItem(incomplete, type="file")]


@_proposed
def terms(_ctx: click.Context, incomplete: str) -> Iterator[str]:
    """A list of terms extended by each missing one."""
    from navirl_cli.irl.terms import TERMS

    before, comma, _ = incomplete.rpartition(",")
    yield from (f"{before}{comma}{name}" for name in TERMS if name not in before.split(","))


@_proposed
def persons(ctx: click.Context, _incomplete: str) -> Iterable[str]:
    """The people whose rewards the reward files on the command line hold."""
    from navirl_cli.artefacts.persons import names_of_persons
    from navirl_cli.artefacts.rewards import reward_content

    files = ctx.params.get("rewards") or ctx.params.get("reward") or ctx.params.get("prior_file")
    for path in files if isinstance(files, tuple) else (files,):
        yield from names_of_persons(reward_content(path))


@_proposed
def metrics(_ctx: click.Context, incomplete: str) -> Iterator[str]:
    """A list of metrics extended by each missing one, or all."""
    from navirl_cli.evaluation.metrics import BY_NAME

    before, comma, _ = incomplete.rpartition(",")
    yield from (f"{before}{comma}{name}" for name in BY_NAME if name not in before.split(","))
    if not before:
        yield "all"


@_proposed
def topics(ctx: click.Context, _incomplete: str) -> Iterator[str]:
    """ROLE=/topic for all topics of the logs on the command line that can have the role; ROLE= if no log is given."""
    from navirl_cli.logs.messages.reader import scan
    from navirl_cli.logs.roles.topics import ROLES, topics_of
    from navirl_cli.logs.sources import sources_of

    logs = _files(ctx, "logs")
    found = topics_of(scan(path) for source in (sources_of(logs) if logs else ()) for path in source.files)
    for role in ROLES:
        types = {one.name for one in role.message_types}
        yield from [f"{role.name}={one.name}" for one in found if one.type_name in types] or [f"{role.name}="]


class WholeWords(BashComplete):
    """Completion for bash, which splits words at equals signs and reads blanks and quotation marks in proposals."""

    name: ClassVar[str] = "bash"
    #: The text before the part of the word that bash replaces.
    kept: str = ""

    def get_completion_args(self) -> tuple[list[str], str]:
        """The words before the cursor and the word at it, with the words that bash split joined again."""
        before, incomplete = super().get_completion_args()
        words: list[str] = []
        for part in (*before, incomplete):
            self.kept = words.pop() if words and ("=" in {part, words[-1][-1:]} or not words[-1]) else ""
            if part == "=" and self.kept.startswith("-"):  # --option=value
                words += [self.kept, ""]
                self.kept = ""
            else:
                words.append(f"{self.kept}{part}")
        if incomplete == "=":  # bash inserts the proposal after it
            self.kept = words[-1]
        return words[:-1], words[-1]

    def format_completion(self, item: "CompletionItem[Any]") -> str:
        """The part of the word that bash replaces, escaped outside of quotation marks."""
        value = str(item.value).removeprefix(self.kept)
        words = os.environ["COMP_WORDS"].split("\n")[int(os.environ["COMP_CWORD"]) :]
        quoted = bool(words) and words[0].startswith(("'", '"'))
        word = value if quoted else _SPECIAL.sub(_ESCAPED, value)
        return f"{item.type},{word}".replace("\\", "\\\\")  # click's script reads it with backslashes
