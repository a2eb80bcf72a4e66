"""Terms by name: those of the package, installed ones, and a researcher's own from a Python file.

A file of Python code runs only if the user names it, on the command line, in Python or in the environment variable
NAVIRL_TERMS. A reward file holds names alone, so that reading one never runs code that the file chose.
"""

import copyreg
import os
import re
import sys
from collections.abc import Iterable, Sequence
from hashlib import sha256
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from navirl_cli.errors import ArgumentError, RewardError, unknown
from navirl_cli.files import read_regular
from navirl_cli.irl.terms import TERMS
from navirl_cli.irl.terms.term import Parameter, Term

#: Entry points of installed packages; files of one's own, as my_term.py:MyTerm, separated by commas.
GROUP, VARIABLE = "navirl.terms", "NAVIRL_TERMS"
#: What a term has.
_NEEDED = ("name", "formula", "symbols", "parameters", "about_people", "about_turns", "on")
_NAME, _WORD = re.compile(r"[a-z][a-z0-9-]*"), re.compile(r"[A-Za-z][A-Za-z0-9_]*")
#: Of the names of modules from files.
_PREFIX = "navirl_term_"
#: Terms that this process has taken from files, by name.
_taken: dict[str, Term] = {}


def terms_named(words: Iterable[str | Term]) -> tuple[Term, ...]:
    """Terms by name, or from files as ``my_term.py:MyTerm``; terms themselves are checked and keep their place.

    Raises:
        ArgumentError: A term is unknown or named twice, or two terms share a parameter.
        RewardError: A term cannot be loaded.
    """
    found: list[Term] = []
    for word in words:
        term = _own(word) if not isinstance(word, str) else _from_file(word) if ".py:" in word else _known(word)
        shared = {one.name for one in term.parameters} & {p.name for other in found for p in other.parameters}
        if shared:
            raise ArgumentError(
                f"`terms`: expected each parameter once, found {', '.join(sorted(shared))} again in {term.name}"
            )
        found.append(term)
    if not found:
        raise ArgumentError("`terms`: expected at least one term, found none")
    return tuple(found)


def names_of(terms: Iterable[Term]) -> list[str]:
    """The names of terms; :func:`terms_named` finds them in this process."""
    return [_own(term).name for term in terms]


def word_of(term: Term) -> str:
    """The word that names a term to the command line: its name, or its file without folders."""
    module = sys.modules.get(type(term).__module__)
    if module is None or not module.__name__.startswith(_PREFIX) or module.__file__ is None:
        return _own(term).name
    return f"{Path(module.__file__).name}:{type(term).__name__}"


def _own(term: Term) -> Term:
    """A term of the package, or one that is kept from now on."""
    return term if term in TERMS.values() else _take(term, type(term).__name__)


def _known(name: str) -> Term:
    """A term by its name."""
    if name in TERMS:
        return TERMS[name]
    for word in filter(None, os.environ.get(VARIABLE, "").split(",")):
        _from_file(word)
    if name in _taken:
        return _taken[name]
    installed = {point.name: point for point in entry_points(group=GROUP)}
    if name not in installed:
        names = [*TERMS, *_taken, *installed]
        raise ArgumentError(
            f"{unknown('term', name, names)}; install the package that has it, or name its file: "
            f"{VARIABLE}=my_term.py:MyTerm"
        )
    try:
        made = installed[name].load()
    except Exception as error:
        raise RewardError(f"term {name}: {installed[name].value} does not load: {_reason(error)}") from error
    return _take(_made(made, name), name)


def _from_file(word: str) -> Term:
    """A term of a Python file, as ``my_term.py:MyTerm``."""
    path, _, name = word.rpartition(":")
    module = _module(Path(path), word)
    if not hasattr(module, name):
        own = (
            value for value in vars(module).values() if isinstance(value, type) and value.__module__ == module.__name__
        )
        classes = [value.__name__ for value in own]
        raise RewardError(f"{path}: {unknown('term', name, classes)}")
    made = getattr(module, name)
    if isinstance(made, type):
        # Other processes load the file again.
        copyreg.pickle(made, lambda _term: (_from_file, (f"{Path(path).resolve()}:{name}",)))
    return _take(_made(made, word), word)


def _module(path: Path, word: str) -> ModuleType:
    """Run a Python file, once for each content."""
    try:
        content = read_regular(path)
    except OSError as error:
        raise RewardError(
            f"{word}: expected a Python file and a class as my_term.py:MyTerm: {error.strerror}"
        ) from error
    name = f"{_PREFIX}{sha256(bytes(path.resolve()) + content).hexdigest()[:16]}"
    if name not in sys.modules:
        module = ModuleType(name)
        module.__file__ = str(path)
        sys.modules[name] = module  # dataclasses look their module up
        try:
            # The user has named this file to be run. No bytecode is kept, which would be as old as a second.
            exec(compile(content, str(path), "exec"), module.__dict__)  # noqa: S102
        except Exception as error:
            del sys.modules[name]
            raise RewardError(f"{path}: does not run: {_reason(error)}") from error
    return sys.modules[name]


def _made(made: object, source: str) -> Term:
    """A term from its class, or the term itself."""
    try:
        return made() if isinstance(made, type) else made  # type: ignore[return-value]  # _take checks it
    except Exception as error:
        raise RewardError(f"term {source}: cannot be made without arguments: {_reason(error)}") from error


def _take(term: Term, source: str) -> Term:
    """Check a term that is not of the package, and keep it under its name."""
    lacking = [one for one in _NEEDED if not hasattr(term, one)]
    if lacking:
        raise RewardError(f"term {source}: expected {', '.join(_NEEDED)}, found no {', '.join(lacking)}")
    if not _NAME.fullmatch(term.name) or term.name in TERMS:
        raise RewardError(
            f"term {source}: expected a name of its own of lower-case letters, digits and hyphens, found {term.name!r}"
        )
    _check_parameters(term.parameters, source)
    _taken[term.name] = term
    return term


def _check_parameters(parameters: Sequence[Parameter], source: str) -> None:
    """Refuse parameters that cannot be named in `init`, or without an admissible start."""
    for one in parameters:
        if not _WORD.fullmatch(one.name):
            raise RewardError(f"term {source}: expected parameters named as a_p or sigma, found {one.name!r}")
        starts = (one.initial, *one.scan)
        if not (all(one.lower <= start <= one.upper for start in starts) and one.scale > 0):
            raise RewardError(
                f"term {source}: {one.name}: expected initial values within {one.lower:g} to {one.upper:g} and a "
                f"positive scale, found {', '.join(f'{start:g}' for start in starts)} and {one.scale:g}"
            )


def _reason(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
