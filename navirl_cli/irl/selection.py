"""Which demonstrations and which of their steps a reward is learnt from."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum

from navirl_cli.arrays import BoolArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.reach import Reach, required_reach, steps_within_reach
from navirl_cli.demos.subset import Subset
from navirl_cli.demos.timing import steps_in_contact
from navirl_cli.errors import DemonstrationError, unknown
from navirl_cli.irl.evidence import Evidence, evidence_of
from navirl_cli.irl.scene import Scene


class Steps(StrEnum):
    """Steps of a path that count."""

    ALL = "all"
    #: Those during contact.
    CONTACT = "contact"
    #: Those during contact or within the person's reach: not pushing there is acceptance.
    REACHABLE = "reachable"


@dataclass(frozen=True, eq=False)
class Selection:
    """The chosen demonstrations and their steps."""

    demonstrations: tuple[Demonstration, ...]
    evidence: Evidence
    #: Side of the cells of all demonstrations, m.
    resolution_m: float
    #: The reach that decided which steps count; None where none did.
    reach: Reach | None = None


def select(
    demonstrations: Sequence[Demonstration],
    subset: Subset = Subset(),  # noqa: B008 - it is frozen
    *,
    only_corrected: bool = False,
    truncated: bool = False,
    steps: Steps = Steps.ALL,
    reach_m: float | None = None,
) -> Selection:
    """Choose demonstrations and collect their steps.

    Args:
        demonstrations: To choose from.
        subset: By condition, cycle and the like; all by default.
        only_corrected: Only demonstrations in which the person intervened.
        truncated: Also demonstrations that are cut off.
        steps: All steps, those during contact, or those during contact or within reach; demonstrations without such
            steps are left out.
        reach_m: The person's reach, centre to centre, m; None for the largest distance at which people pushed in the
            chosen demonstrations.

    Returns:
        Demonstrations in their order, and their steps.

    Raises:
        DemonstrationError: No demonstration or step is left, a name of the subset is unknown, the intervention is
            unknown, or the cells differ in size.
        SceneError: A demonstration's scene has no path from start to goal.
    """
    chosen = subset.of(demonstrations)
    if not truncated:
        chosen = whole(chosen)
    if only_corrected:
        chosen = _corrected(chosen)
    return with_steps(chosen, steps, reach_m)


def of_participant(demonstrations: Sequence[Demonstration], person: str | None) -> Sequence[Demonstration]:
    """The demonstrations of one participant; all of them for None.

    Raises:
        DemonstrationError: There are none of this participant.
    """
    if person is None:
        return demonstrations
    own = [one for one in demonstrations if one.participant == person]
    if not own:
        raise DemonstrationError(unknown("`person`", person, sorted({one.participant for one in demonstrations})))
    return own


def with_steps(
    chosen: Sequence[Demonstration], steps: Steps, reach_m: float | None = None, known: Collection[Scene] = ()
) -> Selection:
    """Demonstrations with those of their steps that count.

    Arguments, result and errors are those of :func:`select`, and ``known`` is that of
    :func:`navirl_cli.irl.scene.scenes_of`.
    """
    masks, reach = None, None
    if chosen and steps is Steps.CONTACT:
        chosen, masks = _with_some(chosen, [steps_in_contact(one) for one in chosen], "contact", "a contact")
    elif chosen and steps is Steps.REACHABLE:
        reach = required_reach(chosen, reach_m)
        within = [steps_within_reach(one, reach.reach_m if reach else 0.0) for one in chosen]
        chosen, masks = _with_some(chosen, within, "reachable", "a contact or comes within reach of a person")
    evidence = evidence_of(chosen, known)
    return Selection(
        tuple(chosen), evidence if masks is None else evidence.only(masks), common_resolution_m(chosen), reach
    )


def whole(chosen: Sequence[Demonstration]) -> list[Demonstration]:
    """The demonstrations that are not cut off.

    Raises:
        DemonstrationError: All are.
    """
    kept = [one for one in chosen if not one.truncated]
    if chosen and not kept:
        raise DemonstrationError(
            f"expected demonstrations that are whole, found {len(chosen)} that are cut off; extract logs with whole "
            "trials, or learn from these with `truncated`, where a last cell may be no goal"
        )
    return kept


def _corrected(chosen: Sequence[Demonstration]) -> list[Demonstration]:
    """Those in which the person intervened."""
    unknown = [one.id for one in chosen if one.corrected is None]
    if unknown:
        raise DemonstrationError(
            f"`only_corrected`: expected demonstrations with a wrench, found {', '.join(unknown)} without one, so that "
            "an intervention is unknown; choose with `condition` and `cycle`"
        )
    if not any(one.corrected for one in chosen):
        raise DemonstrationError(
            "`only_corrected`: the person intervened in none of the demonstrations; learn from all of them"
        )
    return [one for one in chosen if one.corrected]


def _with_some(
    chosen: Sequence[Demonstration], masks: Sequence[BoolArray], name: str, what: str
) -> tuple[list[Demonstration], list[BoolArray]]:
    """The demonstrations with a step that counts, each with the (k - 1,) mask of these steps."""
    held = [(one, mask) for one, mask in zip(chosen, masks, strict=True) if mask.any()]
    if not held:
        raise DemonstrationError(f"`steps` {name}: none of the demonstrations holds {what}; learn from all steps")
    return [one for one, _ in held], [mask for _, mask in held]


def common_resolution_m(demonstrations: Sequence[Demonstration]) -> float:
    """Side of the cells, m, on which the meaning of a reward per step depends.

    Raises:
        DemonstrationError: The sides differ.
    """
    sides = sorted({one.grid.resolution_m for one in demonstrations})
    if len(sides) > 1:
        raise DemonstrationError(
            f"demonstrations: expected cells of one size, found {', '.join(f'{side:g}' for side in sides)} m: a reward "
            "per step depends on the step; extract them again with one `resolution`"
        )
    return sides[0]
