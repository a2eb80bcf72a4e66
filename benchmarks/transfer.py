"""Hold planners that drive by exported costs against the policy of the same reward.

python benchmarks/transfer.py [--json] [--markdown] [--figure F] exports the published reward in four scenes, reads the
masks back by map_server's rules, and finds the paths of least cost on 8-connected cells by the formulas of NavFn and
SmacPlanner2D. People's bodies are obstacles, as to a lidar. Beside them stand the most probable path (navirl plan
--mode likely) and paths drawn from the policy. Offsets are measured across the line at the person, m, positive to the
left. Below them stand cases in which costs and reward differ. Exit code 1 where an offset misses its bar.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scenes import PUBLISHED

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.documents.tables import Column, Format, Table, written
from navirl_cli.export.folder import write_nav2
from navirl_cli.export.fragments import Distro
from navirl_cli.export.nav2 import Field, nav2_export
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.paths import Mode, Planner, measured
from navirl_cli.planning.problem import Problem, problem_on

RADIUS_M, CELL_M = 0.3, 0.1
#: Offsets of planner and plan agree up to this, m.
BAR_M = 0.15
#: Cost of a cell in which the robot would touch a person's body; no path is so expensive.
BODY = 1e6
#: Paths drawn from the policy.
SAMPLES = 500
#: A reward whose costs NavFn cannot hold: people repel six times as much.
STRONG = Reward((*PUBLISHED.theta[:2], 6 * PUBLISHED.theta[2], PUBLISHED.theta[3]))


def hall(length_m: float, width_m: float, people: list[tuple[float, float]], pillar: tuple[float, ...] = ()) -> Problem:
    """A hall around the line y = 0.05 from one end to the other; a pillar is (x0, x1, y0, y1), m."""
    rows, columns = round(width_m / CELL_M), round(length_m / CELL_M)
    occupied = np.zeros((rows, columns), dtype=bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    grid = Grid(occupied, CELL_M, (-length_m / 2, -width_m / 2))
    if pillar:
        x0, x1, y0, y1 = pillar
        row, column = np.indices(grid.shape)
        x, y = np.moveaxis(grid.centres_of(np.stack([column, row], axis=-1)), -1, 0)
        occupied[(x > x0) & (x < x1) & (y > y0) & (y < y1)] = True
    end = length_m / 2 - 1.05
    return problem_on(grid.inflated(RADIUS_M), (-end, 0.05), (end, 0.05), people, RADIUS_M)


SCENES = {
    "straight corridor": hall(10, 2.6, [(0.0, -0.15)]),
    "wide hall": hall(12, 8, [(0.0, -0.15)]),
    "two people": hall(12, 8, [(-1.5, -0.35), (1.5, 0.45)]),
    "person beside a pillar": hall(12, 8, [(0.0, 0.25)], (-0.6, 0.6, -2.6, -0.8)),
}
ON_LINE = "person on the line"
OTHERS = {ON_LINE: hall(12, 8, [(0.0, 0.05)])}


@dataclass(frozen=True)
class Case:
    """A scene, a planner, and what it is given."""

    scene: str
    planner: str
    #: Of the costs of people; None for the one that `navirl export` chooses.
    factor: float | None = None
    field: Field = Field.BOTH
    reward: Reward = PUBLISHED
    #: Whether people's bodies are obstacles.
    bodies: bool = True
    #: What differs from a usual export.
    why: str = ""


CASES = [Case(scene, planner, factor) for scene in SCENES for planner in ("navfn", "smac2d") for factor in (1.0, None)]
#: Cases without a bar: what is exported, or what the robot sees, differs from the reward.
OTHER_CASES = [
    Case(ON_LINE, "navfn", 1.0, bodies=False, why="the robot does not see people as obstacles"),
    Case(ON_LINE, "navfn", None, bodies=False, why="the same, with the factor of the export"),
    Case("wide hall", "navfn", reward=STRONG, why="a_p six times as large: costs are capped"),
    Case("wide hall", "smac2d", reward=STRONG, why="the same, with a multiplier"),
    Case("wide hall", "navfn", field=Field.PEOPLE, why="no cost off the line, as of the live mask"),
    Case("two people", "navfn", field=Field.PEOPLE, why="no cost off the line, as of the live mask"),
    Case("wide hall", "navfn", field=Field.LINE, why="no cost of people"),
]


@dataclass(frozen=True)
class Policy:
    """What a reward does in a scene."""

    likely_m: FloatArray
    drawn_m: list[FloatArray]
    visits: FloatArray


@cache
def policy_of(scene: str, reward: Reward) -> Policy:
    """The policy's paths; (k, 2) m each."""
    problem = (SCENES | OTHERS)[scene]
    planner = Planner(problem, reward)
    (likely,) = planner.plan(Mode.LIKELY)
    drawn = sample_paths(planner.policy, problem.scene.start, SAMPLES, np.random.default_rng(0))
    lines = [problem.scene.lattice.xy_m[drawn.path(number)] for number in range(SAMPLES)]
    return Policy(likely.line_m, lines, planner.visits)


