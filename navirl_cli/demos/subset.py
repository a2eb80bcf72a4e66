"""Which demonstrations of a file are meant: by condition, cycle, set, participant, trial."""

from collections.abc import Callable, Collection, Mapping, Sequence
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
_FIELDS: Mapping[str, Callable[[Demonstration], str]] = {**FIELDS, "trial": lambda one: one.id}


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
        """The names by field that chooses, as FIELDS gives them."""
        cycles = tuple(f"cycle {number}" for number in self.cycle)
        fields = {**vars(self), "cycle": cycles}
        return {field: tuple(dict.fromkeys(own)) for field, own in fields.items() if own}

    def of(self, demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
        """The chosen demonstrations, in their order.

        Raises:
            DemonstrationError: A name is not among the demonstrations, or none has all that was asked for at once; the
                message lists what is there.
        """
        names = self.names
        for field, own in names.items():
            known = _known(demonstrations, [field])
            for name in own:
                if demonstrations and name not in known:
                    raise DemonstrationError(unknown(f"`{field}`", name, known))
        chosen = [one for one in demonstrations if all(_FIELDS[field](one) in own for field, own in names.items())]
        if demonstrations and not chosen:
            asked = ", ".join(" or ".join(own) for own in names.values())
            fields = " and ".join(f"`{field}`" for field in names)
            raise DemonstrationError(unknown(fields, asked, _known(demonstrations, names)))
        return chosen


def _known(demonstrations: Sequence[Demonstration], fields: Collection[str]) -> list[str]:
    """Names of several fields that occur together."""
    found = dict.fromkeys(", ".join(_FIELDS[field](one) for field in fields) for one in demonstrations)
    return list(found) if list(fields) == ["trial"] else sorted(found)
