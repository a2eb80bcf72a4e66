"""What the stages of a log find out about it, as values. Each kind of finding has its words here, in one place."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, StrEnum

from navirl_cli.errors import Number


class Severity(StrEnum):
    """What a finding means for the user."""

    #: Worth showing by ``inspect`` only.
    INFO = "info"
    #: Unusual: something was corrected, assumed or sorted.
    NOTE = "note"
    #: Something of the log is lost to the extraction.
    LOSS = "loss"


_INFO, _NOTE, _LOSS = Severity.INFO, Severity.NOTE, Severity.LOSS


class Kind(Enum):
    """The kinds of findings: severity, and the sentence in which a finding's fields are filled in."""

    # topics
    OTHER_ROBOT = (_NOTE, "{about} is left out: it is not in the namespace of odometry, wrench and map")
    SEVERAL_TYPES = (_NOTE, "{about} holds messages of several types: {detail}")
    # time
    SIMULATED = (
        _INFO,
        (
            "header stamps are simulated time, or time since the computer's start: {about} begins at {size:.2f} s; "
            "extract goes by the stamps, unless `time` log"
        ),
    )
    RECORDER_OFF = (
        _INFO,
        (
            "header stamps of {about} differ by {size:+.3f} s from the recorder's clock; extract goes by the stamps, "
            "unless `time` log"
        ),
    )
    NO_STAMPS = (_NOTE, "no message on {about} has a stamp; times of receipt are used")
    UNSTAMPED = (
        _NOTE,
        (
            "{count} message{count:|s} on {about} {count:is|are} stamped 0; {count:its time|their times} of receipt "
            "{count:is|are} used"
        ),
    )
    WILD_STAMPS = (
        _NOTE,
        (
            "{count} message{count:|s} on {about} {count:has a stamp|have stamps} more than {size:g} s off "
            "{count:its|their} clock; "
            "{count:its time|their times} of receipt {count:is|are} used"
        ),
    )
    CLOCK_STEP = (
        _NOTE,
        "{about} jumps by {size:+.2f} s {at_s:.1f} s after the start; later times were shifted to continue",
    )
    CLOCK_STEPS = (
        _NOTE,
        (
            "{about} jumps {count} time{count:|s}, by up to {size:+.2f} s, first {at_s:.1f} s after the start; "
            "later times were shifted to continue"
        ),
    )
    LATER_RECEIPTS = (
        _NOTE,
        "messages on {about} are received {size:+.2f} s later than before from {at_s:.1f} s on; their stamps are used",
    )
    PAUSE = (
        _NOTE,
        (
            "{about} pause for {size:.2f} s {at_s:.1f} s after the start, while the robot stands still: the recording "
            "paused, or a clock jumped"
        ),
    )
    PAUSES = (
        _INFO,
        (
            "{about} pause {count} time{count:|s} while the robot stands still, by up to {size:.2f} s, "
            "first at {at_s:.1f} s"
        ),
    )
    NO_RECEIPTS = (_NOTE, "{about} gives no usable times of receipt; stamps and the order in the file are used")
    WRONG_RECEIPTS = (
        _NOTE,
        (
            "{about} gives {count} time{count:|s} of receipt that cannot be true, such as {detail}; stamps and the "
            "order in the file are used in {count:its|their} place"
        ),
    )
    STAMPED_AHEAD = (
        _NOTE,
        (
            "{about} is stamped {size:.2f} s ahead, as AMCL does by its transform_tolerance; it is used from its "
            "receipt on"
        ),
    )
    OTHER_CLOCK = (
        _NOTE,
        "{about} is stamped by another clock than {detail}: {size:+.3f} s by the times of receipt; aligned",
    )
    DRIFTING_CLOCK = (
        _NOTE,
        (
            "{about} is stamped by another clock than {detail}: {size:+.3f} s by the times of receipt, changing by "
            "{change:+.2f} s until the end; aligned"
        ),
    )
    OUT_OF_ORDER = (
        _NOTE,
        "{count} message{count:|s} on {about} {count:was|were} received out of order; sorted by time",
    )
    REPEATED = (_NOTE, "{count} message{count:|s} on {about} repeat{count:s|} the time of another; the first counts")
    # space
    IGNORED_TRANSFORMS = (_NOTE, "transforms {about}: {detail}; ignored")
    RESCALED = (_NOTE, "{about}: {detail}")
    STATIC_CHANGES = (
        _NOTE,
        "the static transform {about} is sent again with another value: {detail}; each counts from when it was sent",
    )
    SEVERAL_PARENTS = (_NOTE, "tf gives {about!r} several parents in turn: {detail}")
    UNCOVERED_POSES = (_NOTE, "{count} pose{count:|s} {count:lies|lie} outside the time that tf covers; left out")
    POSES_IN_GAPS = (
        _LOSS,
        "{count} pose{count:|s} {count:lies|lie} in {count:a gap|gaps} of tf longer than {size:g} s; left out",
    )
    POSES_BEGIN_LATE = (_INFO, "poses begin {size:.1f} s after the other measurements; a trial from before is cut off")
    POSES_END_EARLY = (
        _INFO,
        "poses end {size:.1f} s before the other measurements; a trial that has not arrived by then is cut off",
    )
    POSES_FROM_TF = (_NOTE, "no odometry: poses are those of {about!r} in tf")
    BASE_ASSUMED = (
        _NOTE,
        "no message names the robot's own frame, and tf knows none of {detail}; {about} is assumed",
    )
    NO_WRENCH_FRAME = (
        _NOTE,
        "{about} names no frame; {detail!r} is assumed; name another with `wrench_frame`",
    )
    WRENCH_MOVES = (
        _NOTE,
        "the wrench's frame {about!r} moves on {detail!r}; the handle's weight may not cancel out",
    )
    UNUSABLE_MAPS = (_LOSS, "{count} map{count:|s} on {about} cannot be used ({detail}); left out")
    EMPTY_ORIGIN = (
        _NOTE,
        "{count} map{count:|s} on {about} {count:has|have} an origin with a quaternion of zeros; taken as not rotated",
    )
    OUTSIDE_UPDATES = (
        _LOSS,
        "{count} update{count:|s} on {about} {count:does|do} not lie within the map before {count:it|them}; left out",
    )
    MAP_CHANGES = (_NOTE, "{about} changes: {detail}; each trial has the map in force at its end")
    # measurements
    IMPLAUSIBLE = (
        _LOSS,
        "{count} message{count:|s} on {about} {count:holds|hold} implausible values ({detail}); left out",
    )
    OTHER_FRAME = (
        _LOSS,
        "{count} message{count:|s} on {about} {count:is|are} not in frame {detail!r}, as the others are; left out",
    )
    UNPLACED_MESSAGES = (_LOSS, "{count} message{count:|s} on {about} left out: {detail}")
    NOT_PEOPLE = (
        _NOTE,
        (
            "{count} {count:entry|entries} of {about} {count:is|are} not {count:a person|people} and "
            "{count:is|are} ignored: {detail}"
        ),
    )
    NO_LABELS = (_NOTE, "no entry of {about} has a class; {count:the only one counts as a person|all count as people}")
    GOALS_NOT_REACHED = (
        _LOSS,
        (
            "{count} goal{count:|s} of {about} {count:was|were} not reached, and the action does not say "
            "where {count:it is|they are}; left out"
        ),
    )
    GOALS_BY_ACTION = (
        _NOTE,
        "{about} does not say where goals are; each is placed where the robot was when it was reached",
    )
    MISSING_AXIS = (
        _NOTE,
        (
            "force {detail} of {about} is never finite, so it is missing; the sensor's mounting keeps it out of the "
            "robot's plane, and the other axes suffice"
        ),
    )
    UNPLACED_ENTRIES = (_LOSS, "{count} place{count:|s} on {about} left out: {detail}")

    def __init__(self, severity: Severity, sentence: str) -> None:
        self.severity = severity
        self.sentence = sentence


@dataclass(frozen=True)
class Finding:
    """One thing that a stage found out; ``str`` of it is its sentence."""

    kind: Kind
    #: The topic, clock or frame that it is about.
    about: str
    #: Messages, poses or transforms concerned.
    count: int = 0
    #: In the unit that the kind's sentence names.
    size: float = 0.0
    #: When, s after the recording's first message; None for findings about the whole.
    at_s: float | None = None
    #: Change of the size until the end, same unit.
    change: float = 0.0
    #: Further words: another topic or frame, or a reason.
    detail: str = ""

    def __str__(self) -> str:
        return self.kind.sentence.format(
            about=self.about,
            count=Number(self.count),
            size=self.size,
            at_s=self.at_s,
            change=self.change,
            detail=self.detail,
        )


Findings = tuple[Finding, ...]


def texts(log: str, findings: Iterable[Finding], severity: Severity) -> tuple[str, ...]:
    """The sentences of findings of one severity, each once, as ``log: sentence``."""
    return tuple(dict.fromkeys(f"{log}: {one}" for one in findings if one.kind.severity is severity))
