"""The parameters of a reward in the conventions of the paper, of its public code, and of Nav2."""

from collections.abc import Iterator

import numpy as np

from navirl_cli.documents.tables import Column, Table
from navirl_cli.errors import RewardError
from navirl_cli.export.costs import CostModel, matched, navfn, smac2d
from navirl_cli.irl.reward import Reward

#: convention, quantity, value, unit, formula.
Row = tuple[str, str, float, str, str]
_UNSUITED = "The public code has the paper's terms only."


def conventions_table(reward: Reward, resolution_m: float, robot_radius_m: float) -> Table:
    """A row for each parameter in each convention that can hold it.

    Args:
        reward: The reward.
        resolution_m: Of the cells on which it was learnt, m.
        robot_radius_m: Of the robot for which the factor of Nav2's costs is found, m.
    """
    rows: list[Row] = [
        ("paper", one.name, value, one.unit or "1", one.meaning)
        for one, value in zip(reward.parameters, reward.theta, strict=True)
    ]
    notes = [f"h = {resolution_m:g} m is the side of a cell."]
    own = list(_public_code(reward, resolution_m))
    rows += own
    if not own:
        notes.append(_UNSUITED)
    try:
        rows += _nav2(reward, resolution_m, robot_radius_m)
    except RewardError as error:
        notes.append(f"Nav2: {error}")
    columns = (Column("convention"), Column("quantity"), Column("value", decimals=4), Column("unit"), Column("formula"))
    return Table(columns, tuple(rows), note=" ".join(notes))


def _public_code(reward: Reward, h_m: float) -> Iterator[Row]:
    """The paper's parameters for lengths in cells, with its weight of the deviation and a width of the Gaussian."""
    theta = {one.name: value for one, value in zip(reward.parameters, reward.theta, strict=True)}
    if set(theta) != {"c0", "a_g", "a_p", "sigma_p"}:
        return
    yield "public code", "path length", theta["c0"] * h_m, "1/cell", "c0 h"
    yield "public code", "deviation", theta["a_g"] * h_m**2 / 0.01, "0.01/cell^2", "a_g h^2 / 0.01"
    yield "public code", "person", theta["a_p"], "1", "a_p"
    width = 1 / (h_m * np.sqrt(2 * theta["sigma_p"]))
    yield "public code", "width", float(width), "cells", "1 / (h sqrt(2 sigma_p))"


def _nav2(reward: Reward, h_m: float, radius_m: float) -> list[Row]:
    """Amplitudes and widths of costs; those of the reward itself, and those that pass people as the policy does."""
    names = {one.name for one in reward.parameters}
    person = "a_p / (c0 h)" if "a_p" in names else "a_l / c0"
    sigma = "sigma_p" if "a_p" in names else "sigma_l"
    plain = {one.planner: CostModel(reward, one, h_m) for one in (navfn(), smac2d())}
    rows: list[Row] = [
        ("Nav2", "covariance", plain["navfn"].covariance_m2, "m^2", f"1 / (2 {sigma})"),
        ("Nav2 NavFn", "amplitude", plain["navfn"].amplitude, "cost", f"62.5 {person}"),
        ("Nav2 SmacPlanner2D", "amplitude", plain["smac2d"].amplitude, "cost", f"252 {person}, multiplier 1"),
    ]
    if "a_g" in names:
        line = plain["navfn"].off_the_line(np.array(1.0))
        rows.append(("Nav2 NavFn", "line", float(line), "cost/m^2", "62.5 a_g / (c0 h)"))
    for name, title in (("navfn", "Nav2 NavFn"), ("smac2d", "Nav2 SmacPlanner2D")):
        model = matched(name, reward, h_m, radius_m).model
        rows.append(
            (
                title,
                "factor",
                model.people_factor,
                "1",
                "passing distance nearest to the policy's, by costs of people alone",
            )
        )
        if name == "smac2d":
            rows.append((title, "multiplier", model.planner.multiplier, "1", "costs stay below 252"))
        rows.append((title, "scaled amplitude", model.amplitude, "cost", "factor x amplitude / multiplier"))
    return rows
