"""How far a person reaches, and which steps of a path they could have changed by a push."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.timing import cell_times_s, steps_in_contact
from navirl_cli.errors import DemonstrationError

#: Distances equal up to the decimals of a demonstrations file are the same, m.
_ROUNDING_M = 1e-6


@dataclass(frozen=True)
class Reach:
    """Largest distance at which people push the robot."""

    #: From the robot's centre to the person's, m.
    reach_m: float
    #: Demonstration in which they pushed at this distance; None for a reach that was stated.
    seen_in: str | None = None


def centre_distances_m(demonstration: Demonstration, t_s: FloatArray) -> FloatArray:
    """Distances from the robot's centre to the nearest person's at given times.

    Args:
        demonstration: The trial.
        t_s: (m,) s since the trial's start.

    Returns:
        (m,) m; infinite without people. People who move are where their track was.
    """
    d = demonstration
    x, y = (np.interp(t_s, d.t_s, axis) for axis in d.xy_m.T)
    least = np.full(len(t_s), np.inf)
    for number, place in enumerate(d.people_m):
        track = d.tracks[number] if d.tracks else None
        moving = track is not None and len(track.t_s) > 0
        across, along = (np.interp(t_s, track.t_s, axis) for axis in track.xy_m.T) if track and moving else place
        least = np.minimum(least, np.hypot(x - across, y - along))
    return least


def reach_of(demonstrations: Iterable[Demonstration]) -> Reach | None:
    """The largest distance at which people pushed, by the contacts of all demonstrations.

    Returns:
        The reach; None where nobody pushed, contact is unknown, or there are no people.
    """
    best: Reach | None = None
    for one in demonstrations:
        for contact in one.contacts or ():
            inside = one.t_s[(one.t_s > contact.start_s) & (one.t_s < contact.end_s)]
            at = np.concatenate([[contact.start_s], inside, [contact.end_s]])
            most = float(centre_distances_m(one, at).max())
            if np.isfinite(most) and (best is None or most > best.reach_m):
                best = Reach(most, one.id)
    return best


def steps_within_reach(demonstration: Demonstration, reach_m: float) -> BoolArray:
    """Which steps show what the person wants: those in contact, and those that they could have changed by a push.

    A step without a push within reach is one that the person accepted. A joystick reaches everywhere.

    Args:
        demonstration: The trial.
        reach_m: Distance from the robot's centre to the person's, m.

    Returns:
        (k - 1,) one for each step between successive cells; one that is within reach at its beginning or end counts.

    Raises:
        DemonstrationError: Contact is unknown.
    """
    d = demonstration
    if d.condition is Condition.JOYSTICK:
        return np.ones(len(d.cells) - 1, dtype=bool)
    near = centre_distances_m(d, cell_times_s(d.xy_m, d.t_s, d.cells, d.grid)) <= reach_m + _ROUNDING_M
    found: BoolArray = steps_in_contact(d) | near[1:] | near[:-1]
    return found


def reach_unknown(demonstrations: Iterable[Demonstration]) -> list[str]:
    """Ids of the demonstrations whose evidence depends on a reach, but whose contacts are unknown."""
    return [one.id for one in demonstrations if one.contacts is None and one.condition is not Condition.JOYSTICK]


def required_reach(demonstrations: Sequence[Demonstration], reach_m: float | None) -> Reach | None:
    """The stated reach, or that of the contacts; None where a joystick steered all demonstrations and none is needed.

    Raises:
        DemonstrationError: No reach is stated, and no contact with people in the scene shows one.
    """
    found = reach_of(demonstrations) if reach_m is None else Reach(reach_m)
    if found is None and any(one.condition is not Condition.JOYSTICK for one in demonstrations):
        raise DemonstrationError(
            "`steps` reachable: expected contacts in a scene with people, which show the reach, found none; "
            "state the reach with `reach`, or learn from all steps"
        )
    return found
