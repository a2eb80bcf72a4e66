"""Fits cycle by cycle, and how near a policy's paths come to the demonstrated ones."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.demonstration import Condition
from navirl_cli.errors import DemonstrationError, RewardError, SceneError
from navirl_cli.evaluation.compare import LEARNT, ON_GRID, compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import scenes_of
from navirl_cli.irl.solved import solved
from navirl_cli.reports.study import remarks
from navirl_cli.study import learning
from navirl_cli.study.learning import closeness, is_of_cycle, jobs_of, learn
from navirl_cli.study.pipeline import PUBLISHED_THETA, study_of
from navirl_cli.study.questionnaire import Answer
from navirl_cli.study.unseen import beside_obstacle, pooled_policy, two_people

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


def test_a_missing_cycle_is_no_problem():
    ann, bob, _ = (learn(job) for job in jobs_of([*FIRSTS["ann"], *SECONDS["bob"]], 50, 0))
    assert (ann.second, ann.first.near, ann.problems) == (None, None, ())
    assert bob.first is None
    assert bob.second.fit.initial == Reward.named({})


def test_what_cannot_be_fitted_is_told_and_the_rest_stands():
    through = replace(FIRSTS["ann"][0], cells=np.concatenate([FIRSTS["ann"][0].cells, [[36, 10], [37, 10]]]))
    ann = learn(jobs_of([through, *SECONDS["ann"]], 50, 0)[0])
    assert ann.first is None
    assert ann.second is not None
    assert len(ann.problems) == 1
    assert ann.problems[0].startswith("ann, cycle 1: demonstration ann/10: its path passes the goal's cell")


def test_a_fit_stands_though_its_paths_cannot_be_compared(monkeypatch):
    def fails(*_):
        raise RewardError("no policy in this scene")

    monkeypatch.setattr(learning, "closeness", fails)
    ann = learn(jobs_of(ALL, 50, 0)[0])
    assert ann.first.near is None
    assert ann.second.fit.initial == ann.first.fit.reward
    assert ann.problems == ("ann, cycle 1: no policy in this scene", "ann, cycle 2: no policy in this scene")


def test_published_parameters_are_compared_with_published_paths_only():
    assert study_of(ALL, {}, 10, 0, published={"ann"}).published_log_likelihood is None
    both = study_of(ALL, {}, 10, 0, published={"ann", "bob"})
    seconds = [*SECONDS["ann"], *SECONDS["bob"]]
    expected = log_likelihood(evidence_of(seconds), Reward.named(PUBLISHED_THETA))
    assert both.published_log_likelihood == pytest.approx(expected)


def test_scenes_without_people_do_not_spoil_the_distance():
    alone = [replace(one, people_m=np.zeros((0, 2))) for one in SECONDS["bob"]]
    near = closeness(TRUTH, [*SECONDS["ann"], *alone], 100, np.random.default_rng(0))
    only = closeness(TRUTH, SECONDS["ann"], 100, np.random.default_rng(0))
    assert near.learnt.expected("min_distance_m") == pytest.approx(only.learnt.expected("min_distance_m"))
    assert np.isfinite(near.learnt.expected("length_m"))


def test_what_a_reader_should_know():
    assert remarks(ALL, []) == []
    other = replace(ALL[0], robot_radius_m=0.4, grid=make.open_grid(50, 21), cycle=3)
    unsaid, aside = replace(ALL[0], cycle=None), replace(ALL[0], set="slalom")
    lines = remarks([*ALL, other, unsaid, aside], [Answer("ann", "q", "", 1), Answer("zoe", "q", "", 1)])
    assert [line.split(":")[0] for line in lines] == [
        "trials are on 2 maps",
        "robots of radii 0.25, 0.4 m are combined",
        "cycle 3",
        "1 trial of the condition force has neither cycle nor set",
        "trials of the condition force in the sets slalom are not fitted, although they have a cycle",
        "the questionnaire holds answers of participants without a log",
    ]
    assert lines[-1].endswith(" zoe")


def test_expected_properties_are_those_of_many_paths():
    near = closeness(TRUTH, SECONDS["ann"], 4000, np.random.default_rng(0))
    result = compare(SECONDS["ann"], {"t": TRUTH}, Precision(4000), np.random.default_rng(1))
    rows = {row.path_type: row for row in result.groups}
    for name in ("length_m", "min_distance_m", "area_m2"):
        assert near.demonstrated.mean[name] == rows[ON_GRID].mean[name]
        assert near.demonstrated.std[name] == rows[ON_GRID].std[name]
        error = np.hypot(rows[LEARNT].error[name], near.learnt.monte_carlo_error(name))
        assert abs(near.learnt.expected(name) - rows[LEARNT].mean[name]) < 4 * error, name
        assert near.learnt.std[name] == pytest.approx(rows[LEARNT].std[name], rel=0.06), name
    assert near.learnt.monte_carlo_error("length_m") == 0.0
    assert near.learnt.monte_carlo_error("area_m2") == pytest.approx(
        near.learnt.std["area_m2"] / np.sqrt(4000), rel=1e-3
    )


def test_scenes_count_by_their_demonstrations_and_their_difference_is_spread():
    # One scene shown twice, another once: of one group, as cycles say.
    mixed = [*SECONDS["ann"], replace(FIRSTS["ann"][0], cycle=2)]
    near = closeness(TRUTH, mixed, 4000, np.random.default_rng(0))
    one, other = (closeness(TRUTH, part, 4000, np.random.default_rng(0)) for part in (mixed[:2], mixed[2:]))
    lengths = np.array([one.learnt.expected("length_m"), other.learnt.expected("length_m")])
    share = np.array([2 / 3, 1 / 3])
    assert near.learnt.expected("length_m") == pytest.approx(share @ lengths)
    within = share @ np.array([one.learnt.std["length_m"], other.learnt.std["length_m"]]) ** 2
    between = share @ (lengths - share @ lengths) ** 2
    assert near.learnt.std["length_m"] == pytest.approx(np.sqrt(within + between), rel=0.05)


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
    with pytest.raises(DemonstrationError, match=r"found 2 trials of it \(cycle 1, no set\); describe the trials"):
        study_of(FIRSTS["ann"], {}, 10, 0)
    with pytest.raises(DemonstrationError, match=r"found 8 trials of it \(no cycle, no set\)"):
        study_of([replace(one, cycle=None) for one in ALL], {}, 10, 0)
    with pytest.raises(DemonstrationError, match=r"found 8 trials of it \(cycle 1, main; cycle 2, main\)"):
        study_of([replace(one, set="main") for one in ALL], {}, 10, 0)
    with pytest.raises(DemonstrationError, match=r"found no trial of that condition"):
        study_of([replace(one, condition=Condition.JOYSTICK) for one in ALL], {}, 10, 0)


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


def test_the_pooled_reward_is_solved_in_the_study_s_scene_and_in_unseen_ones():
    study = study_of(ALL, {}, 10, 0)
    found = pooled_policy(study)
    assert [title for title, _ in found.seen] == ["scene of the study"]
    scene = scenes_of([study.seconds[0]])[0]
    expected = solved(study.pooled.second.fit.reward, scene)
    np.testing.assert_array_equal(found.seen[0][1].visits, expected.visits)
    assert [len(one.scene.people_m) for _, one in found.unseen] == [2, 1]
    assert found.notes == ()


def test_an_unseen_scene_without_room_is_noted():
    study = study_of(ALL, {}, 10, 0)
    wide = tuple(replace(one, robot_radius_m=2.0) for one in study.demonstrations)
    found = pooled_policy(replace(study, demonstrations=wide))
    assert [title for title, _ in found.unseen] == ["two people"]
    (note,) = found.notes
    assert note.startswith("no unseen scene with person beside a large obstacle: ")


def test_without_a_pooled_reward_there_is_no_pooled_policy():
    study = study_of(ALL, {}, 10, 0)
    found = pooled_policy(replace(study, pooled=replace(study.pooled, second=None)))
    assert (found.seen, found.unseen, found.notes) == ((), (), ())


def test_a_hallway_without_room_has_no_such_scene():
    along_a_wall = make.scene_on(make.open_grid(40, 14), [2, 0], [37, 0])
    beside_obstacle(along_a_wall, 0.3)
    with pytest.raises(SceneError, match="no free path"):
        beside_obstacle(along_a_wall, 1.0)
