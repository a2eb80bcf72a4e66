"""Pages that are made from the code before each build: commands, message types, formats, metrics, gallery."""

import contextlib
import json
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click
from blocks import run_page
from sphinx.application import Sphinx
from sphinx.util import logging

from navirl_cli.artefacts.store import schema_path
from navirl_cli.cli import COMMANDS, cli
from navirl_cli.documents.tables import Column, Format, Table, written
from navirl_cli.logs.roles.topics import ROLES
from navirl_cli.reports.evaluation import metrics_table
from navirl_cli.reports.models import terms_table

HERE = Path(__file__).parent.parent
GENERATED = HERE / "_generated"
KINDS = ("demonstrations", "manifest", "reward", "metrics", "plan", "study")


class Markdown(click.HelpFormatter):
    """Help as Markdown: sections become headings, options a list of definitions."""

    def __init__(self, level: int) -> None:
        super().__init__()
        self.level = level

    def emit(self, text: str) -> None:
        """Markdown as it is."""
        self.buffer.append(text)

    def write(self, string: str) -> None:
        """What a command writes without a layout is an example to copy."""
        if string.strip():
            self.emit(f"```sh\n{string.strip()}\n```\n\n")

    def write_paragraph(self) -> None:
        """Every part ends with an empty line already."""

    def write_usage(self, prog: str, args: str = "", prefix: str | None = None) -> None:  # noqa: ARG002
        """The line of usage."""
        self.emit(f"```text\n{prog} {args}\n```\n\n")

    def write_heading(self, heading: str) -> None:
        """A section's heading."""
        self.emit(f"{'#' * self.level} {heading}\n\n")

    def indent(self) -> None:
        """Markdown knows no indent."""

    def dedent(self) -> None:
        """Markdown knows no indent."""

    def write_text(self, text: str) -> None:
        """Paragraphs; what click must not wrap is code."""
        for paragraph in text.split("\n\n"):
            if paragraph.startswith("\b"):
                self.emit(f"```text\n{paragraph.removeprefix(chr(8)).strip()}\n```\n\n")
            else:
                self.emit(f"{escaped(' '.join(paragraph.split()))}\n\n")

    def write_dl(self, rows: Any, col_max: int = 30, col_spacing: int = 2) -> None:  # noqa: ARG002
        """Names with what they mean."""
        for name, text in rows:
            self.emit(f"`{name}`\n: {escaped(' '.join(text.split())) or '-'}\n\n")


def escaped(text: str) -> str:
    """Text that Markdown must not read as markup, with options as code."""
    for mark in "\\*_<>[]$|#":
        text = text.replace(mark, "\\" + mark)
    return re.sub(r"(?<![\w-])--[a-z][a-z-]*", lambda option: f"`{option[0]}`", text)


def help_of(command: click.Command, path: str, level: int = 2) -> str:
    """A command's help as Markdown."""
    formatter = Markdown(level)
    command.format_help(click.Context(command, info_name=path), formatter)
    return formatter.getvalue()


def command_pages() -> Iterator[tuple[str, str]]:
    """One page for each command, and one that lists them."""
    rows = []
    top = click.Context(cli, info_name="navirl")
    for name, summary in COMMANDS.items():
        command = cli.get_command(top, name)
        assert command is not None
        text = f"# navirl {name}\n\n{help_of(command, f'navirl {name}')}"
        if isinstance(command, click.Group):
            context = click.Context(command, info_name=f"navirl {name}", parent=top)
            for own in command.list_commands(context):
                part = command.get_command(context, own)
                assert part is not None
                text += f"\n## navirl {name} {own}\n\n{help_of(part, f'navirl {name} {own}', level=3)}"
        yield f"commands/{name}.md", text
        rows.append(f"[navirl {name}]({name}.md)\n: {escaped(summary)}\n")
    listed = "\n".join(rows)
    pages = "\n".join(COMMANDS)
    yield "commands/index.md", f"# Commands\n\n{listed}\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"


def message_types() -> Iterator[tuple[str, str]]:
    """The message types of each role, with the fields that are read."""
    parts = []
    for role in ROLES:
        rows = [
            (f"`{one.name}`", ", ".join(f"`{path}`" for path in dict.fromkeys(one.fields.values())))
            for one in (*role.message_types, *role.companions.values())
        ]
        needed = "Needed by `extract`." if role.needed else "Optional."
        table = written(Table((Column("message type"), Column("fields that are read")), tuple(rows)), Format.MARKDOWN)
        rule = f" Where several topics fit: {escaped(role.rule)}." if role.rule else ""
        parts.append(f"### {role.name}\n\n{needed}{rule}\n\n{unescaped(table)}\n")
    yield "message-types.md", "\n".join(parts)


