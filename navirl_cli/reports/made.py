"""How a reward was made: from which demonstrations and with which settings, and the command lines for it."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from navirl_cli.artefacts.steps import extract_words, selection_words
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph
from navirl_cli.errors import counted
from navirl_cli.files import MANIFEST, Input

#: Defaults of a fit, as its file names them.
_FIT = {"method": "newton", "l2": 1e-3, "learnt_from": "all", "terms": ["length", "deviation", "personal-space"]}
#: Options of a fit by the names in its file, for files that do not hold its options.
_OPTIONS = {"method": "--method", "l2": "--l2", "learnt_from": "--steps", "terms": "--terms"}


@dataclass(frozen=True, eq=False)
class Made:
    """The files of a report and how it was asked for."""

    #: Of the demonstrations and of the reward.
    demos: tuple[Input, ...]
    reward: Input
    #: Files that the demonstrations were extracted from.
    inputs: Sequence[Input]
    #: Settings of the extraction, and those of one without options.
    settings: Mapping[str, Any]
    usual: Mapping[str, Any]
    #: Options of the report.
    options: tuple[str, ...]
    seed: int
    #: All demonstrations of the file.
    everyone: Sequence[Demonstration]

    @property
    def files(self) -> list[Input]:
        """All files with their hashes."""
        return [*self.inputs, *self.demos, self.reward]

    @property
    def logs(self) -> list[str]:
        """Names of the logs among the inputs, which also hold a map and a table of labels."""
        others = {self.settings.get("map"), self.settings.get("trials")}
        return [one.file for one in self.inputs if one.file not in others]

    @property
    def names(self) -> list[str]:
        """Of the demonstrations for command lines: a folder has a / at its end."""
        return [one.file.removesuffix(MANIFEST) for one in self.demos]


def made_blocks(content: Mapping[str, Any], made: Made) -> list[Block]:
    """The section of a report on how everything was made.

    Args:
        content: Of the reward file.
        made: The files.
    """
    used, demonstrations = content["demonstrations"], made.everyone
    taught = [one for one in demonstrations if one.id in set(used)]
    start = ", ".join(f"{name} {value:g}" for name, value in content["initial"].items())
    how = f"Steps: {content['learnt_from']} ({content['steps']}); method {content['method']}"
    lines = [
        f"Learnt from {len(used)} of {counted(len(demonstrations), 'demonstration')}: {', '.join(used)}",
        f"{how}; regulariser {content['l2']:g}; {'with' if content['prior'] else 'without'} a prior; start: {start}",
    ]
    settings = changed_settings(made.settings, made.usual)
    if settings:
        changed = ", ".join(f"{name} {value}" for name, value in settings.items())
        lines.append(f"Settings of the extraction other than the defaults: {changed}")
    commands = _commands(taught, content, made)
    return [
        Heading("How it was made"),
        Bullets(tuple(f"{line}." for line in lines)),
        Paragraph("The same by command lines" + (":" if len(commands) == 3 else ", as far as the files hold them:")),
        Bullets(tuple(f"`{command}`" for command in commands)),
    ]


def changed_settings(settings: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Settings that differ from the defaults or have none, flat, without those that are not set."""
    found: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            own = defaults.get(name)
            found |= changed_settings(value, own if isinstance(own, Mapping) else {})
        elif value != defaults[name] if name in defaults else value:
            found[name] = value
    return found


def _commands(taught: Sequence[Demonstration], content: Mapping[str, Any], made: Made) -> list[str]:
    """Command lines; none for a fit with a prior of a file without options, which does not name it."""
    demos, reward = made.names, made.reward.file
    lines = [["report", *demos, reward, *made.options, "-o", "report.html"]]
    options = content.get("options")
    if options is not None or (taught and not content["prior"]):
        words = _fit_words(taught, content, made) if options is None else options
        lines.insert(0, ["fit", *demos, *words, "-o", reward])
    if len(demos) == 1:  # which log is in which of several files is not known
        lines.insert(0, ["extract", *made.logs, *extract_words(made.settings, made.usual), "-o", *demos])
    return [shlex.join(["navirl", *line]) for line in lines]


def _fit_words(taught: Sequence[Demonstration], content: Mapping[str, Any], made: Made) -> list[str]:
    """Options of a fit whose file does not hold them, as far as they show in the result."""
    changed = [
        word
        for name, option in _OPTIONS.items()
        if content.get(name, _FIT[name]) != _FIT[name]
        for word in (option, ",".join(content[name]) if name == "terms" else f"{content[name]}")
    ]
    return [*selection_words(made.everyone, taught), *changed]
