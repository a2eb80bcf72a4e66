"""Which demonstrations of a file are meant: by condition, cycle, set, participant, trial."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import DemonstrationError, unknown

#: By what demonstrations are grouped and chosen.
FIELDS: Mapping[str, Callable[[Demonstration], str]] = {
    "condition": lambda one: one.condition.value,
    "cycle": lambda one: "no cycle" if one.cycle is None else f"cycle {one.cycle}",
    "set": lambda one: one.set or "main task",
    "participant": lambda one: one.participant,
}
#: By what they are chosen, in the words of the options.
_FIELDS: Mapping[str, Callable[[Demonstration], str]] = {
    **FIELDS,
    "cycle": lambda one: "" if one.cycle is None else str(one.cycle),
    "trial": lambda one: one.id,
}


@dataclass(frozen=True)
class Subset:
    """A choice: within a field any of the names, and all fields at once. An empty field does not choose."""

    condition: tuple[str, ...] = ()
    cycle: tuple[int, ...] = ()
    #: Trials without a set are of the "main task".
    set: tuple[str, ...] = ()
    participant: tuple[str, ...] = ()
    #: Ids of demonstrations.
    trial: tuple[str, ...] = ()

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """The names by field that chooses, as the options take them."""
        fields = {**vars(self), "cycle": tuple(map(str, self.cycle))}
        return {field: tuple(dict.fromkeys(own)) for field, own in fields.items() if own}

    def of(self, demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
        """The chosen demonstrations, in their order.

        Raises:
            DemonstrationError: A name is not among the demonstrations, or none has all that was asked for at once; the
                message lists what is there.
        """
        names = self.names
        for field, own in names.items():
            known = _known(demonstrations, field)
            for name in own:
                if demonstrations and not known:
                    raise DemonstrationError(f"`{field}`: expected {name}, found demonstrations without a {field}")
                if demonstrations and name not in known:
                    raise DemonstrationError(unknown(f"`{field}`", name, known))
        chosen = [one for one in demonstrations if all(_FIELDS[field](one) in own for field, own in names.items())]
        if demonstrations and not chosen:
            asked = ", ".join(_together(field, " or ".join(own)) for field, own in names.items())
            fields = " and ".join(f"`{field}`" for field in names)
            there = {", ".join(_together(field, _FIELDS[field](one)) for field in names) for one in demonstrations}
            raise DemonstrationError(unknown(fields, asked, sorted(there)))
        return chosen


def _known(demonstrations: Sequence[Demonstration], field: str) -> list[str]:
    """Names of a field, without those that no option can choose."""
    found = [name for name in dict.fromkeys(map(_FIELDS[field], demonstrations)) if name]
    return found if field == "trial" else sorted(found)


def _together(field: str, name: str) -> str:
    """A name beside those of other fields, where a bare number would not say what it counts."""
    return name if field != "cycle" else f"cycle {name}" if name else "no cycle"
