"""Demonstrations, scenes and axes for tests of figures."""

from functools import cache

import numpy as np

from navirl_cli.demos.demonstration import Condition, Contact, Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, scenes_of

PUBLISHED = Reward((-54.1, -0.87, -4.9, 1.68))


def room(rows=40, columns=80, origin_m=(-4.0, -2.0)):
    occupied = np.zeros((rows, columns), dtype=bool)
    occupied[:4] = occupied[-4:] = True
    occupied[:, :4] = occupied[:, -4:] = True
    return Grid(occupied, 0.1, origin_m)


def demonstration(condition=Condition.FORCE, cycle=None, aside_m=0.5, contacts=(), grid=None, people_m=((0.0, 0.1),)):
    """A path from (-3, 0) to (3, 0) along an arc, at 0.6 m/s."""
    t = np.linspace(0.0, 10.0, 101)
    x = -3.0 + 0.6 * t
    xy = np.stack([x, 0.05 + aside_m * np.cos(x * np.pi / 6)], axis=1)
    grid = room() if grid is None else grid
    columns = np.arange(10, 70)
    cells = np.stack([columns, np.full(60, 20)], axis=1)
    return Demonstration(
        id=f"{condition}-{cycle}-{aside_m}",
        participant="p01",
        condition=condition,
        corrected=True,
        cycle=cycle,
        start_ns=0,
        t_s=t,
        xy_m=xy,
        yaw_rad=np.zeros(101),
        force_n=None,
        contacts=tuple(Contact(start, end, 9.0, (0.0, 3.0)) for start, end in contacts),
        goal_m=(3.0, 0.05),
        people_m=np.array(people_m, dtype=float).reshape(-1, 2),
        robot_radius_m=0.3,
        grid=grid,
        cells=cells,
    )


def one_axes(width_in=COLUMN_IN):
    return new_figure(width_in)[1][0]


def scene(people_m=((0.0, 0.1),)) -> Scene:
    return scenes_of([demonstration(people_m=people_m)])[0]


@cache
def scene_and_visits():
    a_scene = scene()
    return a_scene, visits_in(a_scene)


def visits_in(a_scene):
    return policy_of(PUBLISHED, a_scene).visits_from(a_scene.start)
