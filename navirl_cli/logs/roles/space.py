"""The stage of space: all tables of a recording in one frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.errors import NavirlError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.recording import Occupancy, Track, Wrench
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context
from navirl_cli.logs.roles.goals import goals_of
from navirl_cli.logs.roles.maps import map_in, occupancy_of
from navirl_cli.logs.roles.people import people_of
from navirl_cli.logs.roles.poses import Poses, poses_of
from navirl_cli.logs.roles.times import Tables
from navirl_cli.logs.roles.wrench import wrench_of
from navirl_cli.logs.tf.transforms import links_of
from navirl_cli.logs.tf.tree import TransformTree

#: The frame of a map from a file, as Nav2's map server names it.
_MAP_FRAME: Final = "map"

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Placed:
    """All tables in one frame. What could not be placed is None and has a refusal."""

    context: Context
    poses: Poses | None
    wrench: Wrench | None
    occupancy: Occupancy | None
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
) -> Placed:
    """Bring poses, forces, people, goals and the map into the map's or the chosen frame.

    Args:
        log: The recording's name, for messages.
        tables: On one clock; a role without messages or that is not wanted may be absent.
        frame: The frame that everything is brought into, in place of the map's.
        wrench_frame: The frame that the wrench is given in, in place of its header's.
        occupancy: A map in place of the log's, in the fixed frame.
        force_scale: N for the unit of the wrench's forces.
    """
    tree = TransformTree(
        [link for one in tables.get("tf_static", ()) for link in links_of(_tf_columns(one), one.owner_counts)],
        [link for one in tables.get("tf", ()) for link in links_of(_tf_columns(one), one.owner_counts)],
    )
    attempt = _Attempts()
    own_map = (occupancy, "") if occupancy is not None else None
    maps = tables.get("map", ())
    map_and_frame = own_map or (attempt(lambda: map_in(log, maps)) if maps else None)
    context = Context(log, tree, frame or (map_and_frame[1] if map_and_frame else "") or _MAP_FRAME)
    poses = attempt(lambda: poses_of(_first(tables, "odometry"), context))
    forces = _first(tables, "wrench")
    base = poses[0].base if poses else context.base_frame("")[0]
    wrench = attempt(lambda: wrench_of(forces, context, base, wrench_frame, force_scale)) if forces else None
    people_t_ns, people, lost_people = people_of(tables.get("people", ()), context)
    goal_t_ns, goal_m, lost_goals = goals_of(_first(tables, "goal"), context, poses[0] if poses else None)
    placed_map = attempt(lambda: occupancy_of(map_and_frame, context)) if map_and_frame else None
    return Placed(
        context=context,
        poses=poses[0] if poses else None,
        wrench=wrench[0] if wrench else None,
        occupancy=placed_map,
        goal_t_ns=goal_t_ns,
        goal_m=goal_m,
        people_t_ns=people_t_ns,
        people=people,
        findings=(
            *_ignored(tree),
            *(one for part in (poses, wrench) if part for one in part[1]),
            *lost_people,
            *lost_goals,
        ),
        refusals=tuple(attempt.refusals),
    )


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


def _found(part: tuple[object, Findings] | None) -> Findings:
    """What a role that gave something found out."""
    return part[1] if part else ()


def _first(tables: Tables, role: str) -> Columns | None:
    """The only topic of a role; None without messages."""
    return next(iter(tables.get(role, ())), None)


def _ignored(tree: TransformTree) -> Findings:
    """The transforms that the tree does not take."""
    return tuple(
        Finding(Kind.IGNORED_TRANSFORMS, f"{parent} -> {child}", count)
        for (parent, child), count in tree.ignored.items()
    )


def _tf_columns(columns: Columns) -> Mapping[str, NDArray[Any]]:
    """The columns by the fields of the message."""
    return {path: columns[name] for name, path in columns.message_type.fields.items()}
