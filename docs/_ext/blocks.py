"""The code blocks of a page, and how they run: in order, in one folder, with the sample logs linked in.

Commands are those of navirl, with patterns and ``> file``.

A comment above a block that cannot run states the reason: ``<!-- block: skip REASON -->``.
"""

import contextlib
import glob
import io
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from click.testing import CliRunner

from navirl_cli.cli import cli

ROOT = Path(__file__).parent.parent.parent
_BLOCK = re.compile(
    r"(?:<!-- block: (?P<mark>\w+) ?(?P<reason>[^\n]*?) ?-->\n+)?"
    r"^```(?P<language>\w+)[^\n]*\n(?P<code>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
SHELL, PYTHON = "sh", "python"


@dataclass(frozen=True)
class Block:
    """One block of code."""

    language: str
    code: str
    #: Why it does not run; empty where it runs.
    skipped: str


def blocks_of(page: Path) -> list[Block]:
    """The blocks of a page that are code, in order."""
    found = _BLOCK.finditer(page.read_text(encoding="utf-8"))
    return [
        Block(one["language"], one["code"], one["reason"] if one["mark"] == "skip" else "")
        for one in found
        if one["language"] in {SHELL, PYTHON}
    ]


def lines_of(block: Block) -> Iterator[str]:
    """The commands of a shell block; a backslash joins lines."""
    for line in block.code.replace("\\\n", " ").splitlines():
        if line.strip() and not line.startswith("#"):
            yield line.partition("  #")[0].strip()


def run_page(page: Path, folder: Path) -> str:
    """Run a page's blocks in a folder, which must be the working folder.

    Args:
        page: A Markdown file.
        folder: Where it runs; gets a link to the sample logs.

    Returns:
        What the shell blocks print.

    Raises:
        AssertionError: A command fails, or is none that runs here.
    """
    logs = folder / "sample_logs"
    if not logs.exists():
        logs.symlink_to(ROOT / "sample_logs")
    known: dict[str, Any] = {"__name__": "page"}
    printed = []
    for block in blocks_of(page):
        if block.skipped:
            continue
        if block.language == PYTHON:
            with contextlib.redirect_stdout(io.StringIO()) as output:
                exec(compile(block.code, str(page), "exec"), known)  # noqa: S102 the project's own pages
            printed.append(output.getvalue())
        else:
            printed += [_run(line, page) for line in lines_of(block)]
    return "\n".join(printed)


def _run(line: str, page: Path) -> str:
    """Run a command of navirl in this process, which saves its start."""
    line, _, target = line.partition(" > ")
    words = [word for one in shlex.split(line) for word in (sorted(glob.glob(one)) or [one])]  # noqa: PTH207 relative
    assert words[0] == "navirl", f"{page.name}: {line!r} does not run here: mark its block as skipped, with the reason"
    result = CliRunner().invoke(cli, words[1:], prog_name="navirl", catch_exceptions=False)
    assert result.exit_code == 0, f"{page.name}: {line}: {result.output}"
    if target:
        Path(target).write_text(result.stdout, encoding="utf-8")
    return result.stdout
