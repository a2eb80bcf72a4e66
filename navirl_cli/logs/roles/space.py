"""The stage of space: all tables of a recording in one frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.errors import FrameError, NavirlError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.occupancy import MapHistory
from navirl_cli.logs.recording import Occupancy, Track, Wrench
from navirl_cli.logs.roles.clocks import NS_PER_S
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context
from navirl_cli.logs.roles.goals import goals_of
from navirl_cli.logs.roles.maps import maps_in, placed_maps
from navirl_cli.logs.roles.people import people_of
from navirl_cli.logs.roles.poses import Poses, poses_of
from navirl_cli.logs.roles.times import Tables
from navirl_cli.logs.roles.wrench import wrench_of
from navirl_cli.logs.tf.transforms import Curve, links_of
from navirl_cli.logs.tf.tree import TransformTree

#: A note lists at most so many values of a static transform.
_MOST_VALUES: Final = 4
#: The frame of a map from a file, as Nav2's map server names it.
_MAP_FRAME: Final = "map"

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Placed:
    """All tables in one frame. What could not be placed is None and has a refusal."""

    context: Context
    poses: Poses | None
    wrench: Wrench | None
    #: The last map, and all maps where there are several.
    occupancy: Occupancy | None
    maps: MapHistory | None
    goal_t_ns: IntArray
    goal_m: FloatArray
    people_t_ns: IntArray
    people: tuple[Track, ...]
    findings: Findings
    #: Why there are no poses, no forces or no map, in this order.
    refusals: tuple[NavirlError, ...]


def in_one_frame(
    log: str,
    tables: Tables,
    frame: str | None,
    wrench_frame: str | None,
    occupancy: Occupancy | None,
    force_scale: float = 1.0,
    namespace: str | None = None,
) -> Placed:
    """Bring poses, forces, people, goals and the map into the map's or the chosen frame.

    Args:
        log: The recording's name, for messages.
        tables: On one clock; a role without messages or that is not wanted may be absent.
        frame: The frame that everything is brought into, in place of the map's.
        wrench_frame: The frame that the wrench is given in, in place of its header's.
        occupancy: A map in place of the log's, in the fixed frame.
        force_scale: N for the unit of the wrench's forces.
        namespace: Of the robot, where the user named it.
    """
    tree = TransformTree(
        [
            link
            for one in tables.get("tf_static", ())
            # whatever their stamps are, they count from when they were sent
            for link in links_of(_tf_columns(one), one.owner_counts, one.t_ns[one.owner])
        ],
        [link for one in tables.get("tf", ()) for link in links_of(_tf_columns(one), one.owner_counts)],
    )
    attempt = _Attempts()
    topics = tables.get("map", ()) if occupancy is None else ()
    maps = attempt(lambda: maps_in(log, topics)) if topics else None
    fixed = frame or (maps.frame if maps else "") or _MAP_FRAME
    context = Context(log, tree, fixed, namespace or "")
    poses = attempt(lambda: poses_of(_first(tables, "odometry"), context))
    forces = _first(tables, "wrench")
    base = poses[0].base if poses else _usual_base(context)
    wrench = attempt(lambda: wrench_of(forces, context, base, wrench_frame, force_scale)) if forces and base else None
    people_t_ns, people, lost_people = people_of(tables.get("people", ()), context)
    goal_t_ns, goal_m, lost_goals = goals_of(_first(tables, "goal"), context, poses[0] if poses else None)
    history = attempt(lambda: placed_maps(maps, context)) if maps else None
    return Placed(
        context=context,
        poses=poses[0] if poses else None,
        wrench=wrench[0] if wrench else None,
        occupancy=occupancy if history is None else history.occupancy(len(history.sheets) - 1),
        maps=history if history is not None and len(history.sheets) > 1 else None,
        goal_t_ns=goal_t_ns,
        goal_m=goal_m,
        people_t_ns=people_t_ns,
        people=people,
        findings=(
            *(maps.findings if maps else ()),
            *_about_tf(tree, _start_ns(tables)),
            *(one for part in (poses, wrench) if part for one in part[1]),
            *lost_people,
            *lost_goals,
        ),
        refusals=tuple(attempt.refusals),
    )


def _usual_base(context: Context) -> str:
    """The robot's own frame where no message names it; "" where several could be, as the poses' refusal says."""
    try:
        return context.base_frame("")[0]
    except FrameError:
        return ""


@dataclass(eq=False)
class _Attempts:
    """Calls what may refuse a log, so that all refusals are found."""

    refusals: list[NavirlError] = field(default_factory=list)

    def __call__(self, place: Callable[[], T]) -> T | None:
        """What a role gives; None where it refuses the log."""
        try:
            return place()
        except NavirlError as error:
            self.refusals.append(error)
            return None


def _first(tables: Tables, role: str) -> Columns | None:
    """The only topic of a role; None without messages."""
    return next(iter(tables.get(role, ())), None)


def _start_ns(tables: Tables) -> int:
    """The first time of the measurements."""
    return min((int(one.t_ns[0]) for role in ("odometry", "wrench") for one in tables.get(role, ())), default=0)


def _about_tf(tree: TransformTree, start_ns: int) -> Findings:
    """Transforms that the tree does not take as they are, and static ones that change."""
    named = [(f"{parent} -> {child}", one) for (parent, child), some in tree.faults.items() for one in some]
    return (
        *(Finding(Kind.IGNORED_TRANSFORMS, pair, detail=str(one)) for pair, one in named if one.ignored),
        *(Finding(Kind.RESCALED, f"transforms {pair}", detail=one.rescaled) for pair, one in named if one.rescaled),
        *(
            Finding(
                Kind.STATIC_CHANGES,
                f"{curve.parent} -> {curve.child}",
                len(curve.changes),
                at_s=(int(curve.t_ns[curve.changes[0]]) - start_ns) / NS_PER_S,
                detail=_values(curve, start_ns),
            )
            for curve in tree.static_changes()
        ),
    )


def _values(curve: Curve, start_ns: int) -> str:
    """The values of a static transform that changes, and from when they count."""
    rows = [0, *curve.changes.tolist()]
    shown = [
        f"{'at first' if row == 0 else f'from {(int(curve.t_ns[row]) - start_ns) / NS_PER_S:.1f} s on'} {pose}"
        for row, pose in zip(rows, curve.described(rows[:_MOST_VALUES]), strict=False)
    ]
    more = len(rows) - len(shown)
    return ", ".join(shown) + (f", and {more} more" if more else "")


def _tf_columns(columns: Columns) -> Mapping[str, NDArray[Any]]:
    """The columns by the fields of the message."""
    return {path: columns[name] for name, path in columns.message_type.fields.items()}
