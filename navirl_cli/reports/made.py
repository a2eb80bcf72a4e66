"""How a reward was made: from which demonstrations and with which settings, and the command lines for it."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph

#: Defaults of a fit, as its file names them.
_FIT = {"method": "newton", "l2": 1e-3, "learnt_from": "all", "terms": ["length", "deviation", "personal-space"]}
#: Options of a fit by the names in its file.
_OPTIONS = {"method": "--method", "l2": "--l2", "learnt_from": "--steps", "terms": "--terms"}


@dataclass(frozen=True)
class Made:
    """The files of a report and how it was asked for."""

    #: Names of the files of demonstrations and of the reward.
    demos: str
    reward: str
    #: Names of the logs, and the settings of extraction that are no defaults, by name.
    logs: tuple[str, ...]
    settings: Mapping[str, Any]
    samples: int
    seed: int


def made_blocks(demonstrations: Sequence[Demonstration], content: Mapping[str, Any], made: Made) -> list[Block]:
    """The section of a report on how everything was made.

    Args:
        demonstrations: All of the file.
        content: Of the reward file.
        made: The files.
    """
    used = content["demonstrations"]
    taught = [one for one in demonstrations if one.id in set(used)]
    start = ", ".join(f"{name} {value:g}" for name, value in content["initial"].items())
    how = f"Steps: {content['learnt_from']} ({content['steps']}); method {content['method']}"
    lines = [
        f"Learnt from {len(used)} of {len(demonstrations)} demonstrations: {', '.join(used)}",
        f"{how}; regulariser {content['l2']:g}; {'with' if content['prior'] else 'without'} a prior; start: {start}",
    ]
    if made.settings:
        changed = ", ".join(f"{name} {value}" for name, value in made.settings.items())
        lines.append(f"Settings of the extraction other than the defaults: {changed}")
    commands = _commands(demonstrations, taught, content, made)
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


def _commands(
    demonstrations: Sequence[Demonstration],
    taught: Sequence[Demonstration],
    content: Mapping[str, Any],
    made: Made,
) -> list[str]:
    """Command lines; that of the fit only where its demonstrations are all of some conditions and of one cycle."""
    extract = shlex.join(["navirl", "extract", *made.logs, "-o", made.demos])
    report = ["navirl", "report", made.demos, made.reward, "--samples", str(made.samples), "--seed", str(made.seed)]
    words = selection_words(demonstrations, taught)
    if words is None or content["prior"]:
        return [extract, shlex.join([*report, "-o", "report.html"])]
    changed = [
        word
        for name, option in _OPTIONS.items()
        if content.get(name, _FIT[name]) != _FIT[name]
        for word in (option, ",".join(content[name]) if name == "terms" else f"{content[name]}")
    ]
    fit = shlex.join(["navirl", "fit", made.demos, *words, *changed, "-o", made.reward])
    return [extract, fit, shlex.join([*report, "-o", "report.html"])]


def selection_words(demonstrations: Sequence[Demonstration], taught: Sequence[Demonstration]) -> list[str] | None:
    """Options that choose exactly some of the demonstrations by condition and cycle; None where there are none."""
    conditions = list(dict.fromkeys(one.condition for one in taught))
    for cycles in ([], list(dict.fromkeys(one.cycle for one in taught))):
        for chosen in ([], conditions):
            fitting = [
                one
                for one in demonstrations
                if not one.truncated and (not chosen or one.condition in chosen) and (not cycles or one.cycle in cycles)
            ]
            if [one.id for one in fitting] == [one.id for one in taught] and len(cycles) < 2 and None not in cycles:
                named = [word for one in chosen for word in ("--condition", one.value)]
                return [*named, *(["--cycle", str(cycles[0])] if cycles else [])]
    return None
