"""How a reward was made: from which demonstrations and with which settings, and the command lines for it."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import Subset
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph
from navirl_cli.errors import counted

#: Defaults of a fit, as its file names them.
_FIT = {"method": "newton", "l2": 1e-3, "learnt_from": "all", "terms": ["length", "deviation", "personal-space"]}
#: Options of a fit by the names in its file.
_OPTIONS = {"method": "--method", "l2": "--l2", "learnt_from": "--steps", "terms": "--terms"}


@dataclass(frozen=True, eq=False)
class Made:
    """The files of a report and how it was asked for."""

    #: Names of the files and folders of demonstrations, and of the reward.
    demos: tuple[str, ...]
    reward: str
    #: Names of the logs, and the settings of extraction that are no defaults, by name.
    logs: tuple[str, ...]
    settings: Mapping[str, Any]
    #: Options of the report.
    options: tuple[str, ...]
    seed: int
    #: All demonstrations of the file.
    everyone: Sequence[Demonstration]


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
    if made.settings:
        changed = ", ".join(f"{name} {value}" for name, value in made.settings.items())
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
        elif value not in (defaults.get(name), None, [], False) and not (name in _USUAL and value == _USUAL[name]):
            found[name] = value
    return found


#: Settings that extract adds to its own, with their usual values.
_USUAL = {"time": "header", "force_scale": 1.0, "wrench": True}


def _commands(taught: Sequence[Demonstration], content: Mapping[str, Any], made: Made) -> list[str]:
    """Command lines; none for a fit with a prior, whose file is not known."""
    # which log is in which of several files is not known
    extract = [shlex.join(["navirl", "extract", *made.logs, "-o", *made.demos])] if len(made.demos) == 1 else []
    report = shlex.join(["navirl", "report", *made.demos, made.reward, *made.options, "-o", "report.html"])
    if content["prior"] or not taught:
        return [*extract, report]
    changed = [
        word
        for name, option in _OPTIONS.items()
        if content.get(name, _FIT[name]) != _FIT[name]
        for word in (option, ",".join(content[name]) if name == "terms" else f"{content[name]}")
    ]
    chosen = selection_words(made.everyone, taught)
    return [*extract, shlex.join(["navirl", "fit", *made.demos, *chosen, *changed, "-o", made.reward]), report]


def selection_words(everyone: Sequence[Demonstration], taught: Sequence[Demonstration]) -> list[str]:
    """The shortest options that choose exactly some demonstrations: by condition, cycle and set, or one by one."""
    whole = [one for one in everyone if not one.truncated or one in taught]
    conditions = tuple(dict.fromkeys(one.condition.value for one in taught))
    cycles = tuple(dict.fromkeys(one.cycle for one in taught if one.cycle is not None))
    sets = tuple(dict.fromkeys(one.set or "main task" for one in taught))
    for chosen in (
        Subset(),
        Subset(condition=conditions),
        Subset(cycle=cycles),
        Subset(condition=conditions, cycle=cycles),
        Subset(condition=conditions, cycle=cycles, set=sets),
    ):
        if [one.id for one in chosen.of(whole)] == [one.id for one in taught]:
            return subset_words(chosen)
    return subset_words(Subset(trial=tuple(one.id for one in taught)))


def subset_words(subset: Subset) -> list[str]:
    """A choice of demonstrations as options of a command."""
    return [word for field, names in vars(subset).items() for name in names for word in (f"--{field}", str(name))]
