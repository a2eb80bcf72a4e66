"""How a fit ends, and what that means."""

from enum import StrEnum


class Status(StrEnum):
    """How a fit ended."""

    CONVERGED = "converged"
    STOPPED_EARLY = "stopped early"
    ON_BOUND = "on bound"
    NOT_IDENTIFIED = "not identified"
    INFINITE = "infinite partition function"

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.CONVERGED: "no step raises the likelihood any more",
    Status.STOPPED_EARLY: (
        "the likelihood still rises, so that these numbers are not the optimum: it may lie at infinity; "
        "add demonstrations or a larger --l2, or go on with --init"
    ),
    Status.ON_BOUND: "a parameter ended on its bound, where it has no standard error; more demonstrations may free it",
    Status.NOT_IDENTIFIED: (
        "the demonstrations do not tell every parameter: the numbers marked so mean nothing by themselves; "
        "add demonstrations that tell them (people near the path, detours from the nominal path)"
    ),
    Status.INFINITE: (
        "the likelihood rises up to parameters under which endless detours outweigh the direct way, where there is no "
        "policy: the demonstrations wander more than this reward can explain; check that their paths end at the goal, "
        "or start from a more negative c0 with --init"
    ),
}
