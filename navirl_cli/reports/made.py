"""How a reward was made: from which demonstrations and with which settings, and the command lines for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from navirl_cli.artefacts.steps import Step, selection_words
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph
from navirl_cli.errors import counted
from navirl_cli.files import Input

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
    #: Names of the demonstrations for command lines, and the commands that made them.
    names: Sequence[str]
    steps: Sequence[Step]

    @property
    def files(self) -> list[Input]:
        """All files with their hashes."""
        return [*self.inputs, *self.demos, self.reward]


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
        changed = ", ".join(
            f"{name} {'not the same in all files' if value is None else value}" for name, value in settings.items()
        )
        lines.append(f"Settings of the extraction other than the defaults: {changed}")
    fits = _fit_lines(taught, content, made)
    asked = Step("report", (*made.names, made.reward.file), made.options, "report.html")
    commands = [one.line for one in (*made.steps, *fits, asked)]
    complete = fits and {one.output for one in made.steps} >= set(made.names)
    return [
        Heading("How it was made"),
        Bullets(tuple(f"{line}." for line in lines)),
        Paragraph("The same by command lines" + (":" if complete else ", as far as the files hold them:")),
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


def _fit_lines(taught: Sequence[Demonstration], content: Mapping[str, Any], made: Made) -> list[Step]:
    """The fit; none with a prior of a file without options, which does not name it."""
    options = content.get("options")
    if options is None and (not taught or content["prior"]):
        return []
    words = _fit_words(taught, content, made) if options is None else options
    return [Step("fit", tuple(made.names), tuple(words), made.reward.file)]


def _fit_words(taught: Sequence[Demonstration], content: Mapping[str, Any], made: Made) -> list[str]:
    """Options of a fit whose file does not hold them, as far as they show in the result."""
    changed = [
        word
        for name, option in _OPTIONS.items()
        if content.get(name, _FIT[name]) != _FIT[name]
        for word in (option, ",".join(content[name]) if name == "terms" else f"{content[name]}")
    ]
    return [*selection_words(made.everyone, taught), *changed]
