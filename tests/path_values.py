"""Values of metrics as tests ask for them."""

import numpy as np

from navirl_cli.evaluation.lines import Lines
from navirl_cli.evaluation.metric import Need, measure, missing_of
from navirl_cli.evaluation.metrics import METRICS
from navirl_cli.evaluation.motion import Drive


def line_values(line, nominal, people, radius, metrics=METRICS):
    """By name: all metrics that a line has."""
    lines = Lines(np.asarray(line)[None], nominal, people, radius)
    return measure(metrics, lines, set() if len(people) else {Need.PEOPLE})[0]


def drive_values(demonstration):
    """By name: the metrics that only a demonstration as it was driven has, and the reasons for those it lacks."""
    metrics = [metric for metric in METRICS if metric.drive is not None]
    nominal = demonstration.xy_m[[0, -1]]
    lines = Lines(demonstration.xy_m[None], nominal, demonstration.people_m, demonstration.robot_radius_m)
    return measure(metrics, lines, missing_of(demonstration), Drive(demonstration))
