"""Which frames stand above which."""

from collections.abc import Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from navirl_cli.errors import FrameError
from navirl_cli.logs.tf.transforms import ALWAYS, Curve, Span


def parents_first(graph: Mapping[str, Sequence[Curve]]) -> list[str]:
    """Frames in an order in which parents come before children; refuses circles."""
    parents = {child: [curve.parent for curve in curves] for child, curves in graph.items()}
    try:
        return list(TopologicalSorter(parents).static_order())
    except CycleError as error:
        circle = " -> ".join(error.args[1])
        raise FrameError(
            f"transform {circle}: expected parents that lead up to one frame, found a circle; "
            "remap one publisher's frames, or record without it"
        ) from error


def covers(graph: Mapping[str, Sequence[Curve]]) -> dict[str, Span]:
    """From when to when all transforms from a frame up have stamps, by frame."""
    found: dict[str, Span] = {}
    for child in parents_first(graph):
        spans = [(curve.span, found.get(curve.parent, ALWAYS)) for curve in graph.get(child, ())]
        both = [(max(own[0], above[0]), min(own[1], above[1])) for own, above in spans] or [ALWAYS]
        both = [span for span in both if span[0] <= span[1]] or both
        found[child] = min(first for first, _ in both), max(last for _, last in both)
    return found


def reached(begin: set[str], neighbours: Mapping[str, Iterable[str]]) -> set[str]:
    """The frames of a set and all that can be reached from them."""
    found, open_ = set(begin), list(begin)
    while open_:
        new = set(neighbours.get(open_.pop(), ())) - found
        found |= new
        open_.extend(new)
    return found
