"""Demonstrated, learnt and baseline paths side by side."""

import re
from itertools import pairwise

import factories as make
import numpy as np
import oracles
import pytest
import shapely
from executors import Here
from path_values import line_values
from scipy import stats

from navirl_cli.artefacts.metrics import metrics_document
from navirl_cli.demos.demonstration import Condition
from navirl_cli.documents.tables import Format
from navirl_cli.evaluation.compare import (
    AVOIDANCE,
    DRIVEN,
    LEARNT,
    NOMINAL,
    ON_GRID,
    PATH_TYPES,
    PERSON_RADIUS_M,
    compare,
)
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import group_of
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.metrics import BY_NAME, METRICS, PAPER_METRICS
from navirl_cli.evaluation.ranks import Ranking
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths, sampled_lines_m
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import scenes_of
from navirl_cli.parallel import Local
from navirl_cli.reports.evaluation import evaluation_text

GRID = make.open_grid(40, 21)
PERSON = np.array([[2.03, 0.98]])
ROW = 10
REWARD = Reward((-60.0, -0.5, -6.0, 2.0))
STRAIGHT = [[c, ROW] for c in range(1, 39)]
# Round the person at a distance of 7 cells.
ROUND = [
    [1, 10], *[[c, 10 - (c - 1)] for c in range(2, 9)], *[[c, 3] for c in range(9, 32)],
    *[[c, 3 + (c - 31)] for c in range(32, 39)],
]  # fmt: skip


def trial(cells, number, condition=Condition.FORCE, cycle=2, people=PERSON, **fields):
    return make.demonstration(GRID, cells, people, number=number, condition=condition, cycle=cycle, **fields)


TRIALS = [trial(STRAIGHT, 1), trial(ROUND, 2), trial(ROUND, 3, Condition.JOYSTICK, None)]


def run(trials=TRIALS, reward=None, samples=10, seed=0, **words):
    rewards = {} if reward is None else reward if isinstance(reward, dict) else {"r": reward}
    words = {"metrics": METRICS, **words}
    return compare(trials, rewards, Precision(samples), np.random.default_rng(seed), **words)


def of(comparison, group, path_type):
    (found,) = [one for one in comparison.groups if (one.group, one.path_type) == (group, path_type)]
    return found


def test_groups_are_conditions_and_cycles():
    assert [group_of(one) for one in TRIALS] == ["force, cycle 2", "force, cycle 2", "joystick"]


def test_mean_and_spread_of_what_was_driven():
    group = of(run(), "force, cycle 2", DRIVEN)
    lengths = [oracles.length_by_steps(one.xy_m) for one in TRIALS[:2]]
    assert lengths[0] == pytest.approx(3.7)
    assert group.count == 2
    assert group.mean["length_m"] == pytest.approx(np.mean(lengths))
    assert group.std["length_m"] == pytest.approx(abs(lengths[1] - lengths[0]) / np.sqrt(2))  # n - 1
    near = [oracles.distance_by_sampling(one.xy_m, PERSON, 2000) - 0.25 for one in TRIALS[:2]]
    assert group.mean["min_distance_m"] == pytest.approx(np.mean(near), abs=1e-4)
    # The detour is a trapezoid of sides 3.7 and 2.3 and height 0.7; the straight one has no area.
    assert group.mean["area_m2"] == pytest.approx((3.7 + 2.3) / 2 * 0.7 / 2)


def test_one_path_has_no_spread():
    group = of(run(), "joystick", DRIVEN)
    assert group.count == 1
    assert np.isnan(group.std["length_m"])


def test_what_was_driven_is_listed_by_demonstration():
    comparison = run()
    assert [(row.id, row.participant, row.group) for row in comparison.rows] == [
        ("p1/1", "p1", "force, cycle 2"), ("p1/2", "p1", "force, cycle 2"), ("p1/3", "p1", "joystick")
    ]  # fmt: skip
    assert comparison.rows[1].values[DRIVEN]["length_m"] == pytest.approx(oracles.length_by_steps(TRIALS[1].xy_m))


def test_poses_beside_the_centres_change_what_was_driven_but_not_what_is_on_the_grid():
    moved = trial(STRAIGHT, 1, xy_m=GRID.centres_of(STRAIGHT) + np.array([0.0, 0.03]))
    comparison = run([moved])
    assert of(comparison, "force, cycle 2", DRIVEN).mean["area_m2"] == pytest.approx(3.7 * 0.03)
    assert of(comparison, "force, cycle 2", ON_GRID).mean["area_m2"] == pytest.approx(0.0, abs=1e-12)


