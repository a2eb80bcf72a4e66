"""Trials that are cut off: poses are missing at their beginning or end, so that they start or end elsewhere."""

import numpy as np

from navirl_cli.demos.trials import STANDING_M_S, Split, Trial, speeds_m_s
from navirl_cli.logs.recording import Recording

#: Longer gaps in the poses make a trial unknown, s.
POSE_GAP_S = 1.0


def truncation_of(recording: Recording, trial: Trial, split: Split) -> str:
    """Why a trial is cut off, in words; "" for one that is whole.

    A trial is whole at its beginning where poses are known from its goal's announcement on (the first trial without a
    goal: from the log's first measurement on), or where the robot still stands when they begin. It is whole at its end
    where the robot arrived, where the session record gives its end, or where poses are known until the next goal or the
    log's end and the robot does not drive there. Gaps inside are refused by
    :func:`navirl_cli.demos.checks.check_gaps`.

    Args:
        recording: The trial's.
        trial: A stretch of its poses.
        split: How trials were split; a log that the user takes as one trial may end while the robot drives.
    """
    t_ns = recording.t_ns
    moving = speeds_m_s(t_ns, recording.xy_m) > STANDING_M_S
    begins_ns = recording.span_ns[0] if trial.first == 0 and trial.from_ns is None else trial.from_ns
    late_s = 0.0 if begins_ns is None else (int(t_ns[trial.first]) - begins_ns) / 1e9
    if begins_ns is not None and late_s > POSE_GAP_S and moving[trial.first]:
        return (
            f"poses are missing in its first {late_s:.1f} s{missing_tf(recording, begins_ns, int(t_ns[trial.first]))}"
        )
    if trial.goal_m is not None and trial.arrived:
        return ""
    if trial.goal_m is None and not (trial.stop == len(t_ns) and moving[-1]):
        return ""
    return _missing_at_end(recording, trial) or (
        "the log ends while the robot drives"
        if split is not Split.NONE and not trial.declared and trial.stop == len(t_ns) and moving[-1]
        else ""
    )


def missing_tf(recording: Recording, since_ns: int, until_ns: int) -> str:
    """Whether it is tf that is missing between two times, in words; "" where there is no odometry either."""
    inside = (recording.unplaced_ns > since_ns) & (recording.unplaced_ns < until_ns)
    return " (tf does not place the odometry there)" if inside.any() else ""


def unseen_goals(recording: Recording) -> str:
    """Goals that were announced after the last pose, so that nothing is known of their trials, in words; "" without."""
    late = int((recording.goal_t_ns > recording.t_ns[-1] + round(POSE_GAP_S * 1e9)).sum())
    if not late:
        return ""
    goals = "a goal was" if late == 1 else f"{late} goals were"
    return (
        f"{goals} announced after the last pose, {(recording.t_ns[-1] - recording.span_ns[0]) / 1e9:.1f} s into the log"
    )


def _missing_at_end(recording: Recording, trial: Trial) -> str:
    """Where poses are missing from the end of a trial that did not arrive until the next goal or the log's end."""
    t_ns = recording.t_ns
    last = (len(t_ns) if trial.border is None else trial.border) - 1
    ends_ns = recording.span_ns[1] if trial.until_ns is None else trial.until_ns
    times = np.append(t_ns[trial.stop - 1 : last + 1], max(ends_ns, int(t_ns[last])))
    row = int(np.diff(times).argmax())
    since, until = int(times[row]), int(times[row + 1])
    if until - since <= POSE_GAP_S * 1e9:
        return ""
    gone = "before it arrived" if row < len(times) - 2 else "until the log's end" if trial.until_ns is None else ""
    gone = gone or ("until its declared end" if trial.declared else "until the next goal")
    return f"poses are missing for {(until - since) / 1e9:.1f} s {gone}{missing_tf(recording, since, until)}"
