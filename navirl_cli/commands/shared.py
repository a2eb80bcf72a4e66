"""Shared parts of several commands: options, tables, progress bars, and the end of a run."""

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import click

from navirl_cli.artefacts.joined import read_joined
from navirl_cli.commands import completion
from navirl_cli.commands.types import Choice, Count, FilePath, LogPath, OutputPath, Point, RoleTopic
from navirl_cli.commands.usage import Function, as_options, is_quiet, is_verbose, section
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.trials import Split
from navirl_cli.documents.inline import printable
from navirl_cli.errors import DemonstrationError
from navirl_cli.files import check_writable
from navirl_cli.remote import Remote

#: As :data:`navirl_cli.evaluation.drawn.MOST`, which is not imported before paths are sampled.
MOST_SAMPLES = 100_000

#: Between lines of progress without a terminal, s.
EVERY_S = 2.0

force_option = click.option("--force", is_flag=True, help="Replace existing files.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
seed_option = click.option(
    "--seed", default=0, show_default=True, type=Count(min=0), help="Seed of all random numbers."
)
#: Files of demonstrations, and folders with a manifest.
demos_argument = click.argument("demos", metavar="DEMOS...", nargs=-1, required=True, type=FilePath)
person_option = click.option(
    "--person",
    metavar="NAME",
    shell_complete=completion.persons,
    help="Take this person's own reward, of a reward fitted with --pool persons.  [default: the typical person's]",
)
#: The same beside positions of people, which --person names there.
person_name_option = click.option(
    "--person-name",
    metavar="NAME",
    shell_complete=completion.persons,
    help="Drive by this person's own reward, of a reward fitted with --pool persons.  [default: the typical person's]",
)
logs_argument = click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=LogPath())
topic_option = click.option(
    "--topic",
    "topics",
    metavar="ROLE=/TOPIC",
    multiple=True,
    type=RoleTopic(),
    shell_complete=completion.topics,
    help="Topic of a role, if several topics are possible, e.g. wrench=/ft; repeatable.",
)
namespace_option = click.option(
    "--namespace", metavar="/ROBOT", help="The robot's namespace, in a log of several robots, e.g. /robot1."
)
frame_option = click.option("--frame", help="Frame of all results, instead of the map's frame.")
#: Where independent pieces of the work are done.
workers_options = section(
    "Processes",
    click.option(
        "--workers",
        type=Count(1, 4096),
        help="Number of processes for independent parts.  [default: one for each core]",
    ),
    click.option("--cluster", metavar="ADDRESS", help="Running Dask scheduler to give them to, e.g. tcp://host:8786."),
)
split_option = click.option(
    "--split",
    type=Choice([split.value for split in Split]),
    default=Split.GOAL.value,
    show_default=True,
    help="Start a trial at every new goal or after every stop, or take the log as one trial.",
)
goal_option = click.option("--goal", type=Point(), help="Goal in the map frame, m, instead of the goals in the log.")


def samples_option(default: int = 1000) -> Callable[[Function], Function]:
    """``--samples`` with its default."""
    return click.option(
        "--samples",
        default=default,
        show_default=True,
        type=Count(2, MOST_SAMPLES),
        help="Paths sampled from each learnt policy in each scene.",
    )


def topics_by_role(topics: Sequence[tuple[str, str]]) -> dict[str, tuple[str, ...]]:
    """The topics by role from ``--topic``."""
    chosen: dict[str, tuple[str, ...]] = {}
    for role, topic in topics:
        chosen[role] = (*chosen.get(role, ()), topic)
    return chosen


def demonstrations_in(*paths: Path) -> list[Demonstration]:
    """The demonstrations of files and folders; an error if they hold none.

    Raises:
        DemonstrationError: They hold none, or two have the same id.
        ArtefactError: One is not a demonstrations file.
        ArgumentError: One is named twice.
    """
    demonstrations = read_joined(paths)
    if not demonstrations:
        raise DemonstrationError(f"{', '.join(map(str, paths))}: holds no demonstrations")
    return demonstrations


def output_option(what: str, *endings: str, required: bool = True) -> Callable[[Function], Function]:
    """``-o/--output`` with its help, and the endings that its name may have."""
    kind = OutputPath(endings) if endings else FilePath
    return click.option("-o", "--output", type=kind, required=required, help=what)


def check_output(output: Path, inputs: Iterable[Path], *, force: bool) -> None:
    """Refuse, before any work, an output file that cannot be written or that is an input.

    Raises:
        UsageError: It is one of the inputs, as in :func:`refuse_inputs`.
        ArtefactError: It cannot be written.
    """
    refuse_inputs([output], inputs)
    check_writable(output, force=force)


def refuse_inputs(outputs: Sequence[Path], inputs: Iterable[Path]) -> None:
    """Refuse outputs that are inputs, by whatever name, or recordings in a folder or pattern of the inputs.

    Raises:
        UsageError: One is.
    """
    for path in inputs:
        if isinstance(path, Remote):
            continue
        own = [path, *_files_of(path)]
        for output in outputs:
            if same := next((one for one in own if _are_same(output, one)), None):
                raise click.UsageError(
                    f"{output}: expected another file than the input {same}; choose another --output."
                )


