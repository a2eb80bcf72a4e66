"""The command lines by which a demonstrations file was made."""

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from navirl_cli.artefacts.demonstrations import settings_document
from navirl_cli.artefacts.manifest import manifest_path
from navirl_cli.artefacts.options import option_words
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import Subset
from navirl_cli.files import MANIFEST

#: Options of an extraction by the names of its settings.
SETTINGS = {
    "split": "split",
    "resolution_m": "resolution",
    "robot_radius_m": "robot_radius",
    "rasterizer": "rasterizer",
    "begins_n": "contact_force",
    "cutoff_hz": "wrench_filter",
    "people_m": "person",
    "goal_m": "goal",
    **{
        name: name
        for name in ("participant", "condition", "cycle", "set", "gain", "keep_truncated", "namespace", "time", "frame")
    },
    **{name: name for name in ("wrench_frame", "force_scale", "map", "trials", "strict", "join")},
    "topics": "topic",
}


def _point(xy_m: Sequence[float]) -> str:
    """A point as an option takes it."""
    return ",".join(f"{axis:.15g}" for axis in xy_m)


_FORMS: Mapping[str, Callable[[Any], Any]] = {
    "person": lambda people: [_point(one) for one in people],
    "goal": _point,
    "topic": lambda topics: [f"{role}={name}" for role, names in topics.items() for name in names],
}


@dataclass(frozen=True)
class Step:
    """A command that made a demonstrations file or folder."""

    command: str
    #: Names of what it read.
    files: tuple[str, ...]
    #: Words of the command line.
    options: tuple[str, ...]
    #: Name of what it wrote.
    output: str

    @property
    def line(self) -> str:
        """The command line, for a shell."""
        return shlex.join(["navirl", self.command, *self.files, *self.options, "-o", self.output])


def names_of(paths: Sequence[Path]) -> list[str]:
    """Files and folders as steps name them: a folder has a / at its end; folders in front where names are alike."""
    listings = [manifest_path(path) for path in paths]
    whole = [path.resolve().parent if path.name == MANIFEST else path for path in listings]
    ends = ["/" if path.name == MANIFEST else "" for path in listings]
    most = max((len(path.parts) for path in whole), default=1)
    for count in range(1, most + 1):
        names = ["/".join(path.parts[-count:]) for path in whole]
        if len(set(names)) == len(names):
            break
    return [f"{name}{end}" for name, end in zip(names, ends, strict=True)] if paths else []


def steps_of(names: Sequence[str], contents: Iterable[Mapping[str, Any]]) -> list[Step]:
    """The commands that made some files, in an order in which they can be run; each once.

    Args:
        names: Present names of demonstrations files, as :func:`names_of` gives them.
        contents: Of each. A file without steps was extracted; how, is unknown where a setting differed between files
            that an older navirl merged.
    """
    found: list[Step] = []
    for name, content in zip(names, contents, strict=True):
        own = held_steps(content) or _extraction(content)
        for step in (*own[:-1], *(replace(last, output=name) for last in own[-1:])):
            if not _is_done(step, found):
                found.append(step)
    return found


def with_step(content: Mapping[str, Any], steps: Iterable[Step], last: Step) -> dict[str, Any]:
    """The content of a demonstrations file with the commands that made it.

    Args:
        content: Of the file.
        steps: That made the files it comes from.
        last: That makes the file.
    """
    entries = [{**asdict(one), "files": list(one.files), "options": list(one.options)} for one in (*steps, last)]
    return {**content, "steps": entries}


def edited(
    content: Mapping[str, Any],
    command: str,
    sources: Mapping[Path, Mapping[str, Any]],
    options: Sequence[str],
    output: Path,
) -> dict[str, Any]:
    """The content of a file that a command makes from others, with the commands that made it.

    Args:
        content: Of the new file.
        command: Its name.
        sources: Contents of the files that it read.
        options: Words of its command line.
        output: The new file.
    """
    names = names_of(list(sources))
    last = Step(command, tuple(names), tuple(options), output.name)
    return with_step(content, steps_of(names, sources.values()), last)