def unescaped(table: str) -> str:
    """A table whose cells are Markdown already."""
    return table.replace("\\`", "`").replace("\\_", "_").replace("\\[", "[").replace("\\]", "]").replace("\\|", "|")


def metrics() -> Iterator[tuple[str, str]]:
    """All metrics."""
    yield "metrics.md", written(metrics_table(), Format.MARKDOWN) + "\n"


def terms() -> Iterator[tuple[str, str]]:
    """All terms of the package, with their parameters."""
    yield "terms.md", unescaped(written(terms_table(), Format.MARKDOWN)) + "\n"


def formats() -> Iterator[tuple[str, str]]:
    """The fields of every kind of file, from its schema."""
    for kind in KINDS:
        schema = json.loads(schema_path(kind).read_text(encoding="utf-8"))
        lines = [escaped(schema.get("description", "")), "", "| field | type | meaning |", "| --- | --- | --- |"]
        lines += [
            f"| {'&emsp;' * depth}`{name}`{'' if required else ' (optional)'} | {kind_} | {escaped(meaning)} |"
            for depth, name, required, kind_, meaning in fields_of(schema, schema, 0)
        ]
        yield f"formats/{kind}.md", "\n".join(lines) + "\n"


def fields_of(
    part: Mapping[str, Any], schema: Mapping[str, Any], depth: int
) -> Iterator[tuple[int, str, bool, str, str]]:
    """Fields of an object of a schema, those of the objects in it below them.

    Yields:
        Depth, name, whether it is required, type, meaning.
    """
    for name, value in part.get("properties", {}).items():
        inner = resolved(value, schema)
        described = value.get("description") or inner.get("description", "")
        yield depth, name, name in part.get("required", ()), type_of(value, schema), described
        yield from fields_of(object_in(inner, schema), schema, depth + 1)


def resolved(value: Mapping[str, Any], schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """A part of a schema, where a reference leads."""
    if "$ref" not in value:
        return value
    found = schema
    for key in value["$ref"].removeprefix("#/").split("/"):
        found = found[key]
    return found


def object_in(value: Mapping[str, Any], schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """The object that a value is, or that its entries are; nothing where it is none."""
    value = resolved(value, schema)
    for other in (*value.get("oneOf", ()), *value.get("anyOf", ())):
        if found := object_in(other, schema):
            return found
    for key in ("items", "additionalProperties"):
        if isinstance(value.get(key), Mapping):
            return object_in(value[key], schema)
    return value if "properties" in value else {}


def type_of(value: Mapping[str, Any], schema: Mapping[str, Any]) -> str:
    """What a value is, in words."""
    value = resolved(value, schema)
    if "const" in value:
        return f"`{json.dumps(value['const'])}`"
    if "enum" in value:
        return ", ".join(f"`{json.dumps(one)}`" for one in value["enum"])
    several = [*value.get("oneOf", ()), *value.get("anyOf", ())]
    if several:
        return " or ".join(dict.fromkeys(type_of(one, schema) for one in several))
    kinds = value.get("type", "any")
    kinds = [kinds] if isinstance(kinds, str) else kinds
    words = []
    for kind in kinds:
        if kind == "array" and isinstance(value.get("items"), Mapping):
            words.append(f"list of {type_of(value['items'], schema)}")
        elif kind == "object" and isinstance(value.get("additionalProperties"), Mapping):
            words.append(f"{type_of(value['additionalProperties'], schema)} by name")
        else:
            words.append("list" if kind == "array" else kind)
    return " or ".join(words)


def write_all(_app: Sphinx) -> None:
    """Write the pages that changed, and draw the gallery."""
    for make in (command_pages, message_types, metrics, terms, formats):
        for name, text in make():
            path = GENERATED / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists() or path.read_text(encoding="utf-8") != text:
                path.write_text(text, encoding="utf-8")
    gallery = GENERATED / "gallery"
    shutil.rmtree(gallery, ignore_errors=True)
    gallery.mkdir()
    logging.getLogger(__name__).info("drawing the gallery ...")
    with contextlib.chdir(gallery):
        run_page(HERE / "gallery.md", gallery)


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the pages before sources are looked for."""
    app.connect("config-inited", lambda app, _config: write_all(app))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