def test_the_baselines_are_the_straight_way_and_the_one_that_keeps_clear():
    comparison = run()
    nominal, avoidance = (of(comparison, "joystick", path_type).mean for path_type in (NOMINAL, AVOIDANCE))
    assert nominal["length_m"] == pytest.approx(3.7)
    assert nominal["area_m2"] == pytest.approx(0.0, abs=1e-12)
    assert nominal["min_distance_m"] == pytest.approx(1.05 - 0.98 - 0.25)
    assert PERSON_RADIUS_M <= avoidance["min_distance_m"] < PERSON_RADIUS_M + 0.1
    assert 3.7 < avoidance["length_m"] < 4.2
    assert avoidance["area_m2"] > 0


def test_learnt_paths_are_drawn_once_a_scene_from_the_seed():
    one, two, other = (run(reward=REWARD, samples=40, seed=seed) for seed in (0, 0, 1))
    learnt = of(one, "force, cycle 2", LEARNT)
    assert learnt.count == 2
    assert learnt == of(two, "force, cycle 2", LEARNT)
    assert learnt != of(other, "force, cycle 2", LEARNT)
    assert learnt.mean["min_distance_m"] > of(one, "force, cycle 2", NOMINAL).mean["min_distance_m"]
    # The scene is the same, and so are its paths; only what they are compared with differs.
    joystick = of(one, "joystick", LEARNT)
    assert {name: joystick.mean[name] for name in ("length_m", "area_m2")} == {
        name: learnt.mean[name] for name in ("length_m", "area_m2")
    }
    assert joystick.mean["hausdorff_m"] != learnt.mean["hausdorff_m"]


def test_learnt_values_are_those_of_the_paths_one_by_one():
    learnt = of(run(reward=REWARD, samples=200), "force, cycle 2", LEARNT)
    scene = scenes_of(TRIALS[:1])[0]
    policy = policy_of(REWARD, scene)
    (stream,) = np.random.default_rng(0).spawn(1)
    paths = sample_paths(policy, scene.start, 200, stream)
    lines = sampled_lines_m(policy, paths)
    nominal = scene.nominal_line_m()
    values = [line_values(line, nominal, PERSON, 0.25) for line in lines]
    assert set(values[0]) < set(learnt.mean)
    for name in values[0]:
        own = np.array([one[name] for one in values])
        loose = {"intimate_m", "personal_m", "social_m"} | {
            f"{zone}_share" for zone in ("intimate", "personal", "social")
        }
        rel = 1e-2 if name in loose or name in {"mean_distance_m", "compliance"} else 1e-9
        assert learnt.mean[name] == pytest.approx(own.mean(), rel=rel, abs=1e-9), name
        assert learnt.std[name] == pytest.approx(own.std(), rel=10 * rel, abs=1e-6), name
        assert learnt.error[name] == pytest.approx(own.std(ddof=1) / np.sqrt(200), rel=10 * rel, abs=1e-6), name
    shown = [GRID.centres_of(one.cells) for one in TRIALS[:2]]
    there = [[oracles_mean(demo, line) for line in lines] for demo in shown]
    back = [[oracles_mean(line, demo) for line in lines] for demo in shown]
    assert learnt.mean["to_learnt_m"] == pytest.approx(np.mean(there))
    assert learnt.mean["from_learnt_m"] == pytest.approx(np.mean(back))
    assert learnt.mean["dissimilarity_m"] == pytest.approx((np.mean(there) + np.mean(back)) / 2)
    assert learnt.mean["hausdorff_m"] == pytest.approx(np.maximum(there, back).mean())


def oracles_mean(one, other):
    """Mean over points of the distance to another line's segments."""
    return np.mean(
        [min(oracles.distance_to_segment(tuple(p), tuple(a), tuple(b))[0] for a, b in pairwise(other)) for p in one]
    )


def test_exact_values_stand_beside_those_of_many_paths():
    learnt = of(run(reward=REWARD, samples=4000), "force, cycle 2", LEARNT)
    assert set(learnt.exact) == {"length_m", "heading_rad", "intimate_m", "personal_m", "social_m", "public_m"}
    for name, value in learnt.exact.items():
        assert abs(learnt.mean[name] - value) <= 4 * learnt.error[name] + 1e-9, name