@dataclass(frozen=True, eq=False)
class Origin:
    """The files that demonstrations in Python come from, so that a file of some of them can name the commands."""

    #: Names of the files, and of each what :func:`steps_of` needs of its content.
    heads: Mapping[str, Mapping[str, Any]]
    #: All demonstrations of the files.
    everyone: Sequence[Demonstration]

    @staticmethod
    def of(contents: Mapping[str, Mapping[str, Any]], everyone: Sequence[Demonstration]) -> "Origin":
        """The origin of all demonstrations of some files, by the names of the files."""
        keys = ("inputs", "settings", "steps")
        return Origin({name: {key: own[key] for key in keys if key in own} for name, own in contents.items()}, everyone)

    def recorded(self, content: Mapping[str, Any], chosen: Sequence[Demonstration], output: str) -> dict[str, Any]:
        """The content of a file of some of the demonstrations, with the commands that give the same."""
        names = list(self.heads)
        if [one.id for one in chosen] != [one.id for one in self.everyone]:
            last = Step("select", tuple(names), tuple(choice_words(self.everyone, chosen)), output)
        elif len(names) > 1:
            last = Step("merge", tuple(names), (), output)
        else:
            held = held_steps(self.heads[names[0]])
            return with_step(content, held[:-1], replace(held[-1], output=output)) if held else dict(content)
        return with_step(content, steps_of(names, self.heads.values()), last)


def held_steps(content: Mapping[str, Any]) -> list[Step]:
    """The steps that a file names."""
    return [
        Step(one["command"], tuple(one["files"]), tuple(one["options"]), one["output"])
        for one in content.get("steps", ())
    ]


def _extraction(content: Mapping[str, Any]) -> list[Step]:
    """The extraction of a file that names no steps; none where files with other settings were merged."""
    from navirl_cli.demos.extract import ExtractSettings
    from navirl_cli.logs.load import LoadOptions

    settings, usual = content["settings"], settings_document(ExtractSettings(), LoadOptions(), None, None)
    if any(value is None and usual.get(name) is not None for name, value in settings.items()):
        return []
    others = {settings.get("map"), settings.get("trials")}
    logs = tuple(one["file"] for one in content["inputs"] if one["file"] not in others)
    return [Step("extract", logs, tuple(extract_words(settings, usual)), "")]


def _is_done(step: Step, before: Sequence[Step]) -> bool:
    """Whether a step was run before, and nothing that it reads or writes was written since."""
    if step not in before:
        return False
    since = before[before.index(step) + 1 :]
    return not {one.output for one in since} & {*step.files, step.output}


def extract_words(settings: Mapping[str, Any], defaults: Mapping[str, Any]) -> list[str]:
    """The settings of an extraction that are no defaults, as options of the command line.

    Args:
        settings: As in a demonstrations file; older files lack some.
        defaults: As in a demonstrations file that is extracted without options.
    """
    flat, usual = {**settings, **settings.get("push", {})}, {**defaults, **defaults["push"]}
    given = {option: flat.get(name, usual[name]) for name, option in SETTINGS.items()}
    given["no_wrench"] = not flat.get("wrench", True)
    for option, form in _FORMS.items():
        if given[option]:
            given[option] = form(given[option])
    return option_words(given, {option: usual[name] for name, option in SETTINGS.items()})


def selection_words(everyone: Sequence[Demonstration], taught: Sequence[Demonstration]) -> list[str]:
    """The shortest options by which a fit learns from exactly some demonstrations: it leaves out truncated ones."""
    return choice_words([one for one in everyone if not one.truncated or one in taught], taught)


def choice_words(everyone: Sequence[Demonstration], chosen: Sequence[Demonstration]) -> list[str]:
    """The shortest options that choose exactly some demonstrations: by condition, cycle and set, or one by one."""
    conditions = tuple(dict.fromkeys(one.condition.value for one in chosen))
    cycles = tuple(dict.fromkeys(one.cycle for one in chosen if one.cycle is not None))
    sets = tuple(dict.fromkeys(one.set or "main task" for one in chosen))
    ids = [one.id for one in chosen]
    for subset in (
        Subset(),
        Subset(condition=conditions),
        Subset(cycle=cycles),
        Subset(condition=conditions, cycle=cycles),
        Subset(condition=conditions, cycle=cycles, set=sets),
    ):
        if [one.id for one in subset.of(everyone)] == ids:
            return subset_words(subset)
    return subset_words(Subset(trial=tuple(ids)))


def subset_words(subset: Subset) -> list[str]:
    """A choice of demonstrations as options of a command."""
    return [word for field, names in vars(subset).items() for name in names for word in (f"--{field}", str(name))]
