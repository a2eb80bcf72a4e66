"""How a fit ended and what that means."""

from enum import StrEnum


class Status(StrEnum):
    """How a fit ended."""

    CONVERGED = "converged"
    OPEN_INTERVAL = "open interval"
    STOPPED_EARLY = "stopped early"
    ON_BOUND = "on bound"
    NOT_IDENTIFIED = "not identified"
    INFINITE = "infinite partition function"

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.CONVERGED: "no step increases the likelihood further",
    Status.OPEN_INTERVAL: (
        "converged, but the demonstrations set no end to a parameter on one side: read its interval, not its value; "
        "add demonstrations, or take an earlier reward as `prior`"
    ),
    Status.STOPPED_EARLY: (
        "the likelihood still increases: these values are not the optimum, which may lie at infinity; "
        "add demonstrations, choose a larger `l2`, or continue with `init`"
    ),
    Status.ON_BOUND: "a parameter ended on its bound, where it has no standard error; more demonstrations may free it",
    Status.NOT_IDENTIFIED: (
        "the demonstrations do not identify every parameter: the values marked so have no meaning by themselves; "
        "add demonstrations that identify them (people near the path, detours from the nominal path)"
    ),
    Status.INFINITE: (
        "the likelihood increases up to parameters at which endless detours outweigh the direct path and no policy "
        "exists: the demonstrated paths wander more than this reward can explain; check that they end at the goal, "
        "or start from a more negative c0 with `init`"
    ),
}