def mask_in(folder: Path) -> FloatArray:
    """(rows, columns) costs of an exported mask as KeepoutFilter adds them; 0 where it is unknown."""
    _, size, _, data = (folder / "mask.pgm").read_bytes().split(b"\n", 3)
    columns, rows = map(int, size.split())
    pixels = np.frombuffer(data, dtype=np.uint8).reshape(rows, columns)[::-1].astype(float)
    return np.where(pixels > 100, 0.0, np.round(2.54 * pixels))


def driven(case: Case) -> tuple[float, FloatArray]:
    """The factor, and (k, 2) m: the path of least cost over the exported mask."""
    problem = (SCENES | OTHERS)[case.scene]
    given = {"distro": Distro.JAZZY, "problem": problem, "field": case.field}
    export = nav2_export(case.reward, CELL_M, RADIUS_M, case.planner, case.factor, **given)
    with TemporaryDirectory() as folder:
        write_nav2(Path(folder), export)
        mask = mask_in(Path(folder))
    lattice = problem.scene.lattice
    columns, rows = lattice.cells.T
    body = Planner(problem, case.reward).touching & case.bodies
    path = export.mask_model.planner.path(problem.scene, np.where(body, BODY, mask[rows, columns]))
    return export.mask_model.people_factor, lattice.xy_m[path]


def offset_at(line_m: FloatArray, x_m: float) -> float:
    """Mean y of a line, whose points are in cells of CELL_M, in the column of cells of x, m."""
    return float(line_m[np.abs(line_m[:, 0] - x_m) <= CELL_M / 2 + 1e-9, 1].mean())


def rows_of(case: Case) -> Iterator[tuple[str | float, ...]]:
    """One row for each person of the scene."""
    problem, policy = (SCENES | OTHERS)[case.scene], policy_of(case.scene, case.reward)
    factor, path = driven(case)
    passes = float(measured(problem, path).min_distance_m[0])
    for number, (x, y) in enumerate(problem.scene.people_m.tolist(), 1):
        likely, planner = offset_at(policy.likely_m, x), offset_at(path, x)
        offsets = np.array([offset_at(line, x) for line in policy.drawn_m])
        side = np.sign(likely - y)
        same = offsets[np.sign(offsets - y) == side]
        agree = abs(planner - likely) <= BAR_M and np.sign(planner - y) == side
        yield (
            *(case.scene, number, case.planner, factor, y, planner, likely, float(same.mean()), float(same.std())),
            *(100 * len(same) / SAMPLES, passes, "yes" if agree else "no", case.why),
        )


def table_of(cases: list[Case]) -> Table:
    """All rows of some cases."""
    columns = (
        *(Column("scene"), Column("person"), Column("planner"), Column("factor", decimals=2)),
        *(Column("person_m", "person m", decimals=2), Column("planner_m", "planner m", decimals=2)),
        *(Column("likely_m", "likely m", decimals=2), Column("policy_m", "policy m", decimals=2)),
        *(Column("policy_std_m", "std m", decimals=2), Column("same_side", "same side %", decimals=0)),
        *(Column("planner_passes_m", "planner passes m", decimals=2), Column("agrees"), Column("why")),
    )
    return Table(columns, tuple(row for case in cases for row in rows_of(case))).without_empty()


def draw(output: Path) -> None:
    """The scenes with the policy's visits and all paths."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    figure = Figure(figsize=(8.5, 5.6), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    lines = [
        ("NavFn, factor 1", "navfn", 1.0, "#D55E00", ":"),
        ("NavFn, as exported", "navfn", None, "#D55E00", "-"),
        ("SmacPlanner2D, as exported", "smac2d", None, "#0072B2", "--"),
    ]
    for axes, (name, problem) in zip(panels, SCENES.items(), strict=True):
        policy, grid = policy_of(name, PUBLISHED), problem.scene.lattice.grid
        shade = np.full(grid.shape, np.nan)
        columns, rows = problem.scene.lattice.cells.T
        shade[rows, columns] = np.sqrt(policy.visits)
        axes.set_facecolor("#BBBBBB")
        axes.imshow(shade, origin="lower", extent=grid.extent_m, cmap="Greens", vmin=0, vmax=1.2)
        axes.plot(*policy.likely_m.T, color="black", lw=1.2, label="most probable path")
        for label, planner, factor, colour, style in lines:
            _, path = driven(Case(name, planner, factor))
            axes.plot(*path.T, color=colour, ls=style, lw=1.5, label=label)
        for person in problem.scene.people_m:
            axes.add_patch(Circle(tuple(person), 0.25, facecolor="white", edgecolor="black", zorder=3))
        axes.set(title=name, xlim=(-4.5, 4.5), ylim=(-2, 2), xlabel="x, m", ylabel="y, m", aspect="equal")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(output, dpi=130)


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    usual, others = table_of(CASES), table_of(OTHER_CASES)
    if given.json:
        print(json.dumps({"agree": usual.records(), "others": others.records()}))
    else:
        how = Format.MARKDOWN if given.markdown else Format.TEXT
        print(written(replace(usual, note=f"Bar: {BAR_M} m from the most probable path, on its side."), how))
        print(f"\n{written(others, how)}")
    if given.figure is not None:
        draw(given.figure)
    return 0 if all(row["agrees"] == "yes" for row in usual.records()) else 1


if __name__ == "__main__":
    sys.exit(main())
