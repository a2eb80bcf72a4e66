"""Fits cycle by cycle, and how near a policy's paths come to the demonstrated ones."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.demonstration import Condition
from navirl_cli.errors import DemonstrationError, SceneError
from navirl_cli.evaluation.compare import LEARNT, ON_GRID, compare
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward
from navirl_cli.study.learning import closeness, is_of_cycle, jobs_of, learn
from navirl_cli.study.pipeline import study_of
from navirl_cli.study.unseen import beside_obstacle, two_people

TRUTH = Reward((-45.0, -0.8, -4.0, 2.0))
SCENE = make.scene_on(make.open_grid(40, 21), [2, 10], [37, 10], [[2.05, 1.05]])
OTHER = make.scene_on(make.open_grid(40, 21), [2, 8], [37, 10], [[2.05, 1.05]])


def demonstrated(scene, participant, cycle, count=2, seed=0, **fields):
    drawn = make.drawn(scene, TRUTH, count, seed)
    return [
        replace(one, participant=participant, id=f"{participant}/{cycle}{i}", cycle=cycle, **fields)
        for i, one in enumerate(drawn)
    ]


FIRSTS = {name: demonstrated(OTHER, name, 1, seed=i) for i, name in enumerate(("ann", "bob"))}
SECONDS = {name: demonstrated(SCENE, name, 2, seed=10 + i) for i, name in enumerate(("ann", "bob"))}
ALL = [one for name in ("ann", "bob") for one in (*FIRSTS[name], *SECONDS[name])]


def test_jobs_are_the_participants_and_all():
    extra = [
        replace(SECONDS["ann"][0], id="ann/j", condition=Condition.JOYSTICK),
        replace(SECONDS["ann"][0], id="ann/c", set="obstacle course"),
        replace(SECONDS["ann"][0], id="ann/3", cycle=3),
    ]
    assert [is_of_cycle(one, 2) for one in extra] == [False, False, False]
    ann, bob, everyone = jobs_of([*ALL, *extra], 100, 0)
    assert (ann.participant, bob.participant, everyone.participant) == ("ann", "bob", None)
    assert [one.id for one in ann.demonstrations] == ["ann/10", "ann/11", "ann/20", "ann/21"]
    assert [one.id for one in everyone.demonstrations] == ["ann/20", "ann/21", "bob/20", "bob/21"]
    assert len({job.seed for job in (ann, bob, everyone)}) == 3


def test_the_second_cycle_starts_where_the_first_ended():
    ann = learn(jobs_of(ALL, 50, 0)[0])
    first = fit(evidence_of(FIRSTS["ann"]), Reward.named({}))
    second = fit(evidence_of(SECONDS["ann"]), first.reward)
    assert ann.first.fit.initial == Reward.named({})
    assert ann.second.fit.initial == ann.first.fit.reward == first.reward
    assert ann.second.fit.reward == second.reward
    everyone = learn(jobs_of(ALL, 50, 0)[-1])
    assert everyone.first is None
    assert everyone.second.fit.demonstrations == 4
    assert everyone.second.fit.initial == Reward.named({})


def test_a_missing_cycle_is_no_trouble():
    ann, bob, _ = (learn(job) for job in jobs_of([*FIRSTS["ann"], *SECONDS["bob"]], 50, 0))
    assert (ann.second, ann.first.near, ann.trouble) == (None, None, ())
    assert bob.first is None
    assert bob.second.fit.initial == Reward.named({})


def test_what_cannot_be_fitted_is_told_and_the_rest_stands():
    through = replace(FIRSTS["ann"][0], cells=np.concatenate([FIRSTS["ann"][0].cells, [[36, 10], [37, 10]]]))
    ann = learn(jobs_of([through, *SECONDS["ann"]], 50, 0)[0])
    assert ann.first is None
    assert ann.second is not None
    assert len(ann.trouble) == 1
    assert ann.trouble[0].startswith("ann, cycle 1: demonstration ann/10: its path passes the goal's cell")


def test_expected_properties_are_those_of_many_paths():
    near = closeness(TRUTH, SECONDS["ann"], 4000, np.random.default_rng(0))
    result = compare(SECONDS["ann"], TRUTH, 4000, np.random.default_rng(1))
    drawn = {row.kind: row for row in result.groups}
    assert near.demonstrated == drawn[ON_GRID].mean
    assert near.demonstrated_spread == drawn[ON_GRID].std
    for name in ("length_m", "min_distance_m", "area_m2"):
        mean, spread = getattr(drawn[LEARNT].mean, name), getattr(drawn[LEARNT].std, name)
        error = spread / np.sqrt(8000) + getattr(near.error, name)
        assert abs(getattr(near.expected, name) - mean) < 4 * error, name
        assert getattr(near.spread, name) == pytest.approx(spread, rel=0.06), name
    assert near.error.length_m == 0.0
    assert near.error.area_m2 == pytest.approx(near.spread.area_m2 / np.sqrt(4000))


def test_scenes_count_by_their_demonstrations_and_their_difference_is_spread():
    mixed = [*SECONDS["ann"], FIRSTS["ann"][0]]
    near = closeness(TRUTH, mixed, 200, np.random.default_rng(0))
    one, other = (closeness(TRUTH, part, 200, np.random.default_rng(0)) for part in (mixed[:2], mixed[2:]))
    lengths = np.array([one.expected.length_m, other.expected.length_m])
    share = np.array([2 / 3, 1 / 3])
    assert near.expected.length_m == pytest.approx(share @ lengths)
    within = share @ np.array([one.spread.length_m, other.spread.length_m]) ** 2
    between = share @ (lengths - share @ lengths) ** 2
    assert near.spread.length_m == pytest.approx(np.sqrt(within + between))


def test_numbers_do_not_depend_on_where_they_are_computed():
    with ThreadPoolExecutor(2) as pool:
        here = study_of(ALL, {}, 50, 3, executor=pool)
    there = study_of(ALL, {}, 50, 3)
    for one, other in zip((*here.participants, here.pooled), (*there.participants, there.pooled), strict=True):
        assert one.second.fit.reward.theta == other.second.fit.reward.theta
        assert one.second.near == other.second.near
    assert here.claims == there.claims
    assert here.published_log_likelihood is None


def test_progress_names_whose_fit_is_done():
    seen = []
    study_of(ALL, {}, 10, 0, progress=lambda done, whose: seen.append((done, whose)))
    assert seen == [(1, "ann"), (2, "bob"), (3, "all")]


def test_a_study_needs_second_cycles():
    with pytest.raises(DemonstrationError, match=r"in cycle 2, found cycles \[1\] only; say which trial is what"):
        study_of(FIRSTS["ann"], {}, 10, 0)
    with pytest.raises(DemonstrationError, match=r"in cycle 2, found no cycles"):
        study_of([replace(one, cycle=None) for one in ALL], {}, 10, 0)


def test_two_people_stand_on_both_sides_of_the_way():
    scene = two_people(SCENE)
    assert (scene.start, scene.goal) == (SCENE.start, SCENE.goal)
    start, goal = SCENE.lattice.xy_m[[SCENE.start, SCENE.goal]]
    along = (scene.people_m - start) @ (goal - start) / np.hypot(*(goal - start)) ** 2
    assert along == pytest.approx([0.35, 0.65])
    assert scene.people_m[:, 1] - start[1] == pytest.approx([0.4, -0.4])


def test_the_obstacle_is_grown_and_leaves_a_way():
    scene = beside_obstacle(SCENE, 0.3)
    blocked = scene.lattice.grid.occupied & ~SCENE.lattice.grid.occupied
    rows, columns = np.nonzero(blocked)
    centres = SCENE.lattice.grid.centres_of(np.stack([columns, rows], axis=1))
    start, goal = SCENE.lattice.xy_m[[SCENE.start, SCENE.goal]]
    middle = (start + goal) / 2
    # The obstacle begins 0.8 m to the left; grown by the robot's radius, cells nearer than 0.5 m stay free.
    assert centres[:, 1].min() - middle[1] > 0.4
    assert np.abs(centres[:, 0] - middle[0]).max() < 0.75 + 0.3 + 0.05
    assert scene.people_m[0] == pytest.approx(middle - (0, 0.5))


def test_a_hallway_without_room_has_no_such_scene():
    along_a_wall = make.scene_on(make.open_grid(40, 14), [2, 0], [37, 0])
    beside_obstacle(along_a_wall, 0.3)
    with pytest.raises(SceneError, match="no free way"):
        beside_obstacle(along_a_wall, 1.0)
