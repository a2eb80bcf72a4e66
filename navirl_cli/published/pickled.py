"""Reads pickles of protocol 0, as the study publishes them, as data: no code in them is ever called.

Unpickling runs code by design. Here no class is looked up and no object is constructed: an object is returned as the
name of its class with the content of the file, and names that the study does not need are refused. Python's own parsers
are unsuitable: the unpickler allocates memory by a memo's number and hashes nested keys without end, and pickletools
refuses strings with bytes above 127.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from navirl_cli.errors import ArtefactError

#: The names allowed, by module: messages of ROS, arrays of numpy, tensors of torch, the study's own classes.
NAMES: Final = frozenset(
    {
        "__builtin__.object",
        "collections.OrderedDict",
        "copy_reg._reconstructor",
        "demonstration.Demonstration",
        "genpy.rostime.Time",
        "geometry_msgs.msg._Point.Point",
        "geometry_msgs.msg._Pose.Pose",
        "geometry_msgs.msg._Quaternion.Quaternion",
        "nav_map.NavMap",
        "nav_msgs.msg._MapMetaData.MapMetaData",
        "nav_msgs.msg._OccupancyGrid.OccupancyGrid",
        "numpy.core.multiarray._reconstruct",
        "numpy.core.multiarray.scalar",
        "numpy.dtype",
        "numpy.ndarray",
        "std_msgs.msg._Header.Header",
        "torch.DoubleStorage",
        "torch.FloatStorage",
        "torch.LongStorage",
        "torch._utils._rebuild_tensor",
        "torch._utils._rebuild_tensor_v2",
        "torch.storage._load_from_bytes",
    }
)
#: Fifty times the operations of a published file; at 200 bytes each they need little memory.
MOST_OPERATIONS: Final = 1_000_000

_RECONSTRUCTOR: Final = "copy_reg._reconstructor"
_INTEGER: Final = re.compile(rb"-?\d{1,19}")
#: No float that Python writes is longer.
_FLOAT_LENGTH: Final = 40
#: A string's repr: printable ASCII, and the escapes that Python 2 writes.
_TEXT: Final = re.compile(rb"""(?:[ -\[\]-~]|\\[\\'"nrt]|\\x[0-9a-f]{2})*+""")


@dataclass(frozen=True, slots=True)
class Name:
    """A class or function, by its full name."""

    name: str


@dataclass(slots=True)
class Kept:
    """The description of an object in a pickle, in place of the object."""

    #: Full name of its class, or of the function that would make it.
    name: str
    args: tuple[Any, ...] = ()
    state: Any = None


class _BrokenError(Exception):
    """The content is no pickle of protocol 0; the text is part of a message."""


class _RefusedError(Exception):
    """A name that the study does not need."""


def read_pickle(data: bytes, name: str) -> Any:
    """The content of a pickle, without making or running anything that it names.

    Args:
        data: The file's bytes.
        name: The file, for messages.

    Returns:
        Lists, tuples, dictionaries (with texts and integers as keys), texts (bytes as latin-1), numbers, booleans,
        None, `Name` and `Kept`. Parts may be shared, and lists may contain themselves.

    Raises:
        ArtefactError: It is no pickle of protocol 0, is truncated, or holds a name that the study does not need.
    """
    machine = _Machine(data)
    try:
        return machine.run()
    except _RefusedError as error:
        raise ArtefactError(
            f"{name}: expected only names that the published study needs, found {error} before byte {machine.at}; "
            "no code was run; download the file from its authors again"
        ) from None
    except _BrokenError as error:
        raise ArtefactError(
            f"{name}: expected a pickle of protocol 0, as the study is published, found {error} before byte "
            f"{machine.at} of {len(data)}; download the file from its authors again"
        ) from None


class _Machine:
    """The stack and the memo of a pickle that is being read."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0
        self.stack: list[Any] = []
        #: The stack below each open mark.
        self.below: list[list[Any]] = []
        self.memo: dict[bytes, Any] = {}

    def run(self) -> Any:
        """Run the operations up to the end."""
        data, steps = self.data, _STEPS
        for _ in range(MOST_OPERATIONS):
            if self.at >= len(data):
                raise _BrokenError("its end")
            code = data[self.at]
            self.at += 1
            if code == _STOP:
                return self.result()
            step = steps.get(code)
            if step is None:
                raise _BrokenError(f"operation {chr(code)!r}")
            step(self)
        raise _BrokenError(f"more than {MOST_OPERATIONS} operations")

    def result(self) -> Any:
        """The only remaining value."""
        if self.at < len(self.data) or len(self.stack) != 1 or self.below:
            raise _BrokenError("more than one value at its end")
        return self.stack[0]

    def line(self) -> bytes:
        """An operation's argument."""
        end = self.data.find(b"\n", self.at)
        if end < 0:
            self.at = len(self.data)
            raise _BrokenError("its end within a line")
        line = self.data[self.at : end]
        self.at = end + 1
        return line

    def pop(self) -> Any:
        """The topmost value."""
        if not self.stack:
            raise _BrokenError("an operation without its operand")
        return self.stack.pop()

    def top(self, wanted: type[Any]) -> Any:
        """The topmost value, which stays, if it is of a type."""
        if not self.stack or type(self.stack[-1]) is not wanted:
            raise _BrokenError(f"an operation on no {wanted.__name__.lower()}")
        return self.stack[-1]

    def marked(self) -> list[Any]:
        """The values above the last mark, which is removed."""
        if not self.below:
            raise _BrokenError("an operation without its mark")
        items, self.stack = self.stack, self.below.pop()
        return items

    def name(self) -> Name:
        """The class or function that two lines name."""
        name = ".".join(self.line().decode("latin-1") for _ in range(2))
        if name not in NAMES:
            raise _RefusedError(name[:100] if name.isprintable() else repr(name[:100]))
        return Name(name)

    def mark(self) -> None:
        """MARK: the next values belong together."""
        self.below.append(self.stack)
        self.stack = []

    def put(self) -> None:
        """PUT: remember the topmost value."""
        if not self.stack:
            raise _BrokenError("no value to remember")
        self.memo[self.line()] = self.stack[-1]

    def get(self) -> None:
        """GET: a value that was remembered."""
        key = self.line()
        if key not in self.memo:
            raise _BrokenError("a reference to no value")
        self.stack.append(self.memo[key])

    def append(self) -> None:
        """APPEND: the topmost value to the list below it."""
        item = self.pop()
        self.top(list).append(item)

    def set_item(self) -> None:
        """SETITEM: key and value to the dictionary below them."""
        value, key = self.pop(), self.pop()
        self.top(dict).update(_entries([key, value]))

    def reduce(self) -> Kept:
        """REDUCE: would call a function; here its name is kept with the arguments."""
        args, called = self.pop(), self.pop()
        if type(args) is not tuple or type(called) is not Name:
            raise _BrokenError("a call of no name")
        made = args[0] if called.name == _RECONSTRUCTOR and args and type(args[0]) is Name else None
        return Kept(made.name) if made else Kept(called.name, args)

    def instance(self) -> Kept:
        """INST: would construct an object; here the class's name is kept with the arguments."""
        return Kept(self.name().name, tuple(self.marked()))

    def build(self) -> None:
        """BUILD: an object's state."""
        state = self.pop()
        self.top(Kept).state = state


def _entries(items: list[Any]) -> dict[Any, Any]:
    """A dictionary of keys and values in turn; hashing nested keys might never end."""
    keys = items[::2]
    if len(items) % 2 or not all(type(key) in {str, int} for key in keys):
        raise _BrokenError("a dictionary's key that is neither text nor integer")
    return dict(zip(keys, items[1::2], strict=True))


def _integer(line: bytes) -> int | bool:
    """An INT's or LONG's number; protocol 0 writes booleans as 00 and 01."""
    if line in {b"00", b"01"}:
        return line == b"01"
    if not _INTEGER.fullmatch(line):
        raise _BrokenError("no integer of at most 19 digits")
    return int(line)


def _float(line: bytes) -> float:
    """A FLOAT's number."""
    try:
        return float(line if len(line) <= _FLOAT_LENGTH else b"")
    except ValueError:
        raise _BrokenError("no number") from None


def _string(line: bytes) -> str:
    """A STRING's bytes as latin-1."""
    quoted = len(line) > 1 and line[:1] == line[-1:] and line[:1] in {b"'", b'"'}
    if not quoted or not _TEXT.fullmatch(line, 1, len(line) - 1):
        raise _BrokenError("no string in quotes")
    return line[1:-1].decode("unicode_escape")


def _unicode(line: bytes) -> str:
    """A UNICODE's text."""
    try:
        return line.decode("raw_unicode_escape")
    except UnicodeDecodeError:
        raise _BrokenError("no text") from None


def _pushes(value: Callable[[_Machine], Any]) -> Callable[[_Machine], None]:
    """An operation that puts a value on the stack."""

    def step(machine: _Machine) -> None:
        made = value(machine)  # first, because it may exchange the stack
        machine.stack.append(made)

    return step


_STOP: Final = ord(".")
_STEPS: Final[dict[int, Callable[[_Machine], None]]] = {
    ord(code): step
    for code, step in {
        "(": _Machine.mark,
        "I": _pushes(lambda machine: _integer(machine.line())),
        "L": _pushes(lambda machine: _integer(machine.line().removesuffix(b"L"))),
        "F": _pushes(lambda machine: _float(machine.line())),
        "S": _pushes(lambda machine: _string(machine.line())),
        "V": _pushes(lambda machine: _unicode(machine.line())),
        "N": _pushes(lambda _machine: None),
        "l": _pushes(_Machine.marked),
        "t": _pushes(lambda machine: tuple(machine.marked())),
        "d": _pushes(lambda machine: _entries(machine.marked())),
        "a": _Machine.append,
        "s": _Machine.set_item,
        "p": _Machine.put,
        "g": _Machine.get,
        "c": _pushes(_Machine.name),
        "R": _pushes(_Machine.reduce),
        "i": _pushes(_Machine.instance),
        "b": _Machine.build,
    }.items()
}
