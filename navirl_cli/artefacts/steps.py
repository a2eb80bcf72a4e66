"""The command lines by which a demonstrations file was made."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from navirl_cli.artefacts.options import option_words
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.subset import Subset

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
