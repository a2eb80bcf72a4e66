"""What extraction found unusual, repeated where its demonstrations are used: each thing once, with a count."""

import re
from collections.abc import Sequence

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import counted

#: Numbers, which differ between texts that say the same.
_NUMBER = re.compile(r"-?\d+(\.\d+)?")
#: So many demonstrations are named.
_NAMED = 3


def repeated(demonstrations: Sequence[Demonstration]) -> list[str]:
    """The notes on demonstrations and the warnings about their recordings, as ``names: text``.

    Texts that differ in their numbers only are joined at the first of them.
    """
    found: dict[str, list[tuple[str, str]]] = {}
    for one in demonstrations:
        for text in (*one.notes, *one.warnings):
            found.setdefault(_NUMBER.sub("#", text), []).append((one.id, text))
    return [_line(entries, len(demonstrations)) for entries in found.values()]


def _line(entries: Sequence[tuple[str, str]], count: int) -> str:
    """One line for all demonstrations about which the same is said."""
    names = list(dict.fromkeys(name for name, _ in entries))
    texts = list(dict.fromkeys(text for _, text in entries))
    listed = ", ".join(names) if len(names) <= _NAMED else f"{len(names)} of {counted(count, 'demonstration')}"
    if len(texts) == 1:
        return f"{listed}: {texts[0]}"
    return f"{listed}: {texts[0]}" + (f" ({names[0]}; with other numbers the others)" if len(names) > 1 else "")