def test_a_precision_draws_until_it_is_reached():
    wanted = [BY_NAME[name] for name in ("area_m2", "min_distance_m", "hausdorff_m")]
    asked = compare(TRIALS, {"r": REWARD}, Precision(50, 0.005), np.random.default_rng(0), metrics=wanted)
    learnt = of(asked, "force, cycle 2", LEARNT)
    for metric in wanted:
        allowed = 0.005 * max(abs(learnt.mean[metric.name]), learnt.std[metric.name])
        assert learnt.error[metric.name] <= 1.2 * allowed, metric.name
    few = of(run(reward=REWARD, samples=50), "force, cycle 2", LEARNT)
    assert learnt.error["area_m2"] < few.error["area_m2"] / 2


def test_no_paths_are_drawn_for_what_visits_give_exactly():
    wanted = [BY_NAME["length_m"], BY_NAME["heading_rad"]]
    asked = compare(TRIALS, {"r": REWARD}, Precision(50, 0.005), np.random.default_rng(0), metrics=wanted)
    plain = compare(TRIALS, {"r": REWARD}, Precision(50), np.random.default_rng(0), metrics=wanted)
    assert asked == plain


def test_only_metrics_that_are_asked_for_are_computed():
    comparison = run(reward=REWARD, metrics=[BY_NAME["length_m"], BY_NAME["duration_s"]])
    for row in comparison.groups:
        assert set(row.mean) == ({"length_m", "duration_s"} if row.path_type == DRIVEN else {"length_m"}), row.path_type
    timed = run(reward=REWARD, metrics=[BY_NAME["duration_s"]])
    assert {row.path_type for row in timed.groups} == {DRIVEN}, "other types of paths have no times"
    assert {row.path_type for row in run(metrics=[BY_NAME["hausdorff_m"]]).groups} == set()


def test_learnt_paths_are_measured_against_each_demonstrations_own_nominal_path():
    # The same scene under two declared nominal lines: straight, and 0.5 m to the side.
    ends = GRID.centres_of([STRAIGHT[0], STRAIGHT[-1]])
    bent = np.array([ends[0], [0.65, 1.55], [3.15, 1.55], ends[1]])
    trials = [trial(STRAIGHT, 1, nominal_m=ends), trial(STRAIGHT, 2, Condition.JOYSTICK, None, nominal_m=bent)]
    both = run(trials, REWARD, samples=400)
    for one, group in zip(trials, ("force, cycle 2", "joystick"), strict=True):
        alone = of(run([one], REWARD, samples=400), group, LEARNT)
        found = of(both, group, LEARNT)
        assert abs(found.mean["area_m2"] - alone.mean["area_m2"]) < 5 * np.hypot(
            found.error["area_m2"], alone.error["area_m2"]
        )
    straight, beside = (of(both, group, LEARNT).mean["area_m2"] for group in ("force, cycle 2", "joystick"))
    assert abs(straight - beside) > 0.1


def test_nominal_lines_that_differ_within_a_cell_share_learnt_paths():
    ends = GRID.centres_of([STRAIGHT[0], STRAIGHT[-1]])
    trials = [trial(STRAIGHT, number, nominal_m=ends + np.array([0.01 * number, 0.0])) for number in (1, 2)]
    both = run(trials, REWARD, samples=50)
    alone = run(trials[:1], REWARD, samples=50)
    names = [metric.name for metric in PAPER_METRICS]
    found, expected = (of(one, "force, cycle 2", LEARNT).mean for one in (both, alone))
    assert [found[name] for name in names] == pytest.approx([expected[name] for name in names])


def test_every_missing_value_has_a_reason():
    trials = [trial(STRAIGHT, 1, people=make.NOBODY), trial(ROUND, 2, laid_out_m_s=0.4)]
    comparison = run(trials, REWARD)
    driven, learnt = (of(comparison, "force, cycle 2", path_type) for path_type in (DRIVEN, LEARNT))
    assert driven.missing["min_distance_m"] == {"no people in the scene": 1}
    assert driven.missing["speed_m_s"] == {"times not measured": 1}
    assert driven.missing["intimate_s"] == {"no people in the scene": 1, "times not measured": 1}
    assert driven.missing["peak_force_n"] == {"no wrench in the log": 2}
    assert learnt.missing["personal_m"] == {"no people in the scene": 1}
    for row in comparison.groups:
        for name, value in row.mean.items():
            assert np.isfinite(value) or row.count_of(name) == 0, (row.path_type, name)
            assert (row.count_of(name) < row.count) == (name in row.missing), (row.path_type, name)