def _are_same(output: Path, given: Path) -> bool:
    """Whether two names are one file, also through links."""
    if output.resolve() == given.resolve():
        return True
    try:
        return output.samefile(given)
    except OSError:  # one of them does not exist, or is no possible name
        return False


def _files_of(path: Path) -> list[Path]:
    """The files of the recordings that a folder or a pattern stands for."""
    if path.is_file():
        return []
    from navirl_cli.errors import LogError
    from navirl_cli.logs.sources import sources_of

    try:
        files = [file for source in sources_of([path], refused=[]) for file in source.files]
    except LogError:  # whoever reads the input reports it
        return []
    return [*files, *{file.parent / "metadata.yaml" for file in files}]


def echo_json(document: Any) -> None:
    """JSON on stdout."""
    click.echo(json.dumps(document, indent=2, allow_nan=False))


def say(line: str) -> None:
    """A remark on stderr, with options where it names arguments; none with --quiet."""
    if not is_quiet():
        complain(line)


def complain(line: str) -> None:
    """A line on stderr also with --quiet: what is lost."""
    click.echo(f"navirl: {printable(' '.join(as_options(line).split()))}", err=True)


def echo(text: str) -> None:
    """A result on stdout, with options where it names arguments."""
    click.echo(printable(as_options(text)))


def merged(lines: Iterable[str]) -> list[str]:
    """Lines ``name: text``, with the names of equal texts joined at the first of them."""
    names: dict[str, list[str]] = {}
    for line in lines:
        name, _, text = line.partition(": ")
        names.setdefault(text, []).append(name)
    return [f"{_listed(list(dict.fromkeys(own)))}: {text}" for text, own in names.items()]


def _listed(names: Sequence[str]) -> str:
    """Names, at most one line of them."""
    return ", ".join(names) if len(names) < 5 else f"{names[0]} and {len(names) - 1} others"


def finish(lost: Sequence[str]) -> None:
    """List lost or skipped data and exit with 3; return if there is none."""
    for line in lost:
        complain(line)
    if lost:
        click.get_current_context().exit(3)


@contextmanager
def bytes_bar(label: str) -> Iterator[Callable[..., None]]:
    """A progress bar over the bytes of logs in sequence, if stderr is a terminal.

    Args:
        label: The present work.

    Yields:
        A function that takes the bytes done, the total bytes and, if it likes, a short text.
    """
    if is_quiet() or not sys.stderr.isatty():
        yield lambda _done, _total, _word="": None
        return
    with _finished(
        click.progressbar(length=1, label=label, file=sys.stderr, width=30, item_show_func=lambda word: word or None)
    ) as bar:

        def update(done: int, total: int, word: str = "") -> None:
            if done < bar.pos:
                bar.pos = 0
            bar.length = max(total, 1)
            bar.update(done - bar.pos, word)

        yield update


@contextmanager
def progress_bar(
    label: str, length: int | None = None, *, line_every: int | None = None
) -> Iterator[Callable[[int, str], None]]:
    """A progress bar, if stderr is a terminal.

    Args:
        label: The present work.
        length: Number of steps, or None if it is not known.
        line_every: After so many steps a line is printed elsewhere, for work of minutes; none without it.

    Yields:
        A function that takes the number of steps done and a short text on the present one.
    """
    if is_quiet() or not sys.stderr.isatty():
        yield _by_lines(label, length, line_every, EVERY_S if is_verbose() else inf)
        return
    steps = None if length is not None else iter(int, 1)
    new = click.progressbar(
        steps, length=length, label=label, file=sys.stderr, item_show_func=lambda word: str(word or "")
    )
    with _finished(new) as bar:

        def update(done: int, word: str) -> None:
            bar.update(max(0, done - bar.pos), word)

        yield update


def _by_lines(label: str, length: int | None, line_every: int | None, every_s: float) -> Callable[[int, str], None]:
    """Progress as lines after so many steps, and after so much time, with an estimate of the time left from two on."""
    start = monotonic()
    last = -inf

    def update(done: int, word: str) -> None:
        nonlocal last
        now = monotonic()
        timely = every_s < inf and (now - last >= every_s or done == length)
        if timely or (line_every and done % line_every == 0):
            last = now
            left = "" if length is None or not 1 < done < length else _left((now - start) / done * (length - done))
            parts = ["" if length is None else f" of {length}", f": {word}" if word else "", left]
            say(f"{label} {done}{''.join(parts)}")

    return update


def _left(left_s: float) -> str:
    """An estimated time in words; empty for a few seconds."""
    if left_s < 10:
        return ""
    return f"; about {left_s:.0f} s left" if left_s < 90 else f"; about {left_s / 60:.0f} min left"


@contextmanager
def _finished(bar: Any) -> Iterator[Any]:
    """A bar that ends its line and restores the cursor, also after an interrupt during its first drawing."""
    try:
        yield bar.__enter__()
    finally:
        bar.__exit__(None, None, None)
