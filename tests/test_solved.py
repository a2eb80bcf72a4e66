"""A scene solved under a reward, as figures take it."""

import pickle

import factories as make
import numpy as np

from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.solved import solved

REWARD = Reward((-32.0, -4.0, -4.0, 3.0))


def test_visits_are_those_of_the_policy_from_the_scenes_start():
    scene = make.scene_on(make.open_grid(8, 5), [0, 2], [7, 2], [[0.4, 0.3]])
    start = np.zeros(scene.lattice.size)
    start[scene.start] = 1.0
    found = solved(REWARD, scene)
    assert found.scene is scene
    np.testing.assert_array_equal(found.visits, policy_of(REWARD, scene).visits(start))
    np.testing.assert_array_equal(found.reward_by_cell, REWARD.by_cell(scene))


def test_it_is_passed_between_processes():
    found = solved(REWARD, make.scene_on(make.open_grid(8, 5), [0, 2], [7, 2], [[0.4, 0.3]]))
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.visits, found.visits)
    np.testing.assert_array_equal(again.scene.people_m, found.scene.people_m)