def test_several_rewards_stand_side_by_side():
    comparison = run(reward={"near": REWARD, "far": Reward((-60.0, -0.5, -30.0, 1.0))}, samples=20)
    path_types = [row.path_type for row in comparison.groups if row.group == "joystick"]
    assert path_types == ["driven", "driven, on grid", "learnt, far", "learnt, near", "nominal", "avoidance"]
    far, near = (of(comparison, "joystick", f"learnt, {name}") for name in ("far", "near"))
    assert far.mean["min_distance_m"] > near.mean["min_distance_m"]


def test_groups_can_be_made_by_other_fields():
    trials = [trial(STRAIGHT, 1), trial(ROUND, 1, participant="p2"), trial(ROUND, 2, Condition.JOYSTICK, None)]
    by = {row.group for row in run(trials, fields=("participant",)).groups}
    assert by == {"p1", "p2"}
    assert {row.group for row in run(trials, fields=("participant", "condition")).groups} == {
        "force, p1", "force, p2", "joystick, p1",
    }  # fmt: skip
    assert {row.group for row in run(trials, fields=("cycle", "set")).groups} == {
        "cycle 2, main task", "no cycle, main task",
    }  # fmt: skip


def test_groups_come_in_the_order_of_the_table():
    comparison = run(reward=REWARD, samples=2)
    path_types = list(PATH_TYPES)
    assert [(one.group, one.path_type) for one in comparison.groups] == [
        (group, path_type) for group in ("force, cycle 2", "joystick") for path_type in path_types
    ]


def test_where_no_way_is_left_around_a_person_the_rest_is_measured_and_it_is_said():
    # The person stands beside the start.
    crowded = trial(STRAIGHT, 4, people=np.array([[0.2, 1.2]]))
    comparison = run([*TRIALS, crowded])
    assert len(comparison.notes) == 1
    assert comparison.notes[0].startswith("p1/4: no path around the people as obstacles: the cell at x 0.15 m")
    assert of(comparison, "force, cycle 2", AVOIDANCE).count == 2
    assert of(comparison, "force, cycle 2", DRIVEN).count == 3


def test_without_people_there_are_no_distances():
    comparison = run([trial(STRAIGHT, 1, people=make.NOBODY)])
    for group in comparison.groups:
        assert np.isnan(group.mean["min_distance_m"])
        assert group.mean["length_m"] == pytest.approx(3.7)


def test_progress_counts_demonstrations():
    seen = []
    run(progress=lambda done, of_all: seen.append((done, of_all)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_processes_change_nothing():
    here = run(reward=REWARD, samples=50)
    assert run(reward=REWARD, samples=50, executor=Local(2)) == here
    assert run(reward=REWARD, samples=50, executor=Here()) == here


def test_intervals_of_means_count_participants_not_trials():
    trials = [
        trial(STRAIGHT, 1), trial(ROUND, 2), trial(ROUND, 1, participant="p2"), trial(ROUND, 2, participant="p2"),
        trial(STRAIGHT, 1, participant="p3"),
    ]  # fmt: skip
    group = of(run(trials), "force, cycle 2", DRIVEN)
    straight, around = (oracles.length_by_steps(GRID.centres_of(cells)) for cells in (STRAIGHT, ROUND))
    means = [(straight + around) / 2, around, straight]
    low, high = stats.t.interval(0.95, 2, np.mean(means), stats.sem(means))
    assert group.half_interval["length_m"] == pytest.approx((high - low) / 2)
    assert np.isnan(of(run(trials[:2]), "force, cycle 2", DRIVEN).half_interval["length_m"])


def test_a_new_metric_is_its_declaration_and_nothing_else():
    def furthest_m(lines):
        distance = shapely.distance(shapely.points(lines.lines_m), shapely.LineString(lines.nominal_m))
        return distance.max(axis=1)

    toy = Metric("furthest_m", "furthest", "m", "largest distance from the nominal path", lines=furthest_m)
    metrics = (toy, BY_NAME["length_m"])
    comparison = run(reward=REWARD, samples=200, metrics=metrics)
    means = {row.path_type: row.mean["furthest_m"] for row in comparison.groups if row.group == "joystick"}
    assert means[NOMINAL] == pytest.approx(0.0, abs=1e-9)
    assert means[DRIVEN] == means[ON_GRID] == pytest.approx(0.7)
    assert 0.2 < means[LEARNT] < 1.0
    text = evaluation_text(comparison, [], Ranking(()), metrics, Format.TEXT)
    assert re.search(r"^joystick +driven +1 +0.700 ", text, re.MULTILINE)
    assert "furthest: largest distance from the nominal path" in text
    content = metrics_document(comparison, [], Ranking(()), metrics, [], Precision(200), 0)
    assert content["demonstrations"][2]["metrics"]["furthest_m"] == pytest.approx(0.7)
